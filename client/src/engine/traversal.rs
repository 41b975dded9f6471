//! The traversal thread: decides what is drawn and what is loaded.
//!
//! Owned by the engine; sole owner of the trees and of all decoded nodes. It sleeps until the view
//! changes or the loader has news, then walks the trees (if the view or a tree is new), resolves
//! what can be drawn, publishes a plan and hands the loader a new demand.
//!
//! Node states and who knows them: unknown (nobody), queued, loading and failed-until (the loader),
//! resident and lost (the store here), shown (in the plan).

use std::{collections::HashSet, sync::Arc, time::Instant};

use lodestream_protocol::Boot;

use super::{
    board::CloudStatus,
    clouds::Clouds,
    commons::Commons,
    config::EngineConfig,
    drawing::{self, Presence},
    event::Event,
    inbox::{Demand, TraversalMail},
    occlusion::{Drawn, DrawnNode, Occluders},
    piece::{NodeId, Part, Piece, PieceId},
    plan::{DrawNode, FramePlan, MissingPage, WantedNode},
    selection::{self, Limits, Pick, Selection},
    settings::Settings,
    shared::Shared,
    store::{GroupMask, Store, group_bit},
    tree::Tree,
    view::{Optics, View},
};

/// Most bytes of one cloud that are asked of the loader at a time. More follow when these are in.
const MAX_DEMAND_BYTES: u64 = 64 << 20;

/// The thread's state.
pub(super) struct Traversal {
    shared: Arc<Shared>,
    limits: Limits,
    attributes: Vec<String>,
    settings: Settings,
    clouds: Vec<Cloud>,
    trees: Vec<Option<Tree>>,
    /// For those who draw.
    manifests: Clouds,
    store: Store,
    view: Option<View>,
    view_generation: u64,
    selection: Selection,
    /// Nodes of the last view's selection, for hysteresis.
    previous: HashSet<NodeId>,
    /// Whether depths are used at all.
    occlusion: bool,
    /// The newest picture of the view.
    drawn: Option<Drawn>,
    /// Pictures up to that plan's show what is not to be seen any more.
    outdated: u64,
    /// Nodes of the view that are not to be taken for hidden.
    in_sight: HashSet<NodeId>,
    /// What the newest plan draws, and how exactly.
    shown: Vec<DrawnNode>,
    /// What the newest plan wants: indices into the selection.
    needed: Vec<usize>,
    /// Where other engines may have the same pages.
    commons: Option<Arc<Commons>>,
    /// Whether everything that the newest plan wants is there.
    is_loaded: bool,
    /// Numbers of clouds that can be read again. It is told together with the plan that knows of it: the one before may be
    /// settled without them.
    recovered: Vec<usize>,
    sequence: u64,
}

#[derive(Debug, Clone, Copy, Default)]
struct Cloud {
    /// By which the caller knows it.
    number: usize,
    /// Groups that a complete node has, but for fine positions.
    groups: GroupMask,
    /// The group of fine positions, where the cloud has any.
    fine: GroupMask,
    failed: bool,
    /// Whether it was removed, or another version stands in its place.
    gone: bool,
}

impl Traversal {
    pub fn new(shared: Arc<Shared>, config: &EngineConfig) -> Self {
        Self {
            shared,
            limits: Limits {
                point_budget: config.point_budget,
                min_size_px: config.min_size_px,
                cell_px: config.cell_px,
                culls_outside: config.culls_outside,
                priority: config.priority,
                clip: None,
            },
            attributes: config.attributes.clone(),
            settings: Settings::new(config),
            clouds: Vec::new(),
            trees: Vec::new(),
            manifests: Clouds::new(),
            store: Store::new(config.cache_bytes),
            view: None,
            view_generation: 0,
            selection: Selection::default(),
            previous: HashSet::new(),
            occlusion: config.occlusion,
            drawn: None,
            outdated: 0,
            in_sight: HashSet::new(),
            shown: Vec::new(),
            needed: Vec::new(),
            commons: None,
            is_loaded: false,
            recovered: Vec::new(),
            sequence: 0,
        }
    }

    /// The same, keeping what is equal in other engines once.
    pub fn sharing(self, commons: Arc<Commons>) -> Self {
        Self { commons: Some(commons), ..self }
    }

    /// What the newest plan wants.
    pub fn wanted(&self) -> impl Iterator<Item = WantedNode> {
        self.needed.iter().map(|&i| {
            let pick = &self.selection.picks[i];
            let cloud = self.clouds[pick.id.cloud];
            let groups = cloud.groups | if pick.is_exact { cloud.fine } else { 0 };
            let payloads = pick.node.payloads.iter().enumerate();
            let wanted = payloads.filter(|(group, _)| groups & group_bit(*group) != 0);
            WantedNode {
                cloud: cloud.number,
                key: pick.id.key,
                bytes: wanted.map(|(_, payload)| u64::from(payload.bytes)).sum(),
                is_there: groups & !self.store.groups(pick.id) == 0,
            }
        })
    }

    /// The parts of the indices that the newest plan lacks.
    pub fn unknown(&self) -> impl Iterator<Item = MissingPage> {
        let is_unopened = |(tree, cloud): &(&Option<Tree>, &Cloud)| tree.is_none() && !cloud.gone;
        let unopened = self.trees.iter().zip(&self.clouds).filter(is_unopened);
        let first = unopened.map(|(_, cloud)| MissingPage { cloud: cloud.number, below: None });
        let further = self.missing_pages().into_iter().map(|page| {
            let NodeId { cloud, key } = page.id.node;
            MissingPage { cloud: self.clouds[cloud].number, below: Some(key) }
        });
        first.chain(further)
    }

    /// Runs until the inbox says to end.
    pub fn run(mut self) {
        loop {
            let mail = self.shared.traversal.take();
            if mail.shutdown {
                return;
            }
            self.step(mail);
        }
    }

    /// Takes in the news and tells what comes of it.
    pub fn step(&mut self, mut mail: TraversalMail) {
        let seen = mail.posted;
        let drawn = mail.drawn.take();
        let is_only_drawn = mail.events.is_empty()
            && mail.attributes.is_none()
            && mail.generation == self.view_generation;
        let mut reselect = self.read(mail);
        let is_new = drawn.is_some_and(|drawn| self.see(drawn));
        if is_only_drawn && !is_new {
            // A plan for a picture that is known would be drawn, and tell of that picture again.
            return;
        }
        reselect |= is_new;
        let begin = Instant::now();
        if reselect {
            self.select();
        }
        self.publish(seen);
        let counters = &self.shared.counters;
        counters.plans.add(1);
        counters.plan_nanos.add(u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX));
    }

    /// Takes in a picture; returns whether it is news.
    fn see(&mut self, drawn: Drawn) -> bool {
        let is_of_view = Some(drawn.view) == self.view && drawn.sequence > self.outdated;
        let is_new = self.drawn.as_ref().is_none_or(|last| !last.is_same(&drawn));
        let is_news = self.occlusion && is_of_view && is_new;
        if is_news {
            self.drawn = Some(drawn);
        }
        is_news
    }

    /// Takes in the news; returns whether another selection may be wanted.
    fn read(&mut self, mail: TraversalMail) -> bool {
        let mut reselect = false;
        if mail.view != self.view {
            self.previous = self.selection.picks.iter().map(|pick| pick.id).collect();
            self.view = mail.view;
            self.drawn = None;
            self.in_sight.clear();
            reselect = true;
        }
        if mail.settings != self.settings {
            self.apply(mail.settings);
            reselect = true;
        }
        self.view_generation = mail.generation;
        if let Some(attributes) = mail.attributes {
            self.attributes = attributes;
            (0..self.clouds.len()).for_each(|cloud| self.update_groups(cloud));
            // Nodes are worth their bytes.
            reselect = true;
        }
        for event in mail.events {
            match event {
                Event::Added { cloud, number } => {
                    self.clouds.resize(self.clouds.len().max(cloud + 1), Cloud::default());
                    self.trees.resize_with(self.clouds.len(), || None);
                    self.clouds[cloud].number = number;
                    self.manifests.set(number, None);
                }
                Event::Removed { number } => {
                    self.remove(number);
                    reselect = true;
                }
                // Removed while it was being replaced: the version that comes is none any more, either.
                Event::Replaced { cloud, by, .. } if self.clouds[cloud].gone => {
                    self.clouds.resize(self.clouds.len().max(by + 1), Cloud::default());
                    self.trees.resize_with(self.clouds.len(), || None);
                    self.clouds[by].gone = true;
                }
                // The loader tells on for a while of clouds that were removed.
                Event::Opened { cloud, .. }
                | Event::CloudFailed { cloud, .. }
                | Event::CloudIsBack { cloud }
                | Event::Group { node: NodeId { cloud, .. }, .. }
                | Event::Lost { piece: PieceId { node: NodeId { cloud, .. }, .. }, .. }
                    if self.clouds[cloud].gone => {}
                Event::Opened { cloud, boot } => {
                    self.open(cloud, boot);
                    reselect = true;
                }
                Event::Replaced { cloud, by, boot } => {
                    self.clouds.resize(self.clouds.len().max(by + 1), Cloud::default());
                    self.trees.resize_with(self.clouds.len(), || None);
                    self.clouds[by].number = self.clouds[cloud].number;
                    self.drop_version(cloud);
                    self.open(by, boot);
                    let number = self.clouds[by].number;
                    self.post(number, |status| status.replaced += 1);
                    reselect = true;
                }
                Event::CloudFailed { cloud, message } => {
                    let number = self.clouds[cloud].number;
                    self.clouds[cloud].failed = true;
                    self.recovered.retain(|&recovered| recovered != number);
                    self.post(number, |status| status.failure = Some(message.clone()));
                    self.shared.board.post(|news| news.add_problem(message));
                }
                Event::CloudIsBack { cloud } => {
                    self.clouds[cloud].failed = false;
                    self.store.find(cloud);
                    self.recovered.push(self.clouds[cloud].number);
                }
                Event::Page { cloud, parent, page } => {
                    if let Some(tree) = &mut self.trees[cloud] {
                        tree.add_page(parent, page);
                        reselect = true;
                    }
                }
                Event::Group { node, group, content } => self.store.add(node, group, content),
                Event::Lost { piece, message } => {
                    self.store.lose(piece);
                    // Nothing is hidden any more: see `select`.
                    reselect |= self.drawn.is_some();
                    self.shared.board.post(|news| news.add_problem(message));
                }
            }
        }
        reselect
    }

    /// What lies behind the last picture may be in sight now.
    fn forget_picture(&mut self) {
        self.drawn = None;
        self.in_sight.clear();
        self.outdated = self.sequence;
    }

    fn apply(&mut self, settings: Settings) {
        if settings.clip != self.settings.clip || settings.hidden != self.settings.hidden {
            self.forget_picture();
        }
        self.limits.point_budget = settings.point_budget;
        self.limits.min_size_px = settings.min_size_px;
        self.limits.clip = settings.clip;
        self.store.set_cache_limit(settings.cache_bytes);
        self.settings = settings;
        for (tree, cloud) in self.trees.iter_mut().zip(&self.clouds) {
            let is_hidden = self.settings.hidden.contains(&cloud.number);
            tree.iter_mut().for_each(|tree| tree.hide(is_hidden));
        }
    }

    fn open(&mut self, cloud: usize, boot: Arc<Boot>) {
        let number = self.clouds[cloud].number;
        let mut tree = Tree::new(Arc::clone(&boot), self.commons.clone());
        tree.hide(self.settings.hidden.contains(&number));
        self.trees[cloud] = Some(tree);
        self.clouds[cloud].failed = false;
        self.update_groups(cloud);
        self.manifests.set(number, Some(&boot));
        self.recovered.push(number);
        self.post(number, |status| status.boot = Some(boot));
    }

    /// Another version stands in the cloud's place, or none.
    fn drop_version(&mut self, cloud: usize) {
        self.clouds[cloud].gone = true;
        self.trees[cloud] = None;
        self.store.forget(cloud);
        self.forget_picture();
    }

    fn remove(&mut self, number: usize) {
        for cloud in 0..self.clouds.len() {
            if self.clouds[cloud].number == number && !self.clouds[cloud].gone {
                self.drop_version(cloud);
            }
        }
        self.manifests.set(number, None);
    }

    fn post(&self, number: usize, change: impl FnOnce(&mut CloudStatus)) {
        self.shared.board.post(|news| news.cloud(number, change));
    }

    /// Works out which groups the view needs of a cloud.
    fn update_groups(&mut self, cloud: usize) {
        let Some(tree) = &self.trees[cloud] else { return };
        let manifest = &tree.boot().manifest;
        let required = manifest.primitive.required_attributes().iter().map(|&(name, _)| name);
        let wanted = self.attributes.iter().map(String::as_str);
        self.clouds[cloud].groups = required
            .chain(wanted)
            .filter_map(|name| manifest.attribute(name)?.group())
            .fold(group_bit(0), |mask, group| mask | group_bit(group));
        self.clouds[cloud].fine = manifest.fine.map_or(0, |fine| group_bit(fine.group));
    }

    fn select(&mut self) {
        let Some(view) = &self.view else { return };
        let optics = Optics::new(view);
        let groups: Vec<_> = self.clouds.iter().map(|cloud| cloud.groups).collect();
        // Where a node is lost, those above it may be drawn larger than its neighbours tell.
        let drawn = self.drawn.as_ref().filter(|_| !self.store.has_lost());
        let occluders = drawn.map(|drawn| Occluders {
            drawn,
            in_sight: &mut self.in_sight,
            cell_px: self.limits.cell_px,
            is_complete: self.is_loaded && drawn.is_of(self.shown.iter().copied()),
        });
        let (limits, previous) = (self.limits, &self.previous);
        self.selection =
            selection::select(&mut self.trees, &groups, &optics, limits, previous, occluders);
    }

    /// Publishes the plan for the selection and what is loaded, and asks for the rest.
    fn publish(&mut self, seen: u64) {
        let drawing = drawing::draw(&self.selection.picks, |pick| self.presence(pick));
        let needed = drawing.needed.iter().map(|&i| self.selection.picks[i].id).collect();
        let moved = self.store.pin(&needed);

        let mut plan = FramePlan {
            view_generation: self.view_generation,
            view: self.view,
            clouds: self.manifests.list(),
            points_wanted: self.selection.points,
            left_out: self.selection.left_out,
            cached_bytes: self.store.cached_bytes(),
            ..FramePlan::default()
        };
        for &i in &drawing.drawn {
            let pick = &self.selection.picks[i];
            if let Some(points) = self.store.points(pick.id) {
                plan.points += u64::from(pick.node.points);
                plan.nodes.push(DrawNode {
                    cloud: self.clouds[pick.id.cloud].number,
                    key: pick.id.key,
                    spacing: pick.node.spacing,
                    points: Arc::clone(points),
                    part: 0,
                });
            }
        }
        let mut pieces = self.missing_pages();
        plan.pages_loading = pieces.len() as u64;
        let mut in_turn = drawing.needed.clone();
        // Nodes above others are at least as urgent, and come before them among equals.
        in_turn.sort_by(|&a, &b| {
            let urgency = |i: usize| self.selection.picks[i].urgency;
            urgency(b).total_cmp(&urgency(a))
        });
        // Every node roughly before any of them exactly.
        let mut fine = Vec::new();
        for i in in_turn {
            let pick = &self.selection.picks[i];
            let before = pieces.len();
            self.missing_groups(pick, self.clouds[pick.id.cloud].groups, &mut pieces);
            if pieces.len() > before {
                plan.left_out.loading.add(pick.node.points);
            } else if self.presence(pick) == Presence::Lost {
                plan.left_out.failed.add(pick.node.points);
            } else if pick.is_exact {
                self.missing_groups(pick, self.clouds[pick.id.cloud].fine, &mut fine);
            }
        }
        pieces.append(&mut fine);
        let all_open = self.trees.iter().zip(&self.clouds).all(|(tree, cloud)| {
            let is_hidden = self.settings.hidden.contains(&cloud.number);
            tree.is_some() || cloud.failed || cloud.gone || is_hidden
        });
        self.shown = plan.nodes.iter().map(DrawnNode::of).collect();
        self.is_loaded = self.view.is_some() && all_open && pieces.is_empty();
        self.needed = drawing.needed;
        plan.settled = self.is_loaded && self.hides_rightly();
        // Per cloud, so that a host which does not answer keeps nothing from the others.
        let mut bytes = vec![0; self.clouds.len()];
        pieces.retain(|piece| {
            let bytes = &mut bytes[piece.id.node.cloud];
            let fits = *bytes <= MAX_DEMAND_BYTES;
            *bytes += piece.len;
            fits
        });

        let counters = &self.shared.counters;
        counters.cache_hits.add(moved.hits);
        counters.evictions.add(moved.evicted);
        counters.pinned_bytes.set(self.store.pinned_bytes());
        counters.cached_bytes.set(self.store.cached_bytes());
        self.sequence += 1;
        plan.sequence = self.sequence;
        self.shared.clock(|clock| clock.note(&plan));
        let recovered = std::mem::take(&mut self.recovered);
        self.shared.board.post(|news| {
            news.plan = Arc::new(plan);
            for number in recovered {
                news.cloud(number, |status| status.failure = None);
            }
        });
        self.shared.loader.set_demand(Demand { pieces, seen });
    }

    /// Whether what the selection leaves out as hidden is so behind what is drawn now.
    fn hides_rightly(&self) -> bool {
        let is_of = |drawn: &Drawn| drawn.is_of(self.shown.iter().copied());
        self.selection.left_out.hidden.nodes == 0 || self.drawn.as_ref().is_some_and(is_of)
    }

    fn presence(&self, pick: &Pick) -> Presence {
        if self.store.points(pick.id).is_some() {
            Presence::Drawable
        } else if self.clouds[pick.id.cloud].failed
            || self.store.is_lost(PieceId { node: pick.id, part: Part::Group(0) })
        {
            Presence::Lost
        } else {
            Presence::Absent
        }
    }

    /// Wanted pages. They go before all payloads: they are small, and what lies below waits for
    /// them.
    fn missing_pages(&self) -> Vec<Piece> {
        let pages = self.selection.pages.iter();
        pages
            .filter(|(cloud, _)| !self.clouds[*cloud].failed)
            .filter_map(|(cloud, node)| Piece::page(*cloud, node))
            .filter(|piece| !self.store.is_lost(piece.id))
            .collect()
    }

    /// Adds those of `groups` that a node still lacks.
    fn missing_groups(&self, pick: &Pick, groups: GroupMask, pieces: &mut Vec<Piece>) {
        let missing = groups & !self.store.groups(pick.id);
        if missing == 0 || self.clouds[pick.id.cloud].failed {
            return;
        }
        let groups = (0..pick.node.payloads.len()).filter(|&g| missing & group_bit(g) != 0);
        let found = groups.filter_map(|g| Piece::group(pick.id.cloud, &pick.node, g));
        pieces.extend(found.filter(|piece| !self.store.is_lost(piece.id)));
    }
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{LatticeBox, Node, NodeKey, PayloadRef};

    use super::*;
    use crate::{
        camera::Camera,
        engine::{
            event::Content,
            testing::{boot, manifest, node},
        },
        source::Source,
    };

    /// The traversal of that many clouds with a view of the root below. Nothing of their file is ever read.
    fn traversal(clouds: usize) -> (tempfile::NamedTempFile, Arc<Shared>, Traversal) {
        let file = tempfile::NamedTempFile::new().expect("temporary file");
        let source = Source::parse(file.path().to_str().expect("readable path")).expect("a file");
        let config = EngineConfig::default();
        let shared = Arc::new(Shared::new(&config, vec![source; clouds]));
        let traversal = Traversal::new(Arc::clone(&shared), &config);
        let camera = Camera::overview([0.0; 3].into(), [9.0; 3].into(), 1.0);
        shared.traversal.set_view(View { camera, size_px: [100; 2] }, |_| {});
        (file, shared, traversal)
    }

    fn root() -> Node {
        Node { bounds: LatticeBox { min: [0; 3], max: [8; 3] }, ..node(NodeKey::ROOT) }
    }

    #[test]
    fn that_a_cloud_is_back_is_told_with_the_first_plan_that_knows_of_it() {
        let (_file, shared, mut traversal) = traversal(1);
        let failure = || shared.board.read(|news| news.clouds[0].failure.clone());
        let is_settled = || shared.board.read(|news| news.plan.settled);
        let take = || shared.traversal.try_take().expect("there is news");
        let payloads = vec![PayloadRef { offset: 0, bytes: 1, crc: 0 }];
        let root = Node { payloads, ..root() };
        let boot = Arc::new(boot([1; 16], manifest(), vec![root]));
        shared.traversal.post(Event::Opened { cloud: 0, boot: Arc::clone(&boot) });
        traversal.step(take());
        let fails = |cloud| Event::CloudFailed { cloud, message: "not found".into() };
        let is_back = [Event::CloudIsBack { cloud: 0 }, Event::Replaced { cloud: 0, by: 1, boot }];
        for event in is_back {
            shared.traversal.post(fails(0));
            traversal.step(take());
            assert!(failure().is_some() && is_settled(), "nothing more is to come");
            shared.traversal.post(event);
            let mail = take();
            traversal.read(mail);
            assert!(failure().is_some(), "the newest plan is that of the failed cloud");
            traversal.select();
            traversal.publish(0);
            assert!(failure().is_none() && !is_settled(), "the node can come again");
        }
        // Failed again before there was a plan.
        shared.traversal.post(fails(1));
        traversal.step(take());
        shared.traversal.post(Event::CloudIsBack { cloud: 1 });
        shared.traversal.post(fails(1));
        traversal.step(take());
        assert!(failure().is_some() && is_settled());
    }

    #[test]
    fn a_version_that_comes_after_its_cloud_was_removed_is_none_and_the_others_are_replaced() {
        let (_file, shared, mut traversal) = traversal(2);
        let step = |traversal: &mut Traversal| {
            traversal.step(shared.traversal.try_take().expect("there is news"));
            shared.board.read(|news| (Arc::clone(&news.plan), news.clouds.clone()))
        };
        let version = |number| Arc::new(boot([number; 16], manifest(), vec![root()]));
        for cloud in [0, 1] {
            shared.traversal.post(Event::Opened { cloud, boot: version(1) });
        }
        step(&mut traversal);
        assert_eq!(traversal.wanted().count(), 2);

        shared.remove(0);
        step(&mut traversal);
        // The loader did not know yet.
        for (cloud, by) in [(0, 2), (1, 3)] {
            shared.traversal.post(Event::Replaced { cloud, by, boot: version(2) });
            let node = NodeId { cloud: by, key: NodeKey::ROOT };
            let content = Content::Counted(1);
            shared.traversal.post(Event::Group { node, group: 0, content });
        }
        let (plan, clouds) = step(&mut traversal);
        assert!(clouds[0].removed && clouds[0].boot.is_none(), "{clouds:?}");
        assert_eq!((clouds[0].replaced, clouds[1].replaced), (0, 1));
        assert!(Arc::ptr_eq(
            clouds[1].boot.as_ref().expect("open"),
            traversal.trees[3].as_ref().expect("open").boot()
        ));
        let wanted: Vec<_> = traversal.wanted().map(|node| (node.cloud, node.is_there)).collect();
        assert_eq!(wanted, [(1, true)]);
        assert!(plan.settled && plan.nodes.iter().all(|node| node.cloud == 1), "{plan:?}");
    }
}
