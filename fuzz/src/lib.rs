//! How the bytes that the fuzzer mutates become the bytes that a decoder is given.
//!
//! Checksums would stop nearly every mutation at the door, so an input holds only what lies behind
//! them and is sealed anew here. `seeds` (an example of this crate) writes the first inputs.

mod columns;
mod links;
mod pages;

pub use columns::{ColumnsInput, in_parts};
pub use links::LinkInput;
pub use pages::{BootInput, HierarchyInput};

use lodestream_protocol::{
    Attribute, GroupInfo, Lattice, LatticeBox, Manifest, Method, Node, NodeKey, Primitive,
    Refinement,
};

/// A manifest with the given parts and nothing remarkable about the rest.
#[must_use]
pub fn manifest(side_bits: u8, levels: u8, groups: usize, attributes: Vec<Attribute>) -> Manifest {
    Manifest {
        generator: "fuzz".into(),
        points: 1,
        nodes: 1,
        levels,
        refinement: Refinement::Additive,
        primitive: Primitive::Point,
        method: Method { name: "poisson".into(), grid: 128, leaf_capacity: 1 },
        lattice: Lattice { scale: 0.01, offset: [0.0; 3], origin: [0; 3], side_bits },
        bounds: LatticeBox { min: [0; 3], max: [0; 3] },
        largest_rounding: 0.0,
        groups: (0..groups)
            .map(|group| {
                let own = attributes.iter().filter(|a| a.group() == Some(group)).count();
                let columns = vec![0; usize::from(group == 0) + own];
                GroupInfo { name: group.to_string(), columns }
            })
            .collect(),
        attributes,
        fine: None,
        crs: None,
        sources: Vec::new(),
    }
}

/// A leaf with the given key and elements and nothing remarkable about the rest.
#[must_use]
pub fn leaf(key: NodeKey, points: u32) -> Node {
    Node {
        key,
        child_mask: 0,
        points,
        bounds: LatticeBox { min: [0; 3], max: [0; 3] },
        geometric_error: 0.0,
        spacing: 0.0,
        normal_cone: None,
        payloads: Vec::new(),
        child_page: None,
    }
}

/// Cuts `data` behind the length that its first two bytes (little-endian) state, at its end at most.
fn split_counted(data: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = data.split_first_chunk::<2>()?;
    Some(rest.split_at(usize::from(u16::from_le_bytes(*length)).min(rest.len())))
}

/// Undoes [`split_counted`]; `None` where the first part is too long for it.
fn join_counted(first: &[u8], second: &[u8]) -> Option<Vec<u8>> {
    let length = u16::try_from(first.len()).ok()?;
    Some([&length.to_le_bytes(), first, second].concat())
}
