//! Nodes that are drawn together: their points numbered through, their work shared out.

use std::ops::Range;

use rayon::prelude::*;

use crate::engine::DrawNode;

/// Points that one task draws: enough to make its set-up cheap, few enough to share the work out.
const TASK_POINTS: usize = 8192;

/// Numbers (as a power of two) that [`Batch::find`] knows the first node of.
const RUN_BITS: u32 = 10;

/// Nodes with their points.
pub(super) struct Batch<'a> {
    nodes: &'a [DrawNode],
    /// The number of each node's first point.
    starts: Vec<usize>,
    /// For every run of numbers, the node that holds its first: most are found at once.
    nodes_of_runs: Vec<u32>,
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
        let starts: Vec<_> = nodes.iter().map(start).collect();
        debug_assert!(next - 1 <= Self::MOST_POINTS);
        let mut node = 0;
        let first_node = |run: usize| {
            while starts.get(node + 1).is_some_and(|start| *start <= run << RUN_BITS) {
                node += 1;
            }
            // Nodes are fewer than points, and those than 2^32.
            node as u32
        };
        let nodes_of_runs = (0..=next >> RUN_BITS).map(first_node).collect();
        Self { nodes, starts, nodes_of_runs }
    }

    pub const fn nodes(&self) -> &'a [DrawNode] {
        self.nodes
    }

    /// The node (as an index) that holds a point, and which of its points it is.
    pub fn find(&self, number: usize) -> (usize, usize) {
        let mut node = self.nodes_of_runs[number >> RUN_BITS] as usize;
        while self.starts.get(node + 1).is_some_and(|start| *start <= number) {
            node += 1;
        }
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lodestream_protocol::{NodeKey, NodePoints};

    use super::*;

    #[test]
    fn every_number_is_found_in_its_node() {
        // Empty nodes among them, at both ends too; nodes larger than a run and smaller.
        let counts = [0, 1, 0, 3000, 5, 1024, 0, 0, 7, 0];
        let node = |count| {
            let key = NodeKey::ROOT;
            let points = NodePoints { positions: vec![[0; 3]; count], ..NodePoints::new(key) };
            DrawNode { cloud: 0, key, spacing: 1.0, points: Arc::new(points) }
        };
        let nodes = counts.map(node);
        let batch = Batch::of(&nodes);
        let expected = counts.iter().enumerate();
        let expected = expected.flat_map(|(node, count)| (0..*count).map(move |i| (node, i)));
        for (expected, number) in expected.zip(1..) {
            assert_eq!(batch.find(number), expected, "{number}");
        }
        assert_eq!(Batch::of(&[]).nodes().len(), 0);
    }
}
