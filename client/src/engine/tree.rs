//! The tree of one cloud, as far as its hierarchy pages are loaded.
//!
//! Pages that the newest walk did not touch are dropped when there are many: a tree of 10^8 nodes
//! must not grow into memory over a day of flying through it. Loaded points do not depend on the
//! pages; they live in the store, by key.

use std::{collections::HashMap, sync::Arc};

use lodestream_protocol::{Boot, HierarchyPage, Node, NodeKey};

use super::commons::{Commons, PageId, PageNodes, page_nodes};

/// Nodes that one cloud's tree may hold before untouched pages are dropped; about 128 MiB.
const MAX_NODES: usize = 1 << 19;

/// The loaded part of a tree.
#[derive(Debug)]
pub(super) struct Tree {
    boot: Arc<Boot>,
    pages: HashMap<PageId, Page>,
    /// Where other trees may have the same pages.
    commons: Option<Arc<Commons>>,
    nodes: usize,
    walk: u64,
    is_hidden: bool,
}

#[derive(Debug)]
struct Page {
    nodes: Arc<PageNodes>,
    /// The last walk that looked into it.
    walk: u64,
}

/// A node and where it was found.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub node: Arc<Node>,
    page: PageId,
}

/// What is known of a node's children.
#[derive(Debug)]
pub(super) enum Children {
    /// All of them (none for a leaf).
    Known(Vec<Place>),
    /// They are described in a page that is not loaded.
    Unknown,
}

impl Tree {
    pub fn new(boot: Arc<Boot>, commons: Option<Arc<Commons>>) -> Self {
        let pages = HashMap::new();
        let mut tree = Self { pages, commons, nodes: 0, walk: 0, is_hidden: false, boot };
        let root_page = tree.boot.root_page.clone();
        tree.insert(None, root_page);
        tree
    }

    pub fn boot(&self) -> &Arc<Boot> {
        &self.boot
    }

    /// Whether walks find nothing, because the cloud is not to be seen.
    pub fn hide(&mut self, is_hidden: bool) {
        self.is_hidden = is_hidden;
    }

    /// Adds the page below `parent`.
    pub fn add_page(&mut self, parent: NodeKey, page: HierarchyPage) {
        self.insert(Some(parent), page);
    }

    fn insert(&mut self, id: PageId, page: HierarchyPage) {
        let nodes = match &self.commons {
            Some(commons) => commons.nodes(&self.boot, id, page),
            None => Arc::new(page_nodes(page)),
        };
        self.nodes += nodes.len();
        if let Some(old) = self.pages.insert(id, Page { nodes, walk: self.walk }) {
            self.nodes -= old.nodes.len();
        }
    }

    /// Starts a walk from the root; drops pages that the last one did not touch, if there are too
    /// many nodes. `None` where the cloud has no points or is hidden.
    pub fn start_walk(&mut self) -> Option<Place> {
        if self.is_hidden {
            return None;
        }
        if self.nodes > MAX_NODES {
            self.drop_untouched_pages();
        }
        self.walk += 1;
        let node = Arc::clone(self.pages.get(&None)?.nodes.get(&NodeKey::ROOT)?);
        Some(Place { node, page: None })
    }

    /// A page below a dropped one was not touched either, so none is left without its way.
    fn drop_untouched_pages(&mut self) {
        let last = self.walk;
        self.pages.retain(|id, page| id.is_none() || page.walk >= last);
        self.nodes = self.pages.values().map(|page| page.nodes.len()).sum();
    }

    /// The children of a node.
    pub fn children(&mut self, place: &Place) -> Children {
        let id = if place.node.child_page.is_some() { Some(place.node.key) } else { place.page };
        let Some(page) = self.pages.get_mut(&id) else { return Children::Unknown };
        page.walk = self.walk;
        let found = place.node.children().filter_map(|key| page.nodes.get(&key));
        Children::Known(found.map(|node| Place { node: Arc::clone(node), page: id }).collect())
    }
}
