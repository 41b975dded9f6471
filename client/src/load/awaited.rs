//! What a visitor waits for: nodes and parts of the index, and since when.
//!
//! A node is due when the first view is that wants it. Whether a view wants what lies below a part of the index
//! that has not come cannot be told: once it has, what is wanted there counts as due since that part was. All
//! other nodes are known when their view is, and do not wait for any part of the index.

use std::{collections::HashMap, iter::successors};

use lodestream_protocol::NodeKey;
use tokio::time::Instant;

use super::ledger::NodeWait;
use crate::engine::{MissingPage, WantedNode};

/// What the newest plan wants and has not.
#[derive(Debug, Default)]
pub struct Awaited {
    /// Since when, and the last plan that wanted it.
    nodes: HashMap<(usize, NodeKey), (Instant, u64)>,
    /// Since when.
    pages: HashMap<MissingPage, Instant>,
    plans: u64,
}

impl Awaited {
    /// A plan has come at `now`, for views of which the oldest was due at `due`. Waits that have ended are added to
    /// `waits`.
    pub fn note(
        &mut self,
        due: Instant,
        wanted: &[WantedNode],
        missing: impl IntoIterator<Item = MissingPage>,
        now: Instant,
        waits: &mut Vec<NodeWait>,
    ) {
        self.plans += 1;
        for node in wanted {
            let id = (node.cloud, node.key);
            if node.is_there {
                if let Some((due, _)) = self.nodes.remove(&id) {
                    waits.push(NodeWait { due, end: now, came: true });
                }
            } else if let Some((_, newest)) = self.nodes.get_mut(&id) {
                *newest = self.plans;
            } else {
                let since = self.known_since(node.cloud, Some(node.key), due);
                self.nodes.insert(id, (since, self.plans));
            }
        }
        let plans = self.plans;
        // What the camera has left behind before it came.
        for (_, (due, _)) in self.nodes.extract_if(|_, (_, wanted)| *wanted != plans) {
            waits.push(NodeWait { due, end: now, came: false });
        }
        let since = |page: MissingPage| {
            let known = self.pages.get(&page).copied();
            (page, known.unwrap_or_else(|| self.known_since(page.cloud, page.below, due)))
        };
        self.pages = missing.into_iter().map(since).collect();
    }

    /// Since when a node is wanted that a plan wants for the first time: since the part of the index was that it
    /// became known by, where the plan before had to do without; else since `due`.
    fn known_since(&self, cloud: usize, node: Option<NodeKey>, due: Instant) -> Instant {
        let above = successors(node.and_then(NodeKey::parent), |key| key.parent());
        let pages = above.map(Some).chain([None]).map(|below| MissingPage { cloud, below });
        pages.filter_map(|page| self.pages.get(&page).copied()).fold(due, Instant::min)
    }

    /// Nothing more comes: the waits of what has not, until `now`. A part of the index counts as one node: there is no
    /// telling how many it would have been.
    pub fn give_up(self, now: Instant) -> impl Iterator<Item = NodeWait> {
        let nodes = self.nodes.into_values().map(|(due, _)| due);
        let all = nodes.chain(self.pages.into_values());
        all.map(move |due| NodeWait { due, end: now, came: false })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    /// A node by its octants from the root down.
    fn key(octants: &[u8]) -> NodeKey {
        let below = |key: NodeKey, &octant: &u8| key.child(octant).expect("few levels");
        octants.iter().fold(NodeKey::ROOT, below)
    }

    fn node(cloud: usize, octants: &[u8], is_there: bool) -> WantedNode {
        WantedNode { cloud, key: key(octants), bytes: 1, is_there }
    }

    fn page(cloud: usize, octants: &[u8]) -> MissingPage {
        MissingPage { cloud, below: Some(key(octants)) }
    }

    /// Plans by the second.
    struct Visit {
        begin: Instant,
        awaited: Awaited,
    }

    impl Visit {
        fn new() -> Self {
            Self { begin: Instant::now(), awaited: Awaited::default() }
        }

        fn at(&self, second: u64) -> Instant {
            self.begin + Duration::from_secs(second)
        }

        /// A plan for the view due at `due`. Returns the waits that it ends: since when, whether it came.
        fn note(
            &mut self,
            (due, now): (u64, u64),
            wanted: &[WantedNode],
            missing: &[MissingPage],
        ) -> Vec<(u64, bool)> {
            let (due, now, mut waits) = (self.at(due), self.at(now), Vec::new());
            self.awaited.note(due, wanted, missing.iter().copied(), now, &mut waits);
            assert!(waits.iter().all(|wait| wait.end == now));
            waits.iter().map(|wait| ((wait.due - self.begin).as_secs(), wait.came)).collect()
        }
    }

    #[test]
    fn a_node_that_is_known_waits_since_its_own_view_whatever_pages_are_missing() {
        let mut visit = Visit::new();
        visit.note((0, 1), &[node(0, &[0], true)], &[page(0, &[0])]);
        // The page's own node, its sister, and a node of another cloud in the same place.
        let now_wanted = |is_there| [&[0][..], &[1]].map(|place| node(0, place, is_there));
        let beside = |is_there| node(1, &[0, 3], is_there);
        let all = |is_there| [now_wanted(is_there).as_slice(), &[beside(is_there)]].concat();
        assert!(visit.note((5, 6), &all(false), &[page(0, &[0])]).is_empty());
        let ended = visit.note((5, 7), &all(true), &[page(0, &[0])]);
        assert_eq!(ended, [(5, true); 3]);
    }

    #[test]
    fn a_node_that_a_page_tells_of_waits_since_the_page_did_through_views_and_pages() {
        let mut visit = Visit::new();
        visit.note((2, 3), &[], &[page(0, &[0])]);
        // Other views want it, too; it is still the same page.
        visit.note((4, 4), &[], &[page(0, &[0])]);
        // It comes together with another view, and tells of a node and of a page below that is missing, too.
        visit.note((6, 7), &[node(0, &[0, 1], false)], &[page(0, &[0, 1])]);
        assert_eq!(visit.note((6, 8), &[node(0, &[0, 1], true)], &[page(0, &[0, 1])]), [(2, true)]);
        visit.note((9, 9), &[node(0, &[0, 1, 5, 5], false)], &[]);
        assert_eq!(visit.note((9, 10), &[node(0, &[0, 1, 5, 5], true)], &[]), [(2, true)]);
        // What is wanted later there is known: its view is what it waits since.
        visit.note((11, 11), &[node(0, &[0, 1, 5, 6], false)], &[]);
        assert_eq!(visit.note((11, 12), &[node(0, &[0, 1, 5, 6], true)], &[]), [(11, true)]);
    }

    #[test]
    fn a_page_that_is_wanted_again_is_due_again() {
        let mut visit = Visit::new();
        visit.note((0, 0), &[], &[page(0, &[0])]);
        visit.note((1, 1), &[], &[]);
        visit.note((2, 2), &[], &[page(0, &[0])]);
        visit.note((2, 3), &[node(0, &[0, 1], false)], &[]);
        assert_eq!(visit.note((2, 4), &[node(0, &[0, 1], true)], &[]), [(2, true)]);
    }

    #[test]
    fn nodes_of_a_cloud_that_is_not_open_wait_since_the_first_view_and_no_others_do() {
        let unopened = MissingPage { cloud: 0, below: None };
        let mut visit = Visit::new();
        visit.note((0, 0), &[], &[unopened]);
        visit.note((3, 3), &[node(1, &[], false)], &[unopened]);
        visit.note((3, 4), &[node(0, &[], false), node(1, &[], false)], &[page(0, &[2])]);
        let both = [node(0, &[], true), node(1, &[], true)];
        assert_eq!(visit.note((3, 5), &both, &[page(0, &[2])]), [(0, true), (3, true)]);
        // The page below was made known by the first.
        visit.note((3, 6), &[node(0, &[2, 2], false)], &[]);
        assert_eq!(visit.note((3, 7), &[node(0, &[2, 2], true)], &[]), [(0, true)]);
    }

    #[test]
    fn what_is_left_behind_or_never_comes_is_given_up() {
        let mut visit = Visit::new();
        visit.note((0, 0), &[node(0, &[1], false), node(0, &[2], false)], &[]);
        assert_eq!(visit.note((4, 5), &[node(0, &[2], false)], &[]), [(0, false)]);
        // Wanted again, it is due again.
        visit.note((6, 6), &[node(0, &[1], false), node(0, &[2], false)], &[page(0, &[3])]);
        let (begin, end) = (visit.begin, visit.at(9));
        let mut left: Vec<_> = visit.awaited.give_up(end).collect();
        left.sort_by_key(|wait| wait.due);
        let seconds = left.iter().map(|wait| ((wait.due - begin).as_secs(), wait.came));
        assert_eq!(seconds.collect::<Vec<_>>(), [(0, false), (6, false), (6, false)]);
    }
}
