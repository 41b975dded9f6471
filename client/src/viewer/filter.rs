//! Which points of the plan's nodes are shown: those in the clip box and of the classes that are wanted.
//!
//! The engine leaves out nodes that lie beside the clip box as a whole. Of those that reach in, and of
//! nodes with unwanted classes, copies of the points that stay are made here, once, and kept as long
//! as the node is in the plan. So every renderer and every splat takes them, picking sees what is seen,
//! and shaders know nothing of it. A copy has a number ([`DrawNode::part`]) by which renderers tell it
//! from the whole node.

use std::{
    collections::{BTreeSet, HashMap},
    sync::Arc,
};

use lodestream_protocol::{Column, Domain, Manifest, NodeKey, NodePoints};

use crate::engine::{ClipBox, DrawNode, FramePlan};

/// What is shown of clouds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// Points outside are left out.
    pub clip: Option<ClipBox>,
    /// Per cloud, classes that are left out.
    pub hidden_classes: Vec<BTreeSet<u8>>,
}

/// Nodes as they are shown.
#[derive(Debug, Clone, Default)]
pub struct Shown {
    /// The nodes, without those of which nothing is shown.
    pub nodes: Vec<DrawNode>,
    /// For each node, which of its points are shown, where it is not all of them.
    pub kept: Vec<Option<Arc<[u32]>>>,
    /// Points in the nodes.
    pub points: u64,
    /// Points of the plan that are left out.
    pub left_out: u64,
}

impl Shown {
    /// Which of all points of the node a shown one is.
    #[must_use]
    pub fn original(&self, node: usize, point: usize) -> usize {
        let kept = self.kept.get(node).and_then(Option::as_ref);
        kept.and_then(|kept| kept.get(point)).map_or(point, |original| *original as usize)
    }
}

/// What is kept of a node.
#[derive(Debug, Clone)]
enum Kept {
    All,
    Nothing,
    Some { points: Arc<NodePoints>, kept: Arc<[u32]> },
}

/// A node's answer, and the very points it was made of.
struct Answer {
    of: Arc<NodePoints>,
    kept: Kept,
}

/// Filters plans; remembers answers.
#[derive(Default)]
pub struct Filter {
    wanted: Wanted,
    /// Counts changes of `wanted`: the part number of what is kept.
    part: u64,
    answers: HashMap<(usize, NodeKey), Answer>,
}

impl Filter {
    /// Sets what is wanted; returns whether that is a change.
    pub fn want(&mut self, wanted: Wanted) -> bool {
        if wanted == self.wanted {
            return false;
        }
        self.wanted = wanted;
        self.part += 1;
        self.answers.clear();
        true
    }

    /// What is shown of a plan.
    pub fn apply(&mut self, plan: &FramePlan) -> Shown {
        let mut shown = Shown::default();
        let mut answers = HashMap::new();
        for node in &plan.nodes {
            let Some(cloud) = plan.clouds.get(node.cloud) else { continue };
            let kept = if self.concerns(node, cloud) {
                let id = (node.cloud, node.key);
                // The points of a node are others once a further column has come.
                let known = self.answers.remove(&id);
                let known = known.filter(|answer| Arc::ptr_eq(&answer.of, &node.points));
                let answer = known.unwrap_or_else(|| Answer {
                    of: Arc::clone(&node.points),
                    kept: self.keep(node, cloud),
                });
                let kept = answer.kept.clone();
                answers.insert(id, answer);
                kept
            } else {
                Kept::All
            };
            let all = node.points.positions.len() as u64;
            match kept {
                Kept::All => {
                    shown.points += all;
                    shown.nodes.push(node.clone());
                    shown.kept.push(None);
                }
                Kept::Nothing => shown.left_out += all,
                Kept::Some { points, kept } => {
                    let left = points.positions.len() as u64;
                    shown.points += left;
                    shown.left_out += all - left;
                    shown.nodes.push(DrawNode { points, part: self.part, ..node.clone() });
                    shown.kept.push(Some(kept));
                }
            }
        }
        self.answers = answers;
        shown
    }

    fn hidden(&self, cloud: usize) -> Option<&BTreeSet<u8>> {
        self.wanted.hidden_classes.get(cloud).filter(|hidden| !hidden.is_empty())
    }

    /// Whether anything of the node may have to be left out.
    fn concerns(&self, node: &DrawNode, cloud: &Manifest) -> bool {
        if self.hidden(node.cloud).is_some() {
            return true;
        }
        let Some(clip) = &self.wanted.clip else { return false };
        let lattice = &cloud.lattice;
        let low = lattice.node_min(node.key);
        let side = (1u64 << lattice.node_bits(node.key.level())) - 1;
        // At most the root cube's highest coordinate.
        let high = low.map(|c| (u64::from(c) + side).min(u64::from(u32::MAX)) as u32);
        !(clip.contains(lattice.world(low).into()) && clip.contains(lattice.world(high).into()))
    }

    fn keep(&self, node: &DrawNode, cloud: &Manifest) -> Kept {
        let points = node.points.as_ref();
        let hidden = self.hidden(node.cloud).and_then(|hidden| Classes::of(cloud, points, hidden));
        let corner = cloud.lattice.node_min(node.key);
        let is_kept = |index: usize, q: &[u32; 3]| {
            let inside = self.wanted.clip.is_none_or(|clip| {
                let q = std::array::from_fn(|axis| corner[axis].saturating_add(q[axis]));
                clip.contains(cloud.lattice.world(q).into())
            });
            inside && hidden.as_ref().is_none_or(|classes| classes.is_shown(index))
        };
        // A node has at most u32::MAX points: its count is stored as one.
        let kept: Vec<u32> = points
            .positions
            .iter()
            .enumerate()
            .filter(|(index, q)| is_kept(*index, q))
            .map(|(index, _)| index as u32)
            .collect();
        if kept.len() == points.positions.len() {
            Kept::All
        } else if kept.is_empty() {
            Kept::Nothing
        } else {
            let points = Arc::new(part_of(points, cloud, &kept));
            Kept::Some { points, kept: kept.into() }
        }
    }
}

/// The classes of a node's points.
struct Classes<'a> {
    attribute: &'a lodestream_protocol::Attribute,
    /// Empty where all points are of one class.
    bytes: &'a [u8],
    constant: Option<Vec<u8>>,
    hidden: &'a BTreeSet<u8>,
}

impl<'a> Classes<'a> {
    /// `None` where the cloud has none, or where they have not arrived yet.
    fn of(cloud: &'a Manifest, points: &'a NodePoints, hidden: &'a BTreeSet<u8>) -> Option<Self> {
        let index = cloud.attributes.iter().position(|a| a.name == "classification")?;
        let attribute = &cloud.attributes[index];
        let constant = attribute.constant();
        let bytes = match constant {
            Some(_) => &[][..],
            None => points.column(index)?.bytes.as_slice(),
        };
        Some(Self { attribute, bytes, constant, hidden })
    }

    fn is_shown(&self, index: usize) -> bool {
        let size = self.attribute.value_bytes();
        let value = match &self.constant {
            Some(value) => Some(value.as_slice()),
            None => self.bytes.get(index * size..(index + 1) * size),
        };
        // The cast saturates: beyond 255 there are no classes.
        let class = value.map(|value| self.attribute.scalar.to_f64(value) as u8);
        class.is_none_or(|class| !self.hidden.contains(&class))
    }
}

/// Copies the points of which the numbers are given.
fn part_of(points: &NodePoints, cloud: &Manifest, kept: &[u32]) -> NodePoints {
    let columns = points.columns.iter().filter_map(|column| {
        let attribute = cloud.attributes.get(column.attribute)?;
        if attribute.domain != Domain::Element {
            return None;
        }
        let size = attribute.value_bytes();
        let mut bytes = Vec::with_capacity(size * kept.len());
        for index in kept {
            let start = *index as usize * size;
            bytes.extend_from_slice(column.bytes.get(start..start + size)?);
        }
        Some(Column { attribute: column.attribute, bytes })
    });
    NodePoints {
        key: points.key,
        cell_bits: points.cell_bits,
        has_coarse_colors: points.has_coarse_colors,
        positions: kept.iter().map(|index| points.positions[*index as usize]).collect(),
        columns: columns.collect(),
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::render::testing;

    /// A cloud of one node: points in a cube of 256 steps, and a byte of colour for each.
    fn plan(points: &[[u32; 3]]) -> FramePlan {
        let world = testing::small_cube(points);
        FramePlan {
            clouds: world.clouds.clone().into(),
            nodes: world.nodes.clone(),
            ..FramePlan::default()
        }
    }

    proptest! {
        #[test]
        fn exactly_the_points_in_the_box_are_shown_with_their_values(
            points in prop::collection::vec(prop::array::uniform3(0u32..256), 1..200),
            low in prop::array::uniform3(0.0..200.0), size in prop::array::uniform3(0.0..120.0),
        ) {
            let plan = plan(&points);
            let cloud = &plan.clouds[0];
            let at = |q: [f64; 3]| DVec3::from(cloud.lattice.world_f64(q));
            let min = at(low);
            let high: [f64; 3] = std::array::from_fn(|a| low[a] + size[a]);
            let clip = ClipBox { min, max: at(high) };
            let mut filter = Filter::default();
            filter.want(Wanted { clip: Some(clip), hidden_classes: vec![] });
            let shown = filter.apply(&plan);
            let all = &plan.nodes[0].points;
            let expected: Vec<usize> = (0..all.positions.len())
                .filter(|i| clip.contains(cloud.lattice.world(all.positions[*i]).into()))
                .collect();
            let found: Vec<usize> = shown.nodes.iter().enumerate().flat_map(|(n, node)| {
                (0..node.points.positions.len()).map(move |i| (n, i))
            }).map(|(n, i)| shown.original(n, i)).collect();
            prop_assert_eq!(&found, &expected);
            prop_assert_eq!(shown.points + shown.left_out, all.positions.len() as u64);
            if let Some(node) = shown.nodes.first() {
                for (column, whole) in node.points.columns.iter().zip(&all.columns) {
                    let size = cloud.attributes[column.attribute].value_bytes();
                    for (i, original) in expected.iter().enumerate() {
                        prop_assert_eq!(
                            &column.bytes[i * size..][..size], &whole.bytes[original * size..][..size]
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn without_wishes_nothing_is_copied() {
        let plan = plan(&[[1, 2, 3], [200, 100, 50]]);
        let shown = Filter::default().apply(&plan);
        assert!(Arc::ptr_eq(&shown.nodes[0].points, &plan.nodes[0].points));
        assert_eq!((shown.nodes[0].part, shown.points, shown.left_out), (0, 2, 0));
    }

    #[test]
    fn a_part_is_made_once_and_has_another_number_after_every_change() {
        let plan = plan(&[[1, 2, 3], [200, 100, 50]]);
        let lattice = &plan.clouds[0].lattice;
        let clip = |high: f64| {
            let min = DVec3::from(lattice.world_f64([-0.5; 3]));
            Some(ClipBox { min, max: lattice.world_f64([high; 3]).into() })
        };
        let mut filter = Filter::default();
        assert!(filter.want(Wanted { clip: clip(100.0), hidden_classes: vec![] }));
        let (first, second) = (filter.apply(&plan), filter.apply(&plan));
        assert!(Arc::ptr_eq(&first.nodes[0].points, &second.nodes[0].points));
        assert!(!filter.want(Wanted { clip: clip(100.0), hidden_classes: vec![] }));
        assert!(filter.want(Wanted { clip: clip(101.0), hidden_classes: vec![] }));
        assert_ne!(filter.apply(&plan).nodes[0].part, first.nodes[0].part);
    }
}
