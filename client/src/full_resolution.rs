//! A dataset's every point, from front to back, whatever its size.

use std::sync::Arc;

use lodestream_protocol::{Dataset, Node, ReadAt, Refinement, Result};
use rayon::prelude::*;

use crate::{engine::DrawNode, render::TruthRenderer};

/// Points that are read and decoded at a time, by all cores.
const BATCH_POINTS: u64 = 1 << 20;

/// Of all nodes, those that hold every point once, in the order in which frames draw, so that equally
/// near points are resolved alike.
pub(crate) fn nodes(refinement: Refinement, mut nodes: Vec<Node>) -> Vec<Node> {
    if refinement == Refinement::Replace {
        // The leaves are the full resolution; what is above stands in for them.
        nodes.retain(Node::is_leaf);
    }
    nodes.sort_by_key(|node| node.key);
    nodes
}

/// Reads `nodes` and draws them as those of the renderer's cloud number `cloud`; `done` is told of the
/// points of each before it is drawn, and may end it.
pub(crate) fn draw<R: ReadAt + Sync>(
    renderer: &mut TruthRenderer,
    cloud: usize,
    dataset: &Dataset<R>,
    nodes: &[Node],
    groups: &[usize],
    done: impl Fn(u64) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    let mut rest = nodes;
    while !rest.is_empty() {
        let mut points = 0;
        let fits = |node: &&Node| {
            points += u64::from(node.points);
            points <= BATCH_POINTS
        };
        // One node at least, however large.
        let count = rest.iter().take_while(fits).count().max(1);
        let (batch, next) = rest.split_at(count);
        rest = next;
        let read = |node: &Node| dataset.read_node(node, groups);
        let decoded = batch.par_iter().map(read).collect::<Result<Vec<_>>>()?;
        for (node, points) in batch.iter().zip(decoded) {
            done(points.positions.len() as u64)?;
            let (key, spacing) = (node.key, node.spacing);
            renderer.add_node(DrawNode { cloud, key, spacing, points: Arc::new(points) })?;
        }
    }
    Ok(())
}
