//! What the traversal is told, besides what replaces what was told before.

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

/// Something has arrived, or never will; or a cloud comes or goes.
#[derive(Debug)]
pub(super) enum Event {
    /// The caller has added the cloud of that number.
    Added { cloud: usize, number: usize },
    /// The caller has removed the cloud of that number.
    Removed { number: usize },
    /// A cloud's manifest and root page.
    Opened { cloud: usize, boot: Arc<Boot> },
    /// Another version of the dataset stands in a cloud's place.
    Replaced { cloud: usize, by: usize, boot: Arc<Boot> },
    /// A cloud can no longer be read.
    CloudFailed { cloud: usize, message: String },
    /// It can be read again.
    CloudIsBack { cloud: usize },
    /// The page below a node.
    Page { cloud: usize, parent: NodeKey, page: HierarchyPage },
    /// A column group of a node.
    Group { node: NodeId, group: usize, content: Content },
    /// A piece is damaged for good.
    Lost { piece: PieceId, message: String },
}
