//! What many engines in one process have in common: indices of the same dataset are kept once.
//!
//! A thousand clients of one dataset would hold its index a thousand times. Each of them reads, checks and
//! parses what its own host sends; only what turns out to be equal to what another one holds is
//! replaced by that. Nothing is kept that nobody holds any more.

use std::{
    collections::HashMap,
    sync::{Arc, Mutex, MutexGuard, PoisonError, Weak},
};

use bytes::Bytes;
use lodestream_protocol::{Boot, HierarchyPage, Node, NodeKey};

/// The nodes of a page.
pub(super) type PageNodes = HashMap<NodeKey, Arc<Node>>;

/// Which page of a tree: `None` is the root page, `Some(key)` the one below that node.
pub(super) type PageId = Option<NodeKey>;

/// Identity of a dataset's content, as its header tells it.
type ContentId = [u8; 16];

/// What engines share.
#[derive(Debug, Default)]
pub struct Commons {
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    boots: HashMap<ContentId, Weak<Boot>>,
    prefixes: HashMap<ContentId, Weak<Prefix>>,
    pages: HashMap<(ContentId, PageId), Weak<PageNodes>>,
}

/// The first bytes of a file.
#[derive(Debug)]
struct Prefix(Bytes);

impl AsRef<[u8]> for Prefix {
    fn as_ref(&self) -> &[u8] {
        &self.0
    }
}

/// A prefix that someone holds.
struct Holder(Arc<Prefix>);

impl AsRef<[u8]> for Holder {
    fn as_ref(&self) -> &[u8] {
        (*self.0).as_ref()
    }
}

impl Commons {
    /// The boot block, or one that is equal to it.
    pub(super) fn boot(&self, boot: Arc<Boot>) -> Arc<Boot> {
        let mut held = self.held();
        let known = held.boots.entry(boot.header.content_id).or_default();
        match known.upgrade().filter(|known| *known == boot) {
            Some(known) => known,
            None => {
                *known = Arc::downgrade(&boot);
                boot
            }
        }
    }

    /// The first bytes of a file, or others that are equal to them.
    pub(super) fn prefix(&self, boot: &Boot, bytes: Bytes) -> Bytes {
        let mut held = self.held();
        let known = held.prefixes.entry(boot.header.content_id).or_default();
        let found = known.upgrade().filter(|known| known.0 == bytes);
        let prefix = found.unwrap_or_else(|| {
            let prefix = Arc::new(Prefix(bytes));
            *known = Arc::downgrade(&prefix);
            prefix
        });
        Bytes::from_owner(Holder(prefix))
    }

    /// The page's nodes, or others that are equal to them.
    pub(super) fn nodes(&self, boot: &Boot, id: PageId, page: HierarchyPage) -> Arc<PageNodes> {
        let mut held = self.held();
        let known = held.pages.entry((boot.header.content_id, id)).or_default();
        let is_equal = |known: &Arc<PageNodes>| {
            let same = |node: &Node| known.get(&node.key).is_some_and(|known| **known == *node);
            known.len() == page.nodes.len() && page.nodes.iter().all(same)
        };
        if let Some(found) = known.upgrade().filter(is_equal) {
            return found;
        }
        let nodes = Arc::new(page_nodes(page));
        *known = Arc::downgrade(&nodes);
        nodes
    }

    /// Changes are moves: whole, whoever panics.
    fn held(&self) -> MutexGuard<'_, Held> {
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The nodes of a page, by their keys.
pub(super) fn page_nodes(page: HierarchyPage) -> PageNodes {
    page.nodes.into_iter().map(|node| (node.key, Arc::new(node))).collect()
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::Manifest;

    use super::*;
    use crate::engine::testing;

    fn boot(points: u64) -> Boot {
        testing::boot([7; 16], Manifest { points, ..testing::manifest() }, vec![])
    }

    fn page(points: u32) -> HierarchyPage {
        HierarchyPage { nodes: vec![Node { points, ..testing::node(NodeKey::ROOT) }] }
    }

    #[test]
    fn what_is_equal_is_kept_once_and_what_differs_apart() {
        let commons = Commons::default();
        let first = commons.boot(Arc::new(boot(1)));
        assert!(Arc::ptr_eq(&first, &commons.boot(Arc::new(boot(1)))));
        // Another index under the same identity: a host that is wrong stays wrong.
        assert!(!Arc::ptr_eq(&first, &commons.boot(Arc::new(boot(2)))));

        let nodes = commons.nodes(&first, None, page(5));
        assert!(Arc::ptr_eq(&nodes, &commons.nodes(&first, None, page(5))));
        assert!(!Arc::ptr_eq(&nodes, &commons.nodes(&first, None, page(6))));

        let bytes = |byte| Bytes::from(vec![byte; 100]);
        let kept = commons.prefix(&first, bytes(1));
        assert_eq!(kept.as_ptr(), commons.prefix(&first, bytes(1)).as_ptr());
        assert_eq!(commons.prefix(&first, bytes(2)), bytes(2));
    }

    #[test]
    fn what_nobody_holds_is_forgotten() {
        let commons = Commons::default();
        let first = boot(1);
        drop(commons.nodes(&first, None, page(5)));
        let held = commons.held();
        assert!(held.pages.values().all(|page| page.upgrade().is_none()));
    }
}
