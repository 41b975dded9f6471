//! What is loaded: the smallest things that can be asked for.

use std::sync::Arc;

use lodestream_protocol::{Node, NodeKey};

/// A node of one of the engine's clouds. Here and wherever else the engine speaks of a `cloud`, it means
/// one version of it: another version, or another cloud, never has the same index, so that nothing of
/// the one can be taken for the other's. The caller knows clouds by their `number`, which stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct NodeId {
    pub cloud: usize,
    pub key: NodeKey,
}

/// Which of a node's things.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Part {
    /// The hierarchy page that describes its children.
    Page,
    /// The payload of a column group.
    Group(usize),
}

/// Identifies a piece.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct PieceId {
    pub node: NodeId,
    pub part: Part,
}

/// A hierarchy page or one column group of one node: one range of bytes.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub id: PieceId,
    pub node: Arc<Node>,
    /// File offset in bytes.
    pub offset: u64,
    /// Length in bytes; may be zero.
    pub len: u64,
}

impl Piece {
    /// The page below `node`, where there is one.
    pub fn page(cloud: usize, node: &Arc<Node>) -> Option<Self> {
        let page = node.child_page?;
        Some(Self::new(cloud, node, Part::Page, page.offset, page.bytes))
    }

    /// The payload of a group of `node`, where there is one.
    pub fn group(cloud: usize, node: &Arc<Node>, group: usize) -> Option<Self> {
        let payload = node.payloads.get(group)?;
        Some(Self::new(cloud, node, Part::Group(group), payload.offset, payload.bytes))
    }

    fn new(cloud: usize, node: &Arc<Node>, part: Part, offset: u64, bytes: u32) -> Self {
        let id = PieceId { node: NodeId { cloud, key: node.key }, part };
        Self { id, node: Arc::clone(node), offset, len: u64::from(bytes) }
    }

    /// One past the last byte. The format's reader has checked offsets; a sum that overflows all
    /// the same becomes a range that no file has.
    pub const fn end(&self) -> u64 {
        self.offset.saturating_add(self.len)
    }
}
