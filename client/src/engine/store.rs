//! Decoded nodes: those that the view needs, and a cache of the others.
//!
//! Needed nodes are pinned: the point budget bounds them. The rest is bounded in bytes and dropped
//! least recently used first. A node that is dropped is unknown again.

use std::{
    collections::{HashMap, HashSet},
    sync::Arc,
};

use lodestream_protocol::NodePoints;
use lru::LruCache;

use super::{
    event::Content,
    piece::{NodeId, PieceId},
};

/// The groups of a node as bits; manifests hold at most 64.
pub(super) type GroupMask = u64;

/// What is loaded of one node.
#[derive(Debug)]
struct Resident {
    points: Arc<NodePoints>,
    groups: GroupMask,
    bytes: u64,
}

/// All decoded nodes.
#[derive(Debug)]
pub(super) struct Store {
    pinned: HashMap<NodeId, Resident>,
    cached: LruCache<NodeId, Resident>,
    pinned_bytes: u64,
    cached_bytes: u64,
    cache_limit: u64,
    /// Nodes that came since the last [`pin`](Self::pin): taking these is no cache hit.
    fresh: HashSet<NodeId>,
    /// Pieces that can never be had.
    lost: HashSet<PieceId>,
}

/// What [`Store::pin`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Moved {
    /// Nodes that were in the cache and are needed again.
    pub hits: u64,
    /// Nodes dropped.
    pub evicted: u64,
}

/// The bit of a group; none for one that no manifest can have.
pub(super) const fn group_bit(group: usize) -> GroupMask {
    if group < 64 { 1 << group } else { 0 }
}

impl Store {
    pub fn new(cache_limit: u64) -> Self {
        Self {
            pinned: HashMap::new(),
            cached: LruCache::unbounded(),
            pinned_bytes: 0,
            cached_bytes: 0,
            cache_limit,
            fresh: HashSet::new(),
            lost: HashSet::new(),
        }
    }

    /// Changes the limit; the next [`pin`](Self::pin) keeps to it.
    pub fn set_cache_limit(&mut self, bytes: u64) {
        self.cache_limit = bytes;
    }

    /// Forgets all of a cloud.
    pub fn forget(&mut self, cloud: usize) {
        for (_, resident) in self.pinned.extract_if(|id, _| id.cloud == cloud) {
            self.pinned_bytes -= resident.bytes;
        }
        let of_cloud = self.cached.iter().map(|(id, _)| *id).filter(|id| id.cloud == cloud);
        for id in of_cloud.collect::<Vec<_>>() {
            if let Some(resident) = self.cached.pop(&id) {
                self.cached_bytes -= resident.bytes;
            }
        }
        self.fresh.retain(|id| id.cloud != cloud);
        self.find(cloud);
    }

    /// Adds a group. Call [`pin`](Self::pin) afterwards: until then it counts as cached.
    pub fn add(&mut self, id: NodeId, group: usize, content: Content) {
        let (resident, total) = if let Some(resident) = self.pinned.get_mut(&id) {
            (resident, &mut self.pinned_bytes)
        } else {
            let empty =
                || Resident { points: Arc::new(NodePoints::new(id.key)), groups: 0, bytes: 0 };
            (self.cached.get_or_insert_mut(id, empty), &mut self.cached_bytes)
        };
        if resident.groups & group_bit(group) != 0 {
            return;
        }
        let bytes = match content {
            Content::Decoded(decoded) => {
                // Copies where a plan holds the points: a further group came after the first picture.
                if Arc::make_mut(&mut resident.points).add(decoded).is_err() {
                    // Fine positions of a node that was dropped meanwhile: they will be asked for again.
                    return;
                }
                size_bytes(&resident.points)
            }
            Content::Counted(bytes) => resident.bytes + bytes,
        };
        resident.groups |= group_bit(group);
        self.fresh.insert(id);
        *total += bytes - resident.bytes;
        resident.bytes = bytes;
    }

    /// Pins exactly the nodes in `needed`; caches the others as far as they fit.
    pub fn pin(&mut self, needed: &HashSet<NodeId>) -> Moved {
        let mut moved = Moved::default();
        for (id, resident) in self.pinned.extract_if(|id, _| !needed.contains(id)) {
            self.pinned_bytes -= resident.bytes;
            self.cached_bytes += resident.bytes;
            self.cached.put(id, resident);
        }
        for id in needed {
            if let Some(resident) = self.cached.pop(id) {
                self.cached_bytes -= resident.bytes;
                self.pinned_bytes += resident.bytes;
                self.pinned.insert(*id, resident);
                moved.hits += u64::from(!self.fresh.contains(id));
            }
        }
        while self.cached_bytes > self.cache_limit {
            let Some((_, resident)) = self.cached.pop_lru() else { break };
            self.cached_bytes -= resident.bytes;
            moved.evicted += 1;
        }
        self.fresh.clear();
        moved
    }

    /// Groups that are loaded of a node.
    pub fn groups(&self, id: NodeId) -> GroupMask {
        self.resident(id).map_or(0, |resident| resident.groups)
    }

    /// The points of a node whose group 0 is loaded.
    pub fn points(&self, id: NodeId) -> Option<&Arc<NodePoints>> {
        self.resident(id).filter(|r| r.groups & group_bit(0) != 0).map(|r| &r.points)
    }

    fn resident(&self, id: NodeId) -> Option<&Resident> {
        self.pinned.get(&id).or_else(|| self.cached.peek(&id))
    }

    /// Notes that a piece can never be had.
    pub fn lose(&mut self, id: PieceId) {
        self.lost.insert(id);
    }

    /// What was lost of a cloud may be had after all.
    pub fn find(&mut self, cloud: usize) {
        self.lost.retain(|id| id.node.cloud != cloud);
    }

    /// Whether a piece can never be had.
    pub fn is_lost(&self, id: PieceId) -> bool {
        self.lost.contains(&id)
    }

    /// Whether any piece can never be had.
    pub fn has_lost(&self) -> bool {
        !self.lost.is_empty()
    }

    pub const fn pinned_bytes(&self) -> u64 {
        self.pinned_bytes
    }

    pub const fn cached_bytes(&self) -> u64 {
        self.cached_bytes
    }
}

fn size_bytes(points: &NodePoints) -> u64 {
    let columns: usize = points.columns.iter().map(|column| column.bytes.len()).sum();
    (size_of_val(points.positions.as_slice()) + columns) as u64
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{Column, DecodedGroup, NodeKey};

    use super::*;
    use crate::engine::piece::Part;

    fn id(octant: u8) -> NodeId {
        NodeId { cloud: 0, key: NodeKey::ROOT.child(octant).expect("below the root") }
    }

    /// 12 bytes a point.
    fn base(points: usize) -> Content {
        let positions = vec![[1, 2, 3]; points];
        Content::Decoded(DecodedGroup { positions, ..DecodedGroup::default() })
    }

    fn store(cache_limit: u64, nodes: u8) -> Store {
        let mut store = Store::new(cache_limit);
        (0..nodes).for_each(|n| store.add(id(n), 0, base(10)));
        store
    }

    #[test]
    fn the_least_recently_used_nodes_are_dropped_and_pinned_ones_never() {
        let mut store = store(250, 4);
        let moved = store.pin(&HashSet::from([id(0)]));
        assert_eq!(moved, Moved { hits: 0, evicted: 1 });
        assert_eq!((store.pinned_bytes(), store.cached_bytes()), (120, 240));
        assert!(store.points(id(0)).is_some() && store.points(id(1)).is_none());
        let moved = store.pin(&HashSet::from([id(2)]));
        assert_eq!(moved, Moved { hits: 1, evicted: 0 });
        store.add(id(5), 0, base(10));
        assert_eq!(store.pin(&HashSet::new()).evicted, 2);
        assert!(store.cached_bytes() <= 250 && store.pinned_bytes() == 0);
    }

    #[test]
    fn a_cache_of_nothing_keeps_only_what_is_needed() {
        let mut store = store(0, 3);
        store.pin(&HashSet::from([id(1)]));
        assert_eq!((store.pinned_bytes(), store.cached_bytes()), (120, 0));
        assert!(store.points(id(1)).is_some());
    }

    #[test]
    fn a_forgotten_cloud_leaves_nothing_and_the_others_alone() {
        let mut store = store(1000, 2);
        let other = NodeId { cloud: 1, ..id(0) };
        store.add(other, 0, base(10));
        store.lose(PieceId { node: id(3), part: Part::Page });
        store.pin(&HashSet::from([id(0), other]));
        store.forget(0);
        assert_eq!((store.pinned_bytes(), store.cached_bytes()), (120, 0));
        assert!(store.points(other).is_some() && store.groups(id(0)) == 0 && !store.has_lost());
        store.forget(1);
        assert_eq!((store.pinned_bytes(), store.cached_bytes()), (0, 0));
    }

    #[test]
    fn groups_join_in_any_order_and_leave_shared_points_alone() {
        let columns = vec![Column { attribute: 1, bytes: vec![0; 20] }];
        let further = || {
            let columns = columns.clone();
            Content::Decoded(DecodedGroup { columns, ..DecodedGroup::default() })
        };
        let mut store = Store::new(1000);
        store.add(id(0), 1, further());
        assert!(store.points(id(0)).is_none(), "no positions yet");
        store.add(id(0), 0, base(10));
        assert_eq!(store.groups(id(0)), 0b11);

        store.add(id(1), 0, base(10));
        let shown = Arc::clone(store.points(id(1)).expect("there"));
        store.add(id(1), 1, further());
        assert!(shown.columns.is_empty());
        assert_eq!(store.points(id(1)).expect("there").columns.len(), 1);
        assert_eq!(store.cached_bytes(), 2 * 140);
    }

    #[test]
    fn a_group_that_comes_twice_counts_once() {
        let mut store = store(1000, 1);
        store.add(id(0), 0, base(10));
        assert_eq!(store.cached_bytes(), 120);
    }
}
