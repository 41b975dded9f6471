//! Which nodes a view wants: one walk over the trees of all clouds, most important first.
//!
//! The result depends on the view, the trees and the previous view's selection only, not on what
//! is loaded: so the same camera settles on the same nodes whatever the network did, placed as exactly as it shows; those
//! that were seen from nearer stay exact while they are kept. (Which nodes are
//! left out as hidden does depend on the depths that came back; the picture does not.) It does not
//! depend on the order in which hierarchy pages arrive either, because a child's priority is capped
//! to its parent's and a page is as important as the node above it: what lies below an unloaded
//! page comes after the page.

use std::{
    cmp::{Ordering, Reverse},
    collections::{BinaryHeap, HashSet},
    ops::Range,
    sync::Arc,
};

use lodestream_protocol::{Lattice, LatticeBox, Manifest, Node, NodeKey, Refinement};

use super::{
    clip::ClipBox,
    occlusion::{Occluders, Suspect},
    piece::NodeId,
    plan::{LeftOut, Tally},
    priority::{Change, Priority},
    store::{GroupMask, group_bit},
    tree::{Children, Place, Tree},
    view::{Optics, WorldBox},
};

/// How much larger a node of the previous selection counts, so that nodes at the edge of the
/// budget do not come and go with every small motion.
const HYSTERESIS: f64 = 1.1;

/// Bounds of a selection.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    pub point_budget: u64,
    pub min_size_px: f64,
    pub cell_px: f64,
    pub culls_outside: bool,
    pub priority: Priority,
    pub clip: Option<ClipBox>,
}

/// A wanted node.
#[derive(Debug, Clone)]
pub(super) struct Pick {
    pub id: NodeId,
    pub node: Arc<Node>,
    pub refinement: Refinement,
    /// Index of the node above.
    pub parent: Option<usize>,
    /// In replacing clouds: indices of the nodes that are to stand in for this one.
    pub family: Option<Range<usize>>,
    /// At most that of the node above.
    pub priority: f64,
    /// How early it is loaded; at most that of the node above.
    pub urgency: f64,
    /// Points that this node or what stands in for it may come to.
    pub reserved: u64,
    /// Whether its positions are to be exact.
    pub is_exact: bool,
}

/// What a view wants.
#[derive(Debug, Default)]
pub(super) struct Selection {
    /// Most important first, and so ancestors before descendants.
    pub picks: Vec<Pick>,
    /// Nodes whose child page is wanted: cloud and node.
    pub pages: Vec<(usize, Arc<Node>)>,
    /// Points reserved: no subset that is drawn meanwhile comes to more.
    pub points: u64,
    /// Outside, small and over budget.
    pub left_out: LeftOut,
}

/// Walks the trees. `groups` tells for each cloud which groups are wanted, `occluders` what may
/// hide nodes.
pub(super) fn select(
    trees: &mut [Option<Tree>],
    groups: &[GroupMask],
    optics: &Optics,
    limits: Limits,
    previous: &HashSet<NodeId>,
    occluders: Option<Occluders>,
) -> Selection {
    let mut walk = Walk {
        trees,
        groups,
        optics,
        limits,
        previous,
        occluders,
        heap: BinaryHeap::new(),
        out: Selection::default(),
    };
    for cloud in 0..walk.trees.len() {
        walk.push_root(cloud);
    }
    while let Some(candidate) = walk.heap.pop() {
        if !walk.visit(candidate) {
            break;
        }
    }
    walk.out
}

/// Something that may be taken.
struct Candidate {
    priority: f64,
    /// Twice the level, plus one for a page: what follows from a node comes after it.
    depth: u16,
    id: NodeId,
    what: What,
}

enum What {
    /// A node of an additive cloud, or the root of a replacing one.
    Node { place: Place, parent: Option<usize> },
    /// All children that are to stand in for the node picked at that index, and their priorities.
    Family { pick: usize, children: Vec<(Place, f64)> },
    /// The page below the node.
    Page { node: Arc<Node> },
}

impl Candidate {
    fn rank(&self) -> (Reverse<u16>, Reverse<usize>, Reverse<NodeKey>) {
        (Reverse(self.depth), Reverse(self.id.cloud), Reverse(self.id.key))
    }
}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> Ordering {
        self.priority.total_cmp(&other.priority).then_with(|| self.rank().cmp(&other.rank()))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// How a node stands in the view.
enum Sight {
    Clipped,
    Outside,
    Hidden,
    Small { priority: f64 },
    Seen { priority: f64 },
}

struct Walk<'a> {
    trees: &'a mut [Option<Tree>],
    groups: &'a [GroupMask],
    optics: &'a Optics,
    limits: Limits,
    previous: &'a HashSet<NodeId>,
    occluders: Option<Occluders<'a>>,
    heap: BinaryHeap<Candidate>,
    out: Selection,
}

impl Walk<'_> {
    fn push_root(&mut self, cloud: usize) {
        let Some(place) = self.trees[cloud].as_mut().and_then(Tree::start_walk) else { return };
        // The root has no parent to stand for it: it is shown however small it is.
        match self.look(cloud, &place.node, None) {
            Sight::Hidden => {}
            Sight::Clipped => self.out.left_out.clipped.add(place.node.points),
            Sight::Outside => self.out.left_out.outside.add(place.node.points),
            Sight::Small { priority } | Sight::Seen { priority } => {
                self.push(cloud, &place.node.clone(), priority, What::Node { place, parent: None });
            }
        }
    }

    fn push(&mut self, cloud: usize, node: &Node, priority: f64, what: What) {
        let id = NodeId { cloud, key: node.key };
        let depth = 2 * u16::from(node.key.level()) + u16::from(!matches!(what, What::Node { .. }));
        self.heap.push(Candidate { priority, depth, id, what });
    }

    /// Takes what fits; `false` ends the walk.
    fn visit(&mut self, candidate: Candidate) -> bool {
        let cloud = candidate.id.cloud;
        match candidate.what {
            What::Page { node } => self.out.pages.push((cloud, node)),
            What::Node { place, parent } => {
                let points = u64::from(place.node.points);
                if self.out.points + points > self.limits.point_budget {
                    self.out.left_out.over_budget.add(place.node.points);
                    return self.goes_on_after(points);
                }
                self.out.points += points;
                let pick = self.pick(cloud, &place.node, parent, candidate.priority);
                self.expand(cloud, &place, pick);
            }
            What::Family { pick, children } => {
                let points = children.iter().map(|(place, _)| u64::from(place.node.points)).sum();
                let Some(growth) = self.reserve(pick, points) else {
                    let over_budget = &mut self.out.left_out.over_budget;
                    children.iter().for_each(|(place, _)| over_budget.add(place.node.points));
                    return self.goes_on_after(points);
                };
                self.out.points += growth;
                let first = self.out.picks.len();
                for (place, priority) in &children {
                    self.pick(cloud, &place.node, Some(pick), *priority);
                }
                self.out.picks[pick].family = Some(first..first + children.len());
                for (offset, (place, _)) in children.iter().enumerate() {
                    self.expand(cloud, place, first + offset);
                }
            }
        }
        true
    }

    /// Fraiss 2017, 3.2.4: the walk ends with the first node that exceeds the budget. Not so with
    /// one that can never fit: it would hide all that comes after it for good.
    fn goes_on_after(&mut self, points: u64) -> bool {
        if points > self.limits.point_budget {
            return true;
        }
        for candidate in std::mem::take(&mut self.heap) {
            let over_budget = &mut self.out.left_out.over_budget;
            match candidate.what {
                What::Page { .. } => {}
                What::Node { place, .. } => over_budget.add(place.node.points),
                What::Family { children, .. } => {
                    children.iter().for_each(|(place, _)| over_budget.add(place.node.points));
                }
            }
        }
        false
    }

    fn pick(
        &mut self,
        cloud: usize,
        node: &Arc<Node>,
        parent: Option<usize>,
        priority: f64,
    ) -> usize {
        let (refinement, urgency, is_exact) = match &self.trees[cloud] {
            Some(tree) => {
                let manifest = &tree.boot().manifest;
                let bounds = WorldBox::of(&node.bounds, &manifest.lattice);
                let urgency = self.limits.priority.urgency(self.optics, &bounds, priority);
                (manifest.refinement, urgency, self.shows_cells(manifest, node, &bounds))
            }
            None => (Refinement::Additive, priority, false),
        };
        let above = parent.map_or(f64::INFINITY, |parent| self.out.picks[parent].urgency);
        self.out.picks.push(Pick {
            id: NodeId { cloud, key: node.key },
            node: Arc::clone(node),
            refinement,
            parent,
            family: None,
            priority,
            urgency: urgency.min(above),
            reserved: u64::from(node.points),
            is_exact,
        });
        self.out.picks.len() - 1
    }

    /// Whether the cells that a node's points lie in are large enough to be seen. Where its positions are whole,
    /// but its colours may be coarse: whether its points are as far apart.
    fn shows_cells(&self, manifest: &Manifest, node: &Node, bounds: &WorldBox) -> bool {
        let Some(fine) = manifest.fine else { return false };
        let cell_bits = manifest.cell_bits(node.key.level(), node.spacing);
        if self.limits.cell_px <= 0.0 {
            return cell_bits > 0 || fine.color;
        }
        let cell_world = match (cell_bits, fine.color) {
            (0, false) => return false,
            (0, true) => f64::from(node.spacing) / f64::from(fine.cells_per_spacing),
            (bits, _) => f64::from(bits).exp2() * manifest.lattice.scale,
        };
        let cell_px = cell_world * self.optics.largest_scale(bounds);
        // Where the numbers are no numbers, too.
        cell_px.partial_cmp(&self.limits.cell_px).is_none_or(Ordering::is_gt)
    }

    /// Reserves points for the children of a replaced node and returns by how much the whole grows,
    /// or `None` where that exceeds the budget.
    ///
    /// A node and what stands in for it are never drawn together, so they come to the larger of
    /// the two; likewise for all nodes above.
    fn reserve(&mut self, pick: usize, children: u64) -> Option<u64> {
        let picks = &self.out.picks;
        let mut changes = Vec::new();
        let (mut at, mut family_points) = (pick, children);
        let growth = loop {
            let reserved = family_points.max(u64::from(picks[at].node.points));
            let growth = reserved - picks[at].reserved;
            changes.push((at, reserved));
            let Some(parent) = picks[at].parent else { break growth };
            let siblings = picks[parent].family.clone().unwrap_or_default();
            family_points = siblings.map(|i| picks[i].reserved).sum::<u64>() + growth;
            at = parent;
        };
        if self.out.points + growth > self.limits.point_budget {
            return None;
        }
        for (at, reserved) in changes {
            self.out.picks[at].reserved = reserved;
        }
        Some(growth)
    }

    /// Offers what lies below a picked node.
    fn expand(&mut self, cloud: usize, place: &Place, pick: usize) {
        if place.node.is_leaf() {
            return;
        }
        let priority = self.out.picks[pick].priority;
        let Some(tree) = self.trees[cloud].as_mut() else { return };
        match tree.children(place) {
            Children::Unknown => {
                if self.may_show_children(cloud, &place.node) {
                    let node = Arc::clone(&place.node);
                    self.push(cloud, &place.node, priority, What::Page { node });
                }
            }
            Children::Known(children) => match self.out.picks[pick].refinement {
                Refinement::Additive => self.offer_each(cloud, children, pick),
                Refinement::Replace => self.offer_family(cloud, children, pick),
            },
        }
    }

    fn offer_each(&mut self, cloud: usize, children: Vec<Place>, parent: usize) {
        let cap = self.out.picks[parent].priority;
        let above = Arc::clone(&self.out.picks[parent].node);
        for place in children {
            match self.look(cloud, &place.node, Some(&above)) {
                Sight::Clipped => self.out.left_out.clipped.add(place.node.points),
                Sight::Outside => self.out.left_out.outside.add(place.node.points),
                Sight::Hidden => self.out.left_out.hidden.add(place.node.points),
                Sight::Small { .. } => self.out.left_out.small.add(place.node.points),
                Sight::Seen { priority } => {
                    let node = Arc::clone(&place.node);
                    let what = What::Node { place, parent: Some(parent) };
                    self.push(cloud, &node, priority.min(cap), what);
                }
            }
        }
    }

    /// A node is replaced by all of its children that can be seen, or not at all.
    fn offer_family(&mut self, cloud: usize, children: Vec<Place>, pick: usize) {
        let cap = self.out.picks[pick].priority;
        let above = Arc::clone(&self.out.picks[pick].node);
        let (mut family, mut small) = (Vec::new(), Tally::default());
        let mut most: Option<f64> = None;
        for place in children {
            match self.look(cloud, &place.node, Some(&above)) {
                Sight::Clipped => self.out.left_out.clipped.add(place.node.points),
                Sight::Outside => self.out.left_out.outside.add(place.node.points),
                Sight::Hidden => self.out.left_out.hidden.add(place.node.points),
                Sight::Small { priority } => {
                    small.add(place.node.points);
                    family.push((place, priority.min(cap)));
                }
                Sight::Seen { priority } => {
                    most = Some(most.unwrap_or(0.0).max(priority.min(cap)));
                    family.push((place, priority.min(cap)));
                }
            }
        }
        match most {
            Some(priority) => {
                self.push(cloud, &above, priority, What::Family { pick, children: family })
            }
            None => {
                self.out.left_out.small.nodes += small.nodes;
                self.out.left_out.small.points += small.points;
            }
        }
    }

    fn is_clipped(&self, bounds: &WorldBox) -> bool {
        self.limits.clip.is_some_and(|clip| clip.excludes(bounds))
    }

    fn is_outside(&self, bounds: &WorldBox) -> bool {
        self.limits.culls_outside && self.optics.is_outside(bounds)
    }

    /// How `node`, a child of `above`, stands in the view.
    fn look(&mut self, cloud: usize, node: &Node, above: Option<&Node>) -> Sight {
        let Some(tree) = &self.trees[cloud] else { return Sight::Outside };
        let lattice = &tree.boot().manifest.lattice;
        let bounds = WorldBox::of(&node.bounds, lattice);
        if self.is_clipped(&bounds) {
            return Sight::Clipped;
        }
        if self.is_outside(&bounds) {
            return Sight::Outside;
        }
        let bonus =
            if self.previous.contains(&NodeId { cloud, key: node.key }) { HYSTERESIS } else { 1.0 };
        let wanted = node.payloads.iter().enumerate();
        let wanted = wanted.filter(|&(group, _)| self.groups[cloud] & group_bit(group) != 0);
        let change = Change {
            // Where there is nothing, the whole is missing.
            error_before: above.map_or(2.0 * bounds.radius(), coarseness),
            error_after: coarseness(node),
            bytes: wanted.map(|(_, payload)| u64::from(payload.bytes)).sum(),
        };
        let priority = bonus * self.limits.priority.of(self.optics, &bounds, change);
        // Whether the node is worth its detail is a matter of its cube: by its tight bounds a node
        // with few points would never show, and the density of its neighbours' would not be its.
        let cube = cube_radius(lattice.node_side_world(node.key.level()));
        if bonus * self.optics.projected_size(bounds.center, cube) < self.limits.min_size_px {
            return Sight::Small { priority };
        }
        match above {
            Some(above) if self.is_hidden(cloud, node, above, bounds) => Sight::Hidden,
            _ => Sight::Seen { priority },
        }
    }

    fn is_hidden(&mut self, cloud: usize, node: &Node, above: &Node, bounds: WorldBox) -> bool {
        let (Some(occluders), Some(tree)) = (&mut self.occluders, &self.trees[cloud]) else {
            return false;
        };
        let manifest = &tree.boot().manifest;
        if manifest.refinement == Refinement::Replace {
            return false;
        }
        let suspect = Suspect {
            id: NodeId { cloud, key: node.key },
            bounds,
            spacing: f64::from(node.spacing),
            spacing_above: f64::from(above.spacing),
        };
        occluders.hide(self.optics, &suspect)
    }

    /// Whether a child of `node`, of which only the octant is known, can turn out to be
    /// [`Sight::Seen`]. Says yes in doubt.
    fn may_show_children(&self, cloud: usize, node: &Node) -> bool {
        let Some(tree) = &self.trees[cloud] else { return false };
        let lattice = &tree.boot().manifest.lattice;
        node.children().any(|key| {
            let Some(octant) = octant_within(key, &node.bounds, lattice) else { return false };
            let octant = WorldBox::of(&octant, lattice);
            let cube = cube_radius(lattice.node_side_world(key.level()));
            let largest = HYSTERESIS * self.optics.largest_projected_size(&octant, cube);
            !self.is_clipped(&octant)
                && !self.is_outside(&octant)
                && largest >= self.limits.min_size_px
        })
    }
}

/// The part of a node's cube that lies in a box; `None` where there is none.
fn octant_within(key: NodeKey, bounds: &LatticeBox, lattice: &Lattice) -> Option<LatticeBox> {
    let corner = lattice.node_min(key);
    let last = u32::try_from((1u64 << lattice.node_bits(key.level())) - 1).unwrap_or(u32::MAX);
    let octant = LatticeBox {
        min: std::array::from_fn(|a| bounds.min[a].max(corner[a])),
        max: std::array::from_fn(|a| bounds.max[a].min(corner[a].saturating_add(last))),
    };
    (0..3).all(|axis| octant.min[axis] <= octant.max[axis]).then_some(octant)
}

/// World units by which the picture is off where a node is the finest that is drawn. A leaf brings all
/// there is, but its points have their distance, too.
fn coarseness(node: &Node) -> f64 {
    f64::from(node.geometric_error.max(node.spacing))
}

/// Radius of the sphere around a cube.
fn cube_radius(side: f64) -> f64 {
    0.5 * 3_f64.sqrt() * side
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use glam::DVec3;
    use lodestream_protocol::{Boot, HierarchyPage, Manifest, PageRef, PayloadRef};
    use proptest::prelude::*;

    use super::*;
    use crate::{
        camera::{Camera, Projection},
        engine::{testing, view::View},
    };

    /// The cube is 256 world units wide.
    const LATTICE: Lattice = Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 8 };

    /// Of a tree with many nodes.
    const SEED: u64 = 5;

    /// A random tree of four levels with pages of two, and all of its pages.
    struct Forest {
        boot: Arc<Boot>,
        pages: HashMap<NodeKey, HierarchyPage>,
    }

    impl Forest {
        fn new(seed: u64, refinement: Refinement) -> Self {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mut pages = HashMap::new();
            let mut root_page = Vec::new();
            let whole = LatticeBox { min: [0; 3], max: [255; 3] };
            let mut open = vec![(NodeKey::ROOT, whole, None)];
            while let Some((key, within, page)) = open.pop() {
                let bounds = random_box(within, &mut rng);
                let child_mask = if key.level() == 3 { 0 } else { rng.u8(..) };
                let points = rng.u32(1..1000);
                let payloads = vec![PayloadRef { offset: 0, bytes: 5 * points, crc: 0 }];
                let mut node = Node { child_mask, points, bounds, payloads, ..testing::node(key) };
                let below: Vec<_> = node
                    .children()
                    .filter_map(|child| Some((child, overlap(cube(child), bounds)?)))
                    .collect();
                node.child_mask = below.iter().fold(0, |mask, (c, _)| mask | 1 << c.octant());
                if !node.is_leaf() {
                    // Odd trees may say that there is more error below.
                    node.geometric_error = 16.0 * rng.f32() / f32::from(1u8 << key.level());
                }
                if key.level() == 1 && !node.is_leaf() {
                    node.child_page = Some(PageRef { offset: 0, bytes: 1, nodes: 1, crc: 0 });
                }
                let below_page = if node.child_page.is_some() { Some(key) } else { page };
                open.extend(below.into_iter().map(|(child, within)| (child, within, below_page)));
                match page {
                    None => root_page.push(node),
                    Some(page) => {
                        pages.entry(page).or_insert_with(HierarchyPage::default).nodes.push(node);
                    }
                }
            }
            let manifest =
                Manifest { refinement, lattice: LATTICE, bounds: whole, ..testing::manifest() };
            let boot = testing::boot([0; 16], manifest, root_page);
            Self { boot: Arc::new(boot), pages }
        }

        /// The tree with these pages.
        fn tree<'a>(&self, pages: impl IntoIterator<Item = &'a NodeKey>) -> Vec<Option<Tree>> {
            let mut tree = Tree::new(Arc::clone(&self.boot), None);
            pages.into_iter().for_each(|key| tree.add_page(*key, self.pages[key].clone()));
            vec![Some(tree)]
        }
    }

    fn cube(key: NodeKey) -> LatticeBox {
        let min = LATTICE.node_min(key);
        let last = (1 << LATTICE.node_bits(key.level())) - 1;
        LatticeBox { min, max: min.map(|c| c + last) }
    }

    fn overlap(a: LatticeBox, b: LatticeBox) -> Option<LatticeBox> {
        let min: [u32; 3] = std::array::from_fn(|i| a.min[i].max(b.min[i]));
        let max: [u32; 3] = std::array::from_fn(|i| a.max[i].min(b.max[i]));
        (0..3).all(|i| min[i] <= max[i]).then_some(LatticeBox { min, max })
    }

    /// Bounds inside those of the parent, often flat or long: then a child can be more important
    /// than its parent.
    fn random_box(mut within: LatticeBox, rng: &mut fastrand::Rng) -> LatticeBox {
        for axis in 0..3 {
            if rng.u8(0..3) == 0 {
                within.min[axis] = rng.u32(within.min[axis]..=within.max[axis]);
                within.max[axis] = rng.u32(within.min[axis]..=within.max[axis]);
            }
        }
        within
    }

    fn optics(eye: [f64; 3], target: [f64; 3], fov_y: f64) -> Optics {
        let projection = Projection::Perspective { fov_y };
        let camera = Camera { eye: eye.into(), target: target.into(), up: DVec3::Z, projection };
        Optics::new(&View { camera, size_px: [640, 480] })
    }

    const LIMITS: Limits = Limits {
        point_budget: 8000,
        cell_px: 0.25,
        min_size_px: 20.0,
        culls_outside: true,
        priority: Priority::ErrorPerByte,
        clip: None,
    };

    /// Of a forest, wanting the only group.
    fn selected(
        trees: &mut [Option<Tree>],
        optics: &Optics,
        limits: Limits,
        previous: &HashSet<NodeId>,
    ) -> Selection {
        let groups = vec![1; trees.len()];
        select(trees, &groups, optics, limits, previous, None)
    }

    fn keys(selection: &Selection) -> Vec<NodeKey> {
        selection.picks.iter().map(|pick| pick.id.key).collect()
    }

    fn priorities() -> impl Strategy<Value = Priority> {
        prop_oneof![Just(Priority::ErrorPerByte), Just(Priority::Fraiss)]
    }

    fn refinements() -> impl Strategy<Value = Refinement> {
        prop_oneof![Just(Refinement::Additive), Just(Refinement::Replace)]
    }

    fn place() -> impl Strategy<Value = [f64; 3]> {
        prop::array::uniform3(-300.0..500.0)
    }

    proptest! {
        #[test]
        fn loading_only_the_pages_asked_for_ends_with_the_selection_of_the_whole_tree(
            seed in any::<u64>(), refinement in refinements(), eye in place(), target in place(),
            fov_y in 0.1..3.1, point_budget in 0u64..50_000, priority in priorities(), min_size_px in 1.0..100.0,
            first in prop::collection::vec(any::<prop::sample::Index>(), 0..3),
        ) {
            let forest = Forest::new(seed, refinement);
            let (optics, none) = (optics(eye, target, fov_y), HashSet::new());
            let limits = Limits { point_budget, min_size_px, priority, ..LIMITS };
            let whole = selected(&mut forest.tree(forest.pages.keys()), &optics, limits, &none);
            prop_assert!(whole.pages.is_empty());
            // Some pages are there already, from an earlier view.
            let mut all: Vec<_> = forest.pages.keys().copied().collect();
            all.sort_unstable();
            let mut loaded: HashSet<NodeKey> = HashSet::new();
            if !all.is_empty() {
                loaded.extend(first.iter().map(|index| all[index.index(all.len())]));
            }
            let found = loop {
                let found = selected(&mut forest.tree(&loaded), &optics, limits, &none);
                if found.pages.is_empty() {
                    break found;
                }
                loaded.extend(found.pages.iter().map(|(_, node)| node.key));
            };
            prop_assert_eq!(keys(&found), keys(&whole));
            prop_assert_eq!(found.points, whole.points);
        }

        #[test]
        fn picks_keep_the_budget_and_come_after_their_parents(
            seed in any::<u64>(), refinement in refinements(), eye in place(), target in place(),
            fov_y in 0.1..3.1, point_budget in 0u64..50_000, priority in priorities(),
        ) {
            let forest = Forest::new(seed, refinement);
            let limits = Limits { point_budget, min_size_px: 1.0, priority, ..LIMITS };
            let mut trees = forest.tree(forest.pages.keys());
            let selection = selected(&mut trees, &optics(eye, target, fov_y), limits, &HashSet::new());
            prop_assert!(selection.points <= point_budget);
            let picks = &selection.picks;
            for (index, pick) in picks.iter().enumerate() {
                let above = pick.parent.map(|parent| (parent, picks[parent].id.key));
                prop_assert_eq!(above.map(|(_, key)| key), pick.id.key.parent());
                prop_assert!(above.is_none_or(|(parent, _)| parent < index));
                prop_assert!(pick.parent.is_none_or(|p| pick.priority <= picks[p].priority));
            }
            // What is reserved is exactly the most that any subset allowed to be drawn comes to.
            fn most(picks: &[Pick], index: usize) -> u64 {
                let own = u64::from(picks[index].node.points);
                let family = picks[index].family.clone().unwrap_or_default();
                own.max(family.map(|child| most(picks, child)).sum())
            }
            let expected = match refinement {
                Refinement::Additive => picks.iter().map(|p| u64::from(p.node.points)).sum(),
                Refinement::Replace if picks.is_empty() => 0,
                Refinement::Replace => most(picks, 0),
            };
            prop_assert_eq!(selection.points, expected);
        }
    }

    #[test]
    fn a_small_motion_back_and_forth_changes_nothing() {
        let forest = Forest::new(SEED, Refinement::Additive);
        let mut trees = forest.tree(forest.pages.keys());
        let mut swing = |priority, side: f64, point_budget, remember: bool| {
            let limits = Limits { point_budget, priority, ..LIMITS };
            let mut selections: Vec<HashSet<NodeId>> = vec![HashSet::new()];
            for step in 0..6 {
                let eye = [128.0 + side * f64::from(step % 2), -400.0, 128.0];
                let previous = if remember { &selections[step as usize] } else { &selections[0] };
                let selection =
                    selected(&mut trees, &optics(eye, [128.0; 3], 1.0), limits, previous);
                selections.push(selection.picks.iter().map(|pick| pick.id).collect());
            }
            selections[2..].windows(2).filter(|pair| pair[0] != pair[1]).count()
        };
        let budgets = (2000..20_000).step_by(250);
        for (priority, side) in [(Priority::ErrorPerByte, 32.0), (Priority::Fraiss, 4.0)] {
            let mut swings = |remember| {
                budgets.clone().map(|budget| swing(priority, side, budget, remember)).sum::<usize>()
            };
            assert!(swings(false) > 0, "without hysteresis, nodes come and go ({priority:?})");
            assert_eq!(swings(true), 0, "{priority:?}");
        }
    }

    #[test]
    fn a_node_larger_than_the_budget_hides_nothing_but_itself() {
        let forest = Forest::new(SEED, Refinement::Additive);
        let mut huge = forest.boot.as_ref().clone();
        huge.root_page.nodes[0].points = 1_000_000;
        let mut trees = forest.tree(forest.pages.keys());
        trees.insert(0, Some(Tree::new(Arc::new(huge), None)));
        let limits = LIMITS;
        let optics = optics([128.0, -400.0, 128.0], [128.0; 3], 1.0);
        let selection = selected(&mut trees, &optics, limits, &HashSet::new());
        assert!(!selection.picks.is_empty());
        assert!(selection.picks.iter().all(|pick| pick.id.cloud == 1));
    }

    #[test]
    fn the_tree_of_these_tests_is_large() {
        let forest = Forest::new(SEED, Refinement::Additive);
        let limits = Limits { point_budget: u64::MAX, min_size_px: 0.0, ..LIMITS };
        let optics = optics([128.0, -400.0, 128.0], [128.0; 3], 1.0);
        let mut trees = forest.tree(forest.pages.keys());
        assert!(selected(&mut trees, &optics, limits, &HashSet::new()).picks.len() > 50);
    }

    #[test]
    fn a_cloud_of_one_point_is_seen_from_afar() {
        let mut forest = Forest::new(SEED, Refinement::Additive);
        let mut boot = forest.boot.as_ref().clone();
        boot.root_page.nodes.truncate(1);
        boot.root_page.nodes[0].child_mask = 0;
        boot.root_page.nodes[0].bounds = LatticeBox { min: [7; 3], max: [7; 3] };
        forest.boot = Arc::new(boot);
        let limits = Limits { min_size_px: 50.0, ..LIMITS };
        let optics = optics([0.0, -1e6, 0.0], [7.0; 3], 1.0);
        let selection = selected(&mut forest.tree([]), &optics, limits, &HashSet::new());
        assert_eq!(keys(&selection), [NodeKey::ROOT]);
    }
}
