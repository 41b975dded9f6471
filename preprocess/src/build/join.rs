//! The top of the tree: what stands for each chunk is sampled once more, upward to the root.

use std::{collections::HashMap, sync::Arc};

use lodestream_protocol::{LatticeBox, MortonCode, NodeKey};
use rayon::prelude::*;

use crate::{
    chunk::{self, Context, Detail},
    cones::Normals,
    encode::{NodeEncoder, OutNode, Ranges},
    error::Result,
    lod::poisson::{self, Domain, Skin},
    tree::Tree,
};

/// The chunks' roots and all nodes above them.
pub(super) struct Joined {
    pub(super) nodes: Vec<OutNode>,
    /// The encoded payloads, per group.
    pub(super) buffers: Vec<Vec<u8>>,
    pub(super) ranges: Ranges,
}

/// Builds the tree above the chunks from what stands for each, and completes the chunks' roots.
///
/// # Errors
/// Where too many points coincide.
pub(super) fn join(
    context: &Context,
    roots: Vec<chunk::Root>,
    skins: &[Arc<Skin>],
    part: u32,
) -> Result<Joined> {
    if context.manifest.lattice.side_bits <= <u64 as MortonCode>::AXIS_BITS {
        join_with::<u64>(context, roots, skins, part)
    } else {
        join_with::<u128>(context, roots, skins, part)
    }
}

fn join_with<C: MortonCode>(
    context: &Context,
    roots: Vec<chunk::Root>,
    skins: &[Arc<Skin>],
    part: u32,
) -> Result<Joined> {
    let lattice = &context.manifest.lattice;
    let row_bytes = context.layout.row_bytes;
    let mut codes: Vec<C> = Vec::new();
    let mut leaves = Vec::with_capacity(roots.len());
    for root in &roots {
        let start = codes.len() as u32;
        codes.extend(root.candidates.positions.iter().map(|&q| C::encode(q)));
        leaves.push((root.key, start..codes.len() as u32));
    }
    let tree = Tree::above(&leaves);
    let domain = Domain { corner: [0; 3], bits: lattice.side_bits, grid_bits: context.grid_bits };
    // Chunks reach up to different levels: beside a node sampled here there may be nodes of the same
    // level that were sampled in their chunk.
    let skins: Vec<&Skin> = skins.iter().map(AsRef::as_ref).collect();
    let sampled = poisson::sample(&tree, &codes, domain, &skins);
    // A leaf of this tree is a chunk's root.
    let root_index: HashMap<NodeKey, usize> =
        leaves.iter().enumerate().map(|(i, (key, _))| (*key, i)).collect();
    let root_of = |key: NodeKey| root_index.get(&key).copied();
    let mut bounds: Vec<Vec<LatticeBox>> = vec![Vec::new(); tree.levels.len()];
    for depth in (0..tree.levels.len()).rev() {
        let boxes = tree.levels[depth].iter().map(|node| {
            if node.is_leaf() {
                return root_of(node.key).map_or(LatticeBox::EMPTY, |r| roots[r].bounds);
            }
            let mut tight = LatticeBox::EMPTY;
            bounds[depth + 1][node.child_range()].iter().for_each(|b| tight.merge(b));
            tight
        });
        bounds[depth] = boxes.collect();
    }
    let mut normals: Vec<Vec<Option<Normals>>> = vec![Vec::new(); tree.levels.len()];
    for depth in (0..tree.levels.len()).rev() {
        let nodes = tree.levels[depth].iter().map(|node| {
            if node.is_leaf() {
                return root_of(node.key).and_then(|r| roots[r].normals);
            }
            context.layout.normal?;
            let below = normals[depth + 1][node.child_range()].iter();
            Some(Normals::of_children(below.flatten()))
        });
        normals[depth] = nodes.collect();
    }
    let all: Vec<(usize, usize)> = (0..tree.levels.len())
        .flat_map(|d| (0..tree.levels[d].len()).map(move |n| (d, n)))
        .collect();
    let row = |p: u32| -> &[u8] {
        let chunk = leaves.partition_point(|(_, range)| range.end <= p);
        let inside = (p - leaves[chunk].1.start) as usize;
        &roots[chunk].candidates.rows[inside * row_bytes..][..row_bytes]
    };
    let encoded: Vec<(OutNode, Vec<Vec<u8>>, Ranges)> = all
        .par_iter()
        .map(|&(depth, index)| {
            let node = &tree.levels[depth][index];
            let own: Vec<u32> = sampled.points_of(&tree, depth, index).collect();
            let mut encoder = NodeEncoder::new(context.layout);
            let tight = bounds[depth][index];
            // A leaf here is a chunk's root: what is below it is there already.
            let root = node.is_leaf().then(|| root_of(node.key)).flatten();
            let (child_mask, below) =
                root.map_or((node.child_mask, 0), |r| (roots[r].child_mask, roots[r].points));
            let level = node.key.level();
            let detail = Detail::of(context, level, child_mask == 0, tight, below);
            let mut out = chunk::encode_node(
                context,
                &mut encoder,
                node,
                tight,
                detail,
                part,
                &codes,
                &own,
                row,
            )?;
            out.child_mask = child_mask;
            out.normal_cone = normals[depth][index].map(|normals| normals.cone);
            Ok((out, encoder.buffers, encoder.ranges))
        })
        .collect::<Result<_>>()?;
    let mut joined = Joined {
        nodes: Vec::with_capacity(encoded.len()),
        buffers: vec![Vec::new(); context.layout.groups.len()],
        ranges: Ranges::new(context.layout),
    };
    for (mut node, buffers, ranges) in encoded {
        node.starts = joined.buffers.iter().map(|b| b.len() as u64).collect();
        for (all, own) in joined.buffers.iter_mut().zip(&buffers) {
            all.extend_from_slice(own);
        }
        joined.ranges.merge(&ranges);
        joined.nodes.push(node);
    }
    Ok(joined)
}
