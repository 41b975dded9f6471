//! Which nodes lie behind what was drawn.
//!
//! The caller hands back the depths of the pictures that it draws, with the plan that each is of
//! (Schütz 2021, 4.1, shows why; Lenertz 2014, 2.5, leaves it open). A node is hidden where everything
//! that it or a node below it could draw lies behind what was drawn there. It is neither loaded nor drawn then,
//! and no pixel is another for it, once the plan has settled, because:
//! - Depths count for the very view (camera and size) that they are of. Moved to another camera, they would
//!   have holes where something comes into sight, or guesses; as a picture takes a few milliseconds and a
//!   request 40, little is lost by waiting for the first picture of the new view.
//! - A plan that leaves something out as hidden is settled only when the depths are those of the very
//!   nodes that it draws. Depths of an earlier plan may leave out what has come into sight since; they do no more
//!   than to put it off.
//! - What is seen in a picture is not behind it: leaving out what is hidden leaves the depths as they are.
//! - Only nodes of additive clouds are left out. Where children stand in for their parent, the parent
//!   may itself hide them, and would for good.
//!
//! A simulated courtyard of 4 M points from six places in and around its house (960 x 540, circles, no
//! bound of points), against all that is in the picture. Sizes of 1.6 spacings of their level: 5 % of the
//! bytes less in a room with open doors, 14 to 40 % elsewhere (at a door, 7.9 MB become 4.8, 1.6 M points
//! 0.9 M, 3.4 s on 20 Mbit/s 2.2 s). Sizes of three pixels: 0 to 8 %. Sizes of 1.6 spacings of the finest node:
//! nothing, of 3 spacings up to 5 %. Large coarse splats close the walls that small fine ones leave holes
//! in, and where there is a hole, something may be seen through it.
//!
//! It comes to an end: a node that is not hidden by the depths of a plan for which all is loaded is
//! never again taken for hidden in that view. So every further plan of the view has one hidden node
//! less, or is the last.

use std::{collections::HashSet, sync::Arc};

use glam::DVec3;

use super::{
    depth::DepthPyramid,
    piece::NodeId,
    plan::{DrawNode, FramePlan},
    view::{Optics, View, WorldBox},
};

/// Depths are rounded to f32 and, on GPUs, computed in it: as a part of the distance.
const DEPTH_ROUNDING: f64 = 1e-5;

/// Pixels around a splat that may count to it: a pixel is covered where its middle is, or the splat's
/// centre, and a GPU may round either.
const PIXEL_ROUNDING: f64 = 2.0;

/// How far splats reach around the points of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplatReach {
    /// Pixels across the view.
    pub px: f64,
    /// World units, besides.
    pub world: f64,
    /// So many times the spacing of the node, besides; of the node above where sizes follow the
    /// finest node drawn.
    pub spacings: f64,
    /// Whether sizes follow the finest node that is drawn where a point is. Points of the nodes above then
    /// are larger where a node is left out, and must be behind, too.
    pub is_adaptive: bool,
}

/// A node in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct DrawnNode {
    id: NodeId,
    /// How exactly its points were placed.
    cell_bits: u8,
}

impl DrawnNode {
    pub fn of(node: &DrawNode) -> Self {
        let id = NodeId { cloud: node.cloud, key: node.key };
        Self { id, cell_bits: node.points.cell_bits }
    }
}

/// What was drawn: the depths of a picture, and what it is of.
#[derive(Debug, Clone)]
pub(super) struct Drawn {
    pub view: View,
    /// Of the plan.
    pub sequence: u64,
    /// In order.
    nodes: Vec<DrawnNode>,
    depth: Arc<DepthPyramid>,
    reach: SplatReach,
}

impl Drawn {
    /// The picture of a plan. `None` where the plan is of no view, or of one of another size.
    pub fn new(plan: &FramePlan, depth: Arc<DepthPyramid>, reach: SplatReach) -> Option<Self> {
        let view = plan.view.filter(|view| view.size_px == depth.size_px())?;
        let nodes = in_order(plan.nodes.iter().map(DrawnNode::of));
        Some(Self { view, sequence: plan.sequence, nodes, depth, reach })
    }

    /// Whether it is a picture of these nodes.
    pub fn is_of(&self, nodes: impl Iterator<Item = DrawnNode>) -> bool {
        self.nodes == in_order(nodes)
    }

    /// Whether it is the same picture as another.
    pub fn is_same(&self, other: &Self) -> bool {
        self.view == other.view && self.nodes == other.nodes && self.reach == other.reach
    }
}

fn in_order(nodes: impl Iterator<Item = DrawnNode>) -> Vec<DrawnNode> {
    let mut nodes: Vec<_> = nodes.collect();
    nodes.sort_unstable();
    nodes
}

/// A node that may be hidden.
pub(super) struct Suspect {
    pub id: NodeId,
    /// Holds all points of its cube: its own, those of the nodes below and those of the nodes above.
    pub bounds: WorldBox,
    /// Between its points, world units.
    pub spacing: f64,
    /// Of the node above.
    pub spacing_above: f64,
}

/// What hides nodes in a selection.
pub(super) struct Occluders<'a> {
    pub drawn: &'a Drawn,
    /// Nodes of the view that stay in sight.
    pub in_sight: &'a mut HashSet<NodeId>,
    /// Whether what is not hidden now is to stay in sight.
    pub is_complete: bool,
    /// Pixels that the cells of a node may take up whose points are not placed exactly.
    pub cell_px: f64,
}

impl Occluders<'_> {
    /// Whether a node, and with it all below it, is hidden.
    pub fn hide(&mut self, optics: &Optics, suspect: &Suspect) -> bool {
        if self.in_sight.contains(&suspect.id) {
            return false;
        }
        let hidden = self.is_behind(optics, suspect);
        if !hidden && self.is_complete {
            self.in_sight.insert(suspect.id);
        }
        hidden
    }

    fn is_behind(&self, optics: &Optics, suspect: &Suspect) -> bool {
        let reach = &self.drawn.reach;
        let spacing_above = if reach.is_adaptive { suspect.spacing_above } else { 0.0 };
        let spacing = suspect.spacing.max(spacing_above);
        let bounds = suspect.bounds;
        // Points of the nodes above may lie half a cell beside their places.
        let cell = 0.5 * self.cell_px / optics.largest_scale(&bounds);
        // Of a sphere around the corners of squares.
        let world = std::f64::consts::SQRT_2 * (reach.world + reach.spacings * spacing) + cell;
        let grown = WorldBox { half: bounds.half + DVec3::splat(world), ..bounds };
        let Some(extent) = optics.extent(&optics.with_rounding(&grown)) else { return false };
        let nearest = extent.nearest * (1.0 - DEPTH_ROUNDING);
        let [width, height] = self.drawn.depth.size_px().map(f64::from);
        let px = reach.px + PIXEL_ROUNDING;
        // Rows count downwards. Casts from float saturate.
        let first = [0.5 * width + extent.min[0] - px, 0.5 * height - extent.max[1] - px];
        let last = [0.5 * width + extent.max[0] + px, 0.5 * height - extent.min[1] + px];
        let pixel = |c: f64| c.floor() as i64;
        let is_place = first.iter().chain(&last).all(|c| !c.is_nan());
        is_place && self.drawn.depth.is_nearer(first.map(pixel), last.map(pixel), nearest)
    }
}
