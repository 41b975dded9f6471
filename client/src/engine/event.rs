//! What the loader tells the traversal.

use std::sync::Arc;

use lodestream_protocol::{Boot, DecodedGroup, HierarchyPage, NodeKey};

use super::piece::{NodeId, PieceId};

/// What there is of a column group.
#[derive(Debug)]
pub(super) enum Content {
    /// All of it.
    Decoded(DecodedGroup),
    /// So many bytes that it would take if it were decoded.
    Counted(u64),
}

/// Something has arrived, or never will.
#[derive(Debug)]
pub(super) enum Event {
    /// A cloud's manifest and root page.
    Opened { cloud: usize, boot: Arc<Boot> },
    /// A cloud can no longer be read.
    CloudFailed { cloud: usize, message: String },
    /// The page below a node.
    Page { cloud: usize, parent: NodeKey, page: HierarchyPage },
    /// A column group of a node.
    Group { node: NodeId, group: usize, content: Content },
    /// A piece is damaged for good.
    Lost { piece: PieceId, message: String },
}
