//! The hierarchy: the tree's nodes, in pages that are loaded on demand.
//!
//! A page lists a subtree breadth-first. Keys are not stored: they follow from the child masks.
//! Payload offsets are not stored either: within a page, the payloads of a group lie in node order,
//! so an offset is the page's group offset plus the lengths before it. Group offsets count from the
//! end of the index ([`Header::index_bytes`](crate::Header::index_bytes)), so that a page's bytes do
//! not depend on its own length.

use crate::{
    error::{Error, Result, corrupt},
    key::NodeKey,
    lattice::{Lattice, LatticeBox},
    manifest::Manifest,
    normal_cone::NormalCone,
    wire::{WirePage, WirePageRef},
};

/// Most elements in one node: what a reader must be ready to allocate for.
pub const MAX_NODE_POINTS: u32 = 1 << 24;

/// log2 of the slices that a node's side is cut into to tell its bounds.
pub(crate) const BOUNDS_BITS: u8 = 8;

/// Where a node's payload of one group is, and its CRC-32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PayloadRef {
    /// File offset in bytes.
    pub offset: u64,
    /// Length in bytes; zero for a node without elements.
    pub bytes: u32,
    /// CRC-32 (IEEE) of the bytes.
    pub crc: u32,
}

/// Where a page is, and its CRC-32.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageRef {
    /// File offset in bytes.
    pub offset: u64,
    /// Length in bytes.
    pub bytes: u32,
    /// Nodes in the page.
    pub nodes: u32,
    /// CRC-32 (IEEE) of the bytes.
    pub crc: u32,
}

/// One node of the tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Its cube.
    pub key: NodeKey,
    /// Bit `i` is set where the child in octant `i` exists.
    pub child_mask: u8,
    /// Elements in this node alone.
    pub points: u32,
    /// Holds the elements of this node and of all below it, and in additive datasets those of the nodes
    /// above that lie in its cube; within 1/256 of the node's side tight.
    pub bounds: LatticeBox,
    /// How far, in world units, the picture is off where the tree is cut at this node: 0 for leaves.
    pub geometric_error: f32,
    /// Distance between neighbouring elements in world units, for splat sizes: the guaranteed
    /// minimum in a sampled node, an estimate of the mean in a leaf.
    pub spacing: f32,
    /// Holds the normals of this node and of all below it, where the dataset stores normals.
    pub normal_cone: Option<NormalCone>,
    /// One per column group.
    pub payloads: Vec<PayloadRef>,
    /// Set where the children are described in another page.
    pub child_page: Option<PageRef>,
}

impl Node {
    /// Whether there is nothing below this node.
    #[must_use]
    pub const fn is_leaf(&self) -> bool {
        self.child_mask == 0
    }

    /// Keys of the children, in octant order.
    pub fn children(&self) -> impl Iterator<Item = NodeKey> + use<> {
        let (key, mask) = (self.key, self.child_mask);
        (0..8).filter(move |o| mask >> o & 1 == 1).filter_map(move |o| key.child(o))
    }
}

/// A page of the hierarchy.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HierarchyPage {
    /// Nodes breadth-first: by level, within a level in Morton order.
    pub nodes: Vec<Node>,
}

impl HierarchyPage {
    /// Parses the root page, whose first node is the root (if there is any point at all).
    /// `index_bytes` is where payloads start.
    pub(crate) fn parse_root(bytes: &[u8], manifest: &Manifest, index_bytes: u64) -> Result<Self> {
        let wire = WirePage::decode(bytes)?;
        let seeds = if wire.child_masks.is_empty() { vec![] } else { vec![NodeKey::ROOT] };
        Self::build(&wire, seeds, manifest, index_bytes)
    }

    /// Parses the page that describes the children of `parent`.
    pub(crate) fn parse_children(
        bytes: &[u8],
        parent: &Node,
        manifest: &Manifest,
        index_bytes: u64,
    ) -> Result<Self> {
        let page = parent
            .child_page
            .ok_or_else(|| corrupt("hierarchy page", "the node has no child page"))?;
        let found = crc32fast::hash(bytes);
        if found != page.crc {
            return Err(Error::Checksum {
                what: format!("hierarchy page of node {}", parent.key),
                expected: page.crc,
                found,
            });
        }
        Self::build(&WirePage::decode(bytes)?, parent.children().collect(), manifest, index_bytes)
    }

    fn build(
        wire: &WirePage,
        seeds: Vec<NodeKey>,
        manifest: &Manifest,
        index_bytes: u64,
    ) -> Result<Self> {
        let bad = |why: String| corrupt("hierarchy page", why);
        let count = wire.child_masks.len();
        let groups = manifest.groups.len();
        let lengths_match = wire.group_offsets.len() == groups
            && [wire.points.len(), wire.bounds.len(), wire.spacings.len()] == [count; 3]
            && wire.geometric_errors.len() == count
            && (wire.normal_cones.is_empty() || wire.normal_cones.len() == count)
            && wire.payload_bytes.len() == count * groups
            && wire.payload_crcs.len() == count * groups;
        if !lengths_match {
            return Err(bad(format!("array lengths do not fit {count} nodes, {groups} groups")));
        }
        let mut keys = seeds;
        keys.reserve(count.saturating_sub(keys.len()));
        let mut nodes = Vec::with_capacity(count);
        let absolute = |offset: u64| {
            index_bytes.checked_add(offset).ok_or_else(|| bad("an offset overflows".into()))
        };
        let mut offsets =
            wire.group_offsets.iter().map(|&o| absolute(o)).collect::<Result<Vec<_>>>()?;
        let mut child_pages = wire.child_pages.iter().peekable();
        for index in 0..count {
            let key = *keys
                .get(index)
                .ok_or_else(|| bad("more nodes than the child masks describe".into()))?;
            if key.level() >= manifest.levels || wire.points[index] > MAX_NODE_POINTS {
                return Err(bad(format!("node {key}: level or element count out of range")));
            }
            let child_page = child_pages
                .next_if(|page| page.node as usize == index)
                .map(|page| {
                    Ok(PageRef {
                        offset: absolute(page.offset)?,
                        bytes: page.bytes,
                        nodes: page.nodes,
                        crc: u32::from_le_bytes(page.crc),
                    })
                })
                .transpose()?;
            let payloads = (0..groups)
                .map(|group| {
                    let bytes = wire.payload_bytes[index * groups + group];
                    let crc = u32::from_le_bytes(wire.payload_crcs[index * groups + group]);
                    let offset = offsets[group];
                    offsets[group] = offset
                        .checked_add(u64::from(bytes))
                        .ok_or_else(|| bad("payload offset overflows".into()))?;
                    Ok(PayloadRef { offset, bytes, crc })
                })
                .collect::<Result<_>>()?;
            let node = Node {
                key,
                child_mask: wire.child_masks[index],
                points: wire.points[index],
                bounds: expand_bounds(wire.bounds[index], key, &manifest.lattice),
                geometric_error: wire.geometric_errors[index],
                spacing: wire.spacings[index],
                normal_cone: wire
                    .normal_cones
                    .get(index)
                    .map(|&bytes| NormalCone::from_bytes(bytes)),
                payloads,
                child_page,
            };
            if !(node.geometric_error >= 0.0 && node.spacing >= 0.0) {
                return Err(bad(format!("node {key}: negative or NaN error or spacing")));
            }
            if node.child_page.is_none() {
                keys.extend(node.children());
            } else if node.is_leaf() {
                return Err(bad(format!("node {key}: a leaf has a child page")));
            }
            nodes.push(node);
        }
        if keys.len() != count || child_pages.next().is_some() {
            return Err(bad(format!("{} nodes described, {count} given", keys.len())));
        }
        Ok(Self { nodes })
    }

    /// Encodes nodes as one page.
    ///
    /// `nodes` are in breadth-first order, children present exactly for nodes without
    /// [`Node::child_page`]; their payloads must lie back to back per group, starting at
    /// `group_offsets`. Here all offsets count from the end of the index.
    ///
    /// # Errors
    /// [`Error::Corrupt`] where the page would be too large.
    pub fn encode(nodes: &[Node], group_offsets: Vec<u64>, lattice: &Lattice) -> Result<Vec<u8>> {
        let mut wire = WirePage { group_offsets, ..WirePage::default() };
        for (index, node) in nodes.iter().enumerate() {
            wire.child_masks.push(node.child_mask);
            wire.points.push(node.points);
            wire.bounds.push(quantize_bounds(node.bounds, node.key, lattice));
            wire.geometric_errors.push(node.geometric_error);
            wire.spacings.push(node.spacing);
            wire.normal_cones.extend(node.normal_cone.map(NormalCone::to_bytes));
            for payload in &node.payloads {
                wire.payload_bytes.push(payload.bytes);
                wire.payload_crcs.push(payload.crc.to_le_bytes());
            }
            if let Some(page) = node.child_page {
                wire.child_pages.push(WirePageRef {
                    node: u32::try_from(index)
                        .map_err(|_| corrupt("hierarchy page", "too many nodes"))?,
                    offset: page.offset,
                    bytes: page.bytes,
                    nodes: page.nodes,
                    crc: page.crc.to_le_bytes(),
                });
            }
        }
        wire.encode()
    }
}

/// Bounds as six bytes: per axis the index of the 1/256 slice of the node's side that holds the
/// lowest coordinate, then, likewise, the highest.
#[must_use]
pub fn quantize_bounds(bounds: LatticeBox, key: NodeKey, lattice: &Lattice) -> [u8; 6] {
    let bits = u32::from(lattice.node_bits(key.level()));
    let corner = lattice.node_min(key);
    let slice = |q: u32, a: usize| {
        let inside = u64::from(q.saturating_sub(corner[a]));
        u8::try_from((inside << 8) >> bits).unwrap_or(u8::MAX)
    };
    std::array::from_fn(|i| {
        if i < 3 { slice(bounds.min[i], i) } else { slice(bounds.max[i - 3], i - 3) }
    })
}

fn expand_bounds(slices: [u8; 6], key: NodeKey, lattice: &Lattice) -> LatticeBox {
    let bits = u32::from(lattice.node_bits(key.level()));
    let corner = lattice.node_min(key);
    // Node side at most 2^32 and slices at most 2^8: 40 bits. The sums stay inside the root cube.
    let low = |i: usize| ((u64::from(slices[i]) << bits) >> 8) as u32;
    let high = |i: usize| ((((u64::from(slices[i]) + 1) << bits) + 255) >> 8) as u32;
    LatticeBox {
        min: std::array::from_fn(|a| corner[a].wrapping_add(low(a))),
        max: std::array::from_fn(|a| corner[a].wrapping_add(high(a + 3)).wrapping_sub(1)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn expanded_bounds_hold_and_are_tight(
            side_bits in 0u8..=32, level_seed in any::<u8>(), coords in any::<[u32; 3]>(),
            a in any::<[u32; 3]>(), b in any::<[u32; 3]>(),
        ) {
            let level = level_seed % (side_bits + 1);
            let lattice = Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits };
            let mask = ((1u64 << level) - 1) as u32;
            let key = NodeKey::new(level, coords.map(|c| c & mask)).expect("masked");
            let bits = lattice.node_bits(level);
            let inside = ((1u64 << bits) - 1) as u32;
            let corner = lattice.node_min(key);
            let mut bounds = LatticeBox::EMPTY;
            bounds.grow(std::array::from_fn(|i| corner[i] + (a[i] & inside)));
            bounds.grow(std::array::from_fn(|i| corner[i] + (b[i] & inside)));
            let back = expand_bounds(quantize_bounds(bounds, key, &lattice), key, &lattice);
            prop_assert!(back.contains(bounds.min) && back.contains(bounds.max));
            for i in 0..3 {
                let slack = ((1u64 << bits) / 256) as u32;
                prop_assert!(bounds.min[i] - back.min[i] <= slack);
                prop_assert!(back.max[i] - bounds.max[i] <= slack);
            }
        }
    }
}
