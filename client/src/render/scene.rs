//! What is drawn: nodes of clouds.

use std::sync::Arc;

use glam::DVec3;
use lodestream_protocol::{Manifest, NodeKey};

use crate::{
    engine::DrawNode,
    render::{Coloring, RenderError, VisibleTree, settings::ColorMode},
};

/// Where two points of the same pixel have the same depth, the one that comes first in this order
/// is seen; inside a node, the first of the node. So a picture does not depend on the order in which
/// nodes arrived.
fn order(node: &DrawNode) -> (usize, NodeKey) {
    (node.cloud, node.key)
}

/// What is drawn.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The clouds: all that the nodes belong to, as [`FramePlan::clouds`](crate::engine::FramePlan::clouds)
    /// has them. The renderer that keeps nodes from frame to frame
    /// knows a cloud again by its `Arc`, and a node by its key.
    pub clouds: &'a [Arc<Manifest>],
    /// The nodes, in any order, each once, [`DrawNode::cloud`] counting from the first cloud here.
    pub nodes: &'a [DrawNode],
}

impl<'a> Scene<'a> {
    /// The nodes in drawing order.
    pub(crate) fn ordered(&self) -> Result<Vec<&'a DrawNode>, RenderError> {
        if let Some(node) = self.nodes.iter().find(|n| n.cloud >= self.clouds.len()) {
            let (cloud, key, clouds) = (node.cloud, node.key, self.clouds.len());
            return Err(RenderError::Scene(format!(
                "node {key} is of cloud {cloud}, but there are {clouds} clouds"
            )));
        }
        let mut nodes: Vec<_> = self.nodes.iter().collect();
        nodes.sort_by_key(|node| order(node));
        Ok(nodes)
    }

    /// The drawn nodes as sizes look them up.
    pub(crate) fn tree(&self) -> VisibleTree {
        VisibleTree::of(self.nodes.iter().map(|node| (node.cloud, node.key, node.spacing)))
    }
}

/// What the colours and depths of a picture need to know about all clouds together.
#[derive(Debug, Clone)]
pub(crate) struct Surroundings {
    /// Per cloud.
    pub colorings: Vec<Coloring>,
    /// Lowest and highest corner of all clouds; `None` where there are no points.
    pub bounds: Option<(DVec3, DVec3)>,
    /// Levels of the deepest cloud.
    pub levels: u8,
}

impl Surroundings {
    pub fn of(clouds: &[Arc<Manifest>], mode: ColorMode) -> Self {
        let corners = clouds.iter().filter_map(|cloud| cloud.bounds_world());
        let corners = corners.map(|(min, max)| (DVec3::from(min), DVec3::from(max)));
        Self {
            colorings: clouds.iter().map(|cloud| Coloring::of(mode, cloud)).collect(),
            bounds: corners.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))),
            levels: clouds.iter().map(|cloud| cloud.levels).max().unwrap_or(0),
        }
    }

    /// Distance from `eye` to the farthest corner; 0 where there are no points.
    pub fn farthest(&self, eye: DVec3) -> f64 {
        self.bounds.map_or(0.0, |(min, max)| (min - eye).abs().max((max - eye).abs()).length())
    }
}
