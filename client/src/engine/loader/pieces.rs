//! The states of the pieces that the loader has to do with.
//!
//! A wanted piece without a state is queued. A delivered piece keeps its state until the traversal
//! says that it has read it: a demand that was written before would ask for it again.

use std::collections::{HashMap, HashSet};

use tokio::time::Instant;

use super::{super::piece::PieceId, flight::FlightId};

/// Broken requests after which a piece gets requests of its own, so that a range which a host
/// cannot read does not keep its neighbours.
const ALONE_AFTER: u32 = 3;

/// How a piece is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PieceState {
    /// Its bytes are on the way.
    Loading { flight: FlightId },
    /// Its bytes are here. `bytes` is its size once decoded.
    Decoding { bytes: u64 },
    /// The traversal's event number `event` is about it.
    Delivered { event: u64, bytes: u64 },
    /// Not to be asked for again before then.
    Failed { until: Instant },
}

/// All pieces that are not unknown or queued.
#[derive(Debug, Default)]
pub struct Pieces {
    states: HashMap<PieceId, PieceState>,
    failures: HashMap<PieceId, Failures>,
}

/// What has happened to a piece since it was last delivered or unwanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Failures {
    /// Requests that ended just where this piece should have come.
    broken: u32,
    /// Arrivals that could not be decoded.
    damaged: u32,
}

impl Pieces {
    pub fn get(&self, id: PieceId) -> Option<PieceState> {
        self.states.get(&id).copied()
    }

    pub fn set(&mut self, id: PieceId, state: PieceState) {
        self.states.insert(id, state);
    }

    /// Back to queued or unknown.
    pub fn clear(&mut self, id: PieceId) {
        self.states.remove(&id);
    }

    /// Whether the piece may be asked for now.
    pub fn is_free(&self, id: PieceId, now: Instant) -> bool {
        match self.states.get(&id) {
            None => true,
            Some(PieceState::Failed { until }) => *until <= now,
            Some(_) => false,
        }
    }

    /// Whether the piece is still on its way in that flight.
    pub fn is_loading(&self, id: PieceId, in_flight: FlightId) -> bool {
        self.get(id) == Some(PieceState::Loading { flight: in_flight })
    }

    /// Counts a request that broke off at the piece; returns how many there were.
    pub fn count_broken(&mut self, id: PieceId) -> u32 {
        let failures = self.failures.entry(id).or_default();
        failures.broken = failures.broken.saturating_add(1);
        failures.broken
    }

    /// Counts an arrival that could not be decoded; returns how many there were.
    pub fn count_damaged(&mut self, id: PieceId) -> u32 {
        let failures = self.failures.entry(id).or_default();
        failures.damaged = failures.damaged.saturating_add(1);
        failures.damaged
    }

    /// Notes that the traversal's event number `event` is about the piece.
    pub fn deliver(&mut self, id: PieceId, event: u64) {
        self.failures.remove(&id);
        let bytes = match self.get(id) {
            Some(PieceState::Decoding { bytes }) => bytes,
            _ => 0,
        };
        self.set(id, PieceState::Delivered { event, bytes });
    }

    pub fn needs_own_request(&self, id: PieceId) -> bool {
        self.failures.get(&id).is_some_and(|failures| failures.broken >= ALONE_AFTER)
    }

    /// Forgets all of a cloud.
    pub fn forget(&mut self, cloud: usize) {
        self.failures.retain(|id, _| id.node.cloud != cloud);
        self.states.retain(|id, _| id.node.cloud != cloud);
    }

    /// A new demand: forgets what the traversal has read and failures of what is not wanted.
    pub fn update(&mut self, wanted: &HashSet<PieceId>, seen: u64) {
        self.failures.retain(|id, _| wanted.contains(id));
        self.states.retain(|id, state| match state {
            PieceState::Delivered { event, .. } => *event > seen,
            PieceState::Failed { .. } => wanted.contains(id),
            PieceState::Loading { .. } | PieceState::Decoding { .. } => true,
        });
    }

    /// Decoded bytes that the traversal has not read yet.
    pub fn backlog_bytes(&self) -> u64 {
        let bytes = self.states.values().map(|state| match state {
            PieceState::Decoding { bytes } | PieceState::Delivered { bytes, .. } => *bytes,
            _ => 0,
        });
        bytes.sum()
    }

    /// When a failed piece may be asked for again.
    pub fn retry_at(&self, id: PieceId) -> Option<Instant> {
        match self.get(id)? {
            PieceState::Failed { until } => Some(until),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use lodestream_protocol::NodeKey;

    use super::*;
    use crate::engine::piece::{NodeId, Part};

    fn id(octant: u8) -> PieceId {
        let key = NodeKey::ROOT.child(octant).expect("below the root");
        PieceId { node: NodeId { cloud: 0, key }, part: Part::Group(0) }
    }

    #[test]
    fn a_delivered_piece_is_not_free_before_the_traversal_has_read_it() {
        let (mut pieces, now) = (Pieces::default(), Instant::now());
        let wanted = HashSet::from([id(0)]);
        pieces.set(id(0), PieceState::Decoding { bytes: 10 });
        pieces.deliver(id(0), 7);
        // This demand was written before the traversal read event 7: it still wants the piece.
        pieces.update(&wanted, 6);
        assert!(!pieces.is_free(id(0), now));
        assert_eq!(pieces.backlog_bytes(), 10);
        pieces.update(&wanted, 7);
        assert!(pieces.is_free(id(0), now), "wanted after it was read: evicted meanwhile");
        assert_eq!(pieces.backlog_bytes(), 0);
    }

    #[test]
    fn a_failed_piece_waits_and_is_forgotten_once_unwanted() {
        let (mut pieces, now) = (Pieces::default(), Instant::now());
        let until = now + Duration::from_secs(1);
        pieces.set(id(0), PieceState::Failed { until });
        assert!(!pieces.is_free(id(0), now));
        assert!(pieces.is_free(id(0), until));
        assert_eq!(pieces.retry_at(id(0)), Some(until));
        (0..ALONE_AFTER).for_each(|_| _ = pieces.count_broken(id(0)));
        assert!(pieces.needs_own_request(id(0)));
        pieces.update(&HashSet::new(), 0);
        assert!(pieces.is_free(id(0), now) && !pieces.needs_own_request(id(0)));
    }

    #[test]
    fn broken_requests_and_damage_are_counted_apart() {
        let mut pieces = Pieces::default();
        (0..5).for_each(|_| _ = pieces.count_broken(id(1)));
        assert_eq!(pieces.count_damaged(id(1)), 1);
    }

    #[test]
    fn what_is_on_its_way_stays_when_it_is_no_longer_wanted() {
        let mut pieces = Pieces::default();
        pieces.set(id(0), PieceState::Loading { flight: 3 });
        pieces.set(id(1), PieceState::Decoding { bytes: 1 });
        pieces.update(&HashSet::new(), 99);
        assert!(pieces.is_loading(id(0), 3) && !pieces.is_loading(id(0), 4));
        assert!(!pieces.is_free(id(1), Instant::now()));
    }
}
