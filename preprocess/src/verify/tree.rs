//! The tree: every node has its place, holds what it announces, and keeps inside its bounds.

use std::collections::HashMap;

use lodestream_protocol::{LatticeBox, Manifest, Node, NodeKey, NodePoints};

use super::VerifyReport;

/// Every node below the root has its parent, parents know their children, bounds nest.
pub(super) fn check_tree(manifest: &Manifest, nodes: &[Node], report: &mut VerifyReport) {
    let by_key: HashMap<NodeKey, &Node> = nodes.iter().map(|n| (n.key, n)).collect();
    if by_key.len() != nodes.len() {
        report.find("a node appears twice".into());
    }
    let mut deepest = 0;
    for node in nodes {
        deepest = deepest.max(node.key.level() + 1);
        for child in node.children() {
            let Some(child) = by_key.get(&child) else {
                report.find(format!("node {}: its child {child} is missing", node.key));
                continue;
            };
            // Bounds are rounded outward by up to 1/256 of each node's own side.
            let slack = (1u64 << manifest.lattice.node_bits(node.key.level())) / 128 + 1;
            let nests = (0..3).all(|a| {
                u64::from(child.bounds.min[a]) + slack >= u64::from(node.bounds.min[a])
                    && u64::from(child.bounds.max[a]) <= u64::from(node.bounds.max[a]) + slack
            });
            if !nests {
                report.find(format!("node {}: bounds reach out of its parent's", child.key));
            }
        }
        if let Some(parent) = node.key.parent() {
            let known = by_key.get(&parent).is_some_and(|p| p.children().any(|c| c == node.key));
            if !known {
                report.find(format!("node {}: its parent does not know it", node.key));
            }
        }
        if node.is_leaf() && node.geometric_error != 0.0 {
            report.find(format!("node {}: a leaf with a geometric error", node.key));
        }
    }
    if deepest != manifest.levels {
        report.find(format!("{deepest} levels, the manifest says {}", manifest.levels));
    }
}

/// Groups take as many bytes as the manifest says.
pub(super) fn check_sizes(manifest: &Manifest, nodes: &[Node], report: &mut VerifyReport) {
    for (index, group) in manifest.groups.iter().enumerate() {
        let payloads = nodes.iter().filter_map(|node| node.payloads.get(index));
        let bytes: u64 = payloads.map(|payload| u64::from(payload.bytes)).sum();
        if bytes != group.bytes() {
            report.find(format!(
                "group {}: {bytes} bytes in the nodes, the manifest says {}",
                group.name,
                group.bytes()
            ));
        }
    }
}

/// Points are as many as announced, inside the bounds, in Morton order. Gives their own bounds.
pub(super) fn check_points(
    manifest: &Manifest,
    node: &Node,
    points: &NodePoints,
    report: &mut VerifyReport,
) -> LatticeBox {
    if points.positions.len() != node.points as usize {
        report.find(format!("node {}: {} points", node.key, points.positions.len()));
    }
    let corner = manifest.lattice.node_min(node.key);
    let mut tight = LatticeBox::EMPTY;
    for q in &points.positions {
        tight.grow(std::array::from_fn(|a| q[a] + corner[a]));
    }
    let inside = |outer: &LatticeBox| outer.contains(tight.min) && outer.contains(tight.max);
    let all_inside = inside(&node.bounds) && inside(&manifest.bounds);
    if !points.positions.is_empty() && !all_inside {
        report.find(format!("node {}: points outside its bounds", node.key));
    }
    let code = |q: &[u32; 3]| <u128 as lodestream_protocol::MortonCode>::encode(*q);
    if !points.positions.is_sorted_by_key(code) {
        report.find(format!("node {}: points are not in Morton order", node.key));
    }
    tight
}
