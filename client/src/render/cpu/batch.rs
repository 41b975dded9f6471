//! Nodes that are drawn together: their points numbered through, their work shared out.

use std::ops::Range;

use rayon::prelude::*;

use crate::engine::DrawNode;

/// Points that one task draws: enough to make its set-up cheap, few enough to share the work out.
const TASK_POINTS: usize = 8192;

/// Nodes with their points.
pub(super) struct Batch<'a> {
    nodes: &'a [DrawNode],
    /// The number of each node's first point.
    starts: Vec<usize>,
}

/// A run of points of a node.
pub(super) struct Task<'a> {
    pub node: &'a DrawNode,
    /// Within the node.
    pub run: Range<usize>,
    /// Number of the node's first point.
    pub start: usize,
}

impl<'a> Batch<'a> {
    /// Most points: their numbers, from 1, are 32 bits.
    pub const MOST_POINTS: usize = u32::MAX as usize - 1;

    /// Of nodes with at most so many points in all.
    pub fn of(nodes: &'a [DrawNode]) -> Self {
        let mut next = 1;
        let start = |node: &DrawNode| {
            let start = next;
            next += node.points.positions.len();
            start
        };
        let starts = nodes.iter().map(start).collect();
        debug_assert!(next - 1 <= Self::MOST_POINTS);
        Self { nodes, starts }
    }

    pub const fn nodes(&self) -> &'a [DrawNode] {
        self.nodes
    }

    /// The node (as an index) that holds a point, and which of its points it is.
    pub fn find(&self, number: usize) -> (usize, usize) {
        let node = self.starts.partition_point(|start| *start <= number) - 1;
        (node, number - self.starts[node])
    }

    /// Does the work on all points, on all cores.
    pub fn for_each(&self, work: impl Fn(Task) + Send + Sync) {
        let mut tasks = Vec::new();
        for (node, start) in self.nodes.iter().zip(&self.starts) {
            let count = node.points.positions.len();
            let firsts = (0..count).step_by(TASK_POINTS);
            let runs = firsts.map(|first| first..(first + TASK_POINTS).min(count));
            tasks.extend(runs.map(|run| Task { node, run, start: *start }));
        }
        tasks.into_par_iter().for_each(work);
    }
}
