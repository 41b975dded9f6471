//! The octree over points sorted by Morton code, level by level.

use lodestream_protocol::{MortonCode, NodeKey};

/// A node over a range of the sorted points.
#[derive(Debug, Clone)]
pub struct TreeNode {
    /// Its cube.
    pub key: NodeKey,
    /// Sorted points inside its cube: `start .. end`.
    pub start: u32,
    /// See [`start`](Self::start).
    pub end: u32,
    /// Children in the next level's list: `first_child .. first_child + children`.
    pub first_child: u32,
    /// Number of children; none for a leaf of this tree.
    pub children: u8,
    /// Which octants the children are in.
    pub child_mask: u8,
}

impl TreeNode {
    /// Whether nothing lies below in this tree.
    pub const fn is_leaf(&self) -> bool {
        self.children == 0
    }

    /// The children's places in the next level's list.
    pub const fn child_range(&self) -> std::ops::Range<usize> {
        self.first_child as usize..self.first_child as usize + self.children as usize
    }

    /// The sorted points inside the cube.
    pub const fn range(&self) -> std::ops::Range<usize> {
        self.start as usize..self.end as usize
    }
}

/// An octree, level by level from its root's; each level's nodes are in Morton order.
#[derive(Debug, Clone)]
pub struct Tree {
    /// Level of the root node in the dataset's tree.
    pub root_level: u8,
    /// `levels[i]` are the nodes of level `root_level + i`.
    pub levels: Vec<Vec<TreeNode>>,
}

impl Tree {
    /// Splits every node of more than `leaf_capacity` points, down from `root`, whose side is
    /// `root_bits` bits. `codes` are ascending and relative to the root. Points that coincide
    /// cannot be split, and stay together however many they are.
    pub fn split<C: MortonCode>(
        root: NodeKey,
        root_bits: u8,
        codes: &[C],
        leaf_capacity: u32,
    ) -> Self {
        let root_node = TreeNode {
            key: root,
            start: 0,
            end: codes.len() as u32,
            first_child: 0,
            children: 0,
            child_mask: 0,
        };
        let mut levels = vec![vec![root_node]];
        for depth in 0..root_bits {
            let child_bits = root_bits - depth - 1;
            let mut next = Vec::new();
            let parents = levels.last_mut().expect("starts with the root's level");
            for node in parents {
                let coincident = || codes[node.start as usize] == codes[node.end as usize - 1];
                if node.end - node.start <= leaf_capacity || coincident() {
                    continue;
                }
                node.first_child = next.len() as u32;
                let mut start = node.start as usize;
                while start < node.end as usize {
                    let cube = codes[start].up(child_bits);
                    let inside = &codes[start..node.end as usize];
                    let len = inside.partition_point(|c| c.up(child_bits) == cube);
                    let octant = (cube.low_u64(0) & 7) as u8;
                    next.push(TreeNode {
                        key: node.key.child(octant).expect("root_bits bounds the depth"),
                        start: start as u32,
                        end: (start + len) as u32,
                        first_child: 0,
                        children: 0,
                        child_mask: 0,
                    });
                    node.children += 1;
                    node.child_mask |= 1 << octant;
                    start += len;
                }
            }
            if next.is_empty() {
                break;
            }
            levels.push(next);
        }
        Self { root_level: root.level(), levels }
    }

    /// The tree of all ancestors of `leaves`, which are disjoint cubes in Morton order, each with
    /// its range of sorted points. The root is the dataset's.
    pub fn above(leaves: &[(NodeKey, std::ops::Range<u32>)]) -> Self {
        let deepest = leaves.iter().map(|(key, _)| key.level()).max().unwrap_or(0);
        let mut levels: Vec<Vec<TreeNode>> = vec![Vec::new(); usize::from(deepest) + 1];
        // Morton order of disjoint cubes: descendants of one node are neighbours, so a node is new
        // exactly where it differs from the last one of its level.
        for (key, range) in leaves {
            for level in 0..=key.level() {
                let ancestor = key.ancestor(level).expect("level is not below the key's");
                let nodes = &mut levels[usize::from(level)];
                match nodes.last_mut() {
                    Some(last) if last.key == ancestor => last.end = range.end,
                    _ => nodes.push(TreeNode {
                        key: ancestor,
                        start: range.start,
                        end: range.end,
                        first_child: 0,
                        children: 0,
                        child_mask: 0,
                    }),
                }
            }
        }
        for level in 1..levels.len() {
            let (upper, lower) = levels.split_at_mut(level);
            let parents = &mut upper[level - 1];
            let mut parent = 0;
            for (index, child) in lower[0].iter().enumerate() {
                let key = child.key.parent().expect("below the root");
                while parents[parent].key != key {
                    parent += 1;
                }
                let node = &mut parents[parent];
                if node.children == 0 {
                    node.first_child = index as u32;
                }
                node.children += 1;
                node.child_mask |= 1 << child.key.octant();
            }
        }
        Self { root_level: 0, levels }
    }
}
