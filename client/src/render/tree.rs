//! The visible tree: which nodes are drawn, for sizes that adapt to the detail that is there.
//!
//! Radner 2018, 5.2.3 and algorithm 5, with two differences. An entry holds the spacing of its node
//! instead of leaving it to be derived from the depth (eq. 5.2): so sizes are right for leaves too,
//! whose points lie as the scan left them. And the walk begins at the point's own node,
//! not at the root: it never has to step down where the point was drawn from.

use std::collections::HashMap;

use lodestream_protocol::NodeKey;

/// The drawn nodes of all clouds, each with its drawn children.
#[derive(Debug, Clone, Default)]
pub struct VisibleTree {
    nodes: Vec<TreeNode>,
    places: HashMap<(usize, NodeKey), u32>,
}

/// A drawn node. WGSL twin: `shaders/size_adaptive.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TreeNode {
    /// A bit per octant: whether the child is drawn.
    pub children: u8,
    /// Where the first of them is; the others follow in the order of their octants.
    pub first_child: u32,
    /// Distance between neighbouring points of the node, world units.
    pub spacing: f32,
}

impl VisibleTree {
    /// The tree of the given nodes: cloud, key, spacing in world units.
    #[must_use]
    pub fn of(drawn: impl Iterator<Item = (usize, NodeKey, f32)>) -> Self {
        let mut drawn: Vec<_> = drawn.collect();
        // Siblings must lie together: by parent, then by octant.
        drawn.sort_unstable_by_key(|(cloud, key, _)| {
            (*cloud, key.level(), key.parent(), key.octant())
        });
        drawn.dedup_by_key(|(cloud, key, _)| (*cloud, *key));
        let mut nodes: Vec<_> = drawn
            .iter()
            .map(|&(_, _, spacing)| TreeNode { children: 0, first_child: 0, spacing })
            .collect();
        // A frame has far fewer than 2^32 nodes: each is in memory.
        let places: HashMap<_, _> =
            drawn.iter().zip(0u32..).map(|(&(cloud, key, _), i)| ((cloud, key), i)).collect();
        for (&(cloud, key, _), i) in drawn.iter().zip(0u32..) {
            let parent = key.parent().and_then(|parent| places.get(&(cloud, parent)));
            if let Some(parent) = parent.and_then(|&parent| nodes.get_mut(parent as usize)) {
                if parent.children == 0 {
                    parent.first_child = i;
                }
                parent.children |= 1 << key.octant();
            }
        }
        Self { nodes, places }
    }

    /// All nodes, children of a node one after the other.
    pub(crate) fn nodes(&self) -> &[TreeNode] {
        &self.nodes
    }

    /// Where a node is.
    pub(crate) fn place(&self, cloud: usize, key: NodeKey) -> Option<u32> {
        self.places.get(&(cloud, key)).copied()
    }

    /// Spacing of the deepest drawn node that holds lattice point `q` of the node at `place`, whose
    /// side is `bits` bits. (Radner 2018, algorithm 5)
    pub(crate) fn spacing(&self, place: u32, bits: u8, q: [u32; 3]) -> f32 {
        let Some(mut node) = self.nodes.get(place as usize).copied() else { return 0.0 };
        for bit in (0..u32::from(bits)).rev() {
            let octant = (q[0] >> bit & 1) | (q[1] >> bit & 1) << 1 | (q[2] >> bit & 1) << 2;
            if node.children >> octant & 1 == 0 {
                break;
            }
            let before = (u32::from(node.children) & ((1 << octant) - 1)).count_ones();
            match self.nodes.get((node.first_child + before) as usize) {
                Some(child) => node = *child,
                None => break,
            }
        }
        node.spacing
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn key(path: &[u8]) -> NodeKey {
        path.iter().fold(NodeKey::ROOT, |key, octant| key.child(*octant).expect("shallow"))
    }

    proptest! {
        /// Any uneven tree: the walk finds what a search through all nodes finds.
        #[test]
        fn the_walk_finds_the_deepest_node_that_holds_a_point(
            paths in prop::collection::vec(prop::collection::vec(0u8..8, 0..5), 1..40),
            q in any::<[u16; 3]>(),
        ) {
            let mut keys: Vec<NodeKey> = paths
                .iter()
                .flat_map(|path| (0..=path.len()).map(|depth| key(&path[..depth])))
                .collect();
            keys.sort();
            keys.dedup();
            // Every node has a spacing of its own, in no order.
            let spacing = |i: usize| (i * 37 % 101) as f32;
            let tree = VisibleTree::of(keys.iter().enumerate().map(|(i, k)| (3, *k, spacing(i))));
            let q = q.map(u32::from);
            let holds = |k: &NodeKey| k.coords() == q.map(|c| c.checked_shr(16 - u32::from(k.level())).unwrap_or(0));
            let (deepest, _) = keys.iter().enumerate().filter(|(_, k)| holds(k)).max_by_key(|(_, k)| k.level()).expect("the root");
            for own in keys.iter().filter(|k| holds(k)) {
                let bits = 16 - own.level();
                let within = q.map(|c| c & ((1u32 << bits) - 1));
                let place = tree.place(3, *own).expect("in the tree");
                prop_assert_eq!(tree.spacing(place, bits, within), spacing(deepest));
            }
            prop_assert_eq!(tree.place(0, NodeKey::ROOT), None);
        }
    }

    #[test]
    fn a_node_that_is_not_drawn_ends_the_walk() {
        // A grandchild is drawn, its parent is not.
        let drawn = [(0, key(&[]), 4.0), (0, key(&[7, 7]), 1.0)];
        let tree = VisibleTree::of(drawn.into_iter());
        let root = tree.place(0, NodeKey::ROOT).expect("drawn");
        assert_eq!(tree.spacing(root, 4, [15; 3]), 4.0);
    }
}
