//! What to draw.

use std::sync::Arc;

use lodestream_protocol::{Manifest, NodeKey, NodePoints};
use serde::Serialize;

use super::view::View;

/// A node to draw.
#[derive(Debug, Clone)]
pub struct DrawNode {
    /// Number of the cloud: sources given to the engine count from 0. Indexes [`FramePlan::clouds`].
    pub cloud: usize,
    /// The node.
    pub key: NodeKey,
    /// Distance between neighbouring points of the node, world units.
    pub spacing: f32,
    /// Its elements: positions, and the columns that have arrived. Columns of further groups may
    /// still be missing while [`FramePlan::settled`] is false. Empty where the engine
    /// [only counts](super::Payloads::Count).
    pub points: Arc<NodePoints>,
    /// 0 where these are all elements of the node, as in every plan. Whoever draws a part of them gives
    /// each part of a node another number: renderers know by it what they have.
    pub part: u64,
}

/// A node that a view wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WantedNode {
    /// Index of the cloud, in the order of the sources given to the engine.
    pub cloud: usize,
    /// The node.
    pub key: NodeKey,
    /// Length of its payloads that the view needs, in the file.
    pub bytes: u64,
    /// Whether all of them are loaded.
    pub is_there: bool,
}

/// A part of an index that a view needs and that is not loaded: what there is below is not known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MissingPage {
    /// Index of the cloud, in the order of the sources given to the engine.
    pub cloud: usize,
    /// The node that it begins below; `None` for the cloud's first, which tells of the root.
    pub below: Option<NodeKey>,
}

/// Nodes and their points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Tally {
    /// Nodes.
    pub nodes: u64,
    /// Points in these nodes.
    pub points: u64,
}

impl Tally {
    pub(super) fn add(&mut self, points: u32) {
        self.nodes += 1;
        self.points += u64::from(points);
    }
}

/// What a plan leaves out, by reason. Each node counts once, without those below it, which were
/// not looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LeftOut {
    /// Outside the [clip box](super::ClipBox).
    pub clipped: Tally,
    /// Outside the picture.
    pub outside: Tally,
    /// Behind what is drawn. (The last picture's depths tell:
    /// [`Engine::set_depth`](super::Engine::set_depth).)
    pub hidden: Tally,
    /// Smaller than [`EngineConfig::min_size_px`](super::EngineConfig::min_size_px).
    pub small: Tally,
    /// Did not fit into the point budget.
    pub over_budget: Tally,
    /// Wanted, but not loaded yet.
    pub loading: Tally,
    /// Wanted, but its bytes are damaged or cannot be had.
    pub failed: Tally,
}

/// What to draw for one view. Plans are immutable; a newer one replaces an older one as a whole.
#[derive(Debug, Clone, Default)]
pub struct FramePlan {
    /// Counts up with every plan.
    pub sequence: u64,
    /// The view it is made for, by the number that
    /// [`Engine::set_view`](super::Engine::set_view) returned; 0 before the first.
    pub view_generation: u64,
    /// The view it is made for.
    pub view: Option<View>,
    /// The clouds by number, as they were when this plan was made: nodes belong to these very versions.
    /// Those that are not open, or removed, have no points.
    pub clouds: Arc<[Arc<Manifest>]>,
    /// Nodes to draw, ancestors before descendants, most important first.
    pub nodes: Vec<DrawNode>,
    /// Points in these nodes: never more than the point budget.
    pub points: u64,
    /// Points that are reserved for this view: what will be drawn, at most, once all is loaded.
    pub points_wanted: u64,
    /// Hierarchy pages that this view needs and that are not loaded yet.
    pub pages_loading: u64,
    /// What is left out.
    pub left_out: LeftOut,
    /// Bytes of decoded nodes that are kept though this plan does not need them.
    pub cached_bytes: u64,
    /// Whether this is all that the view will show: everything wanted is loaded, or has failed for
    /// good, and what is left out as hidden lies behind the picture of these very nodes.
    pub settled: bool,
}
