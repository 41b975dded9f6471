//! Normal cones: each holds the normals of its node and of all below.

use std::collections::HashMap;

use lodestream_protocol::{Attribute, Manifest, Node, NodeKey, NodePoints, NormalCone};

use super::VerifyReport;

/// The cones of all nodes, and which attribute they are about.
#[derive(Debug)]
pub(super) struct Cones {
    normal: usize,
    cones: HashMap<NodeKey, NormalCone>,
}

impl Cones {
    /// The cones of `nodes`, where the dataset stores normals: then every node has one, else none.
    pub(super) fn of(
        manifest: &Manifest,
        nodes: &[Node],
        report: &mut VerifyReport,
    ) -> Option<Self> {
        let is_stored = |a: &Attribute| a.is_normal() && a.group().is_some();
        let normal = manifest.attributes.iter().position(is_stored);
        for node in nodes.iter().filter(|node| node.normal_cone.is_some() != normal.is_some()) {
            let what =
                if normal.is_some() { "no normal cone" } else { "a normal cone, but no normals" };
            report.find(format!("node {}: {what}", node.key));
        }
        let cones = nodes.iter().filter_map(|node| Some((node.key, node.normal_cone?)));
        Some(Self { normal: normal?, cones: cones.collect() })
    }

    /// What is wrong with the cones of a node and of those above it, given its points.
    pub(super) fn check(&self, manifest: &Manifest, points: &NodePoints) -> Vec<String> {
        let Some(column) = points.column(self.normal) else { return Vec::new() };
        let scalar = manifest.attributes[self.normal].scalar;
        let size = scalar.size_bytes();
        let normals: Vec<[f64; 3]> = column
            .bytes
            .chunks_exact(3 * size)
            .map(|value| std::array::from_fn(|a| scalar.to_f64(&value[a * size..])))
            .collect();
        (0..=points.key.level())
            .filter_map(|level| points.key.ancestor(level))
            .filter_map(|key| Some((key, self.cones.get(&key)?)))
            .filter_map(|(key, cone)| {
                let outside = normals.iter().filter(|&&normal| !cone.contains(normal)).count();
                (outside > 0).then(|| {
                    format!("node {}: {outside} normals outside of the cone of {key}", points.key)
                })
            })
            .collect()
    }
}
