//! What the engine's threads have in common.

use std::sync::{Mutex, PoisonError};

use super::{
    board::Board,
    inbox::{LoaderInbox, TraversalInbox},
    stats::{Clock, Counters, EngineStats},
};

/// Letter boxes, the board and the figures. No two locks are ever held at once, save for the clock
/// inside the traversal's inbox.
#[derive(Debug)]
pub(super) struct Shared {
    pub traversal: TraversalInbox,
    pub loader: LoaderInbox,
    pub board: Board,
    pub counters: Counters,
    clock: Mutex<Clock>,
}

impl Shared {
    pub fn new(sources: impl Iterator<Item = String>) -> Self {
        Self {
            traversal: TraversalInbox::default(),
            loader: LoaderInbox::default(),
            board: Board::new(sources),
            counters: Counters::default(),
            clock: Mutex::new(Clock::new()),
        }
    }

    /// The view has changed.
    pub fn start_phase(&self, generation: u64) {
        let totals = self.counters.totals();
        self.clock(|clock| clock.start_view(generation, totals));
    }

    /// Figures so far.
    pub fn stats(&self) -> EngineStats {
        let counters = &self.counters;
        let totals = counters.totals();
        let (since_start, since_view) = self.clock(|clock| clock.phases(totals));
        EngineStats {
            since_start,
            since_view,
            queued: counters.queued.get(),
            in_flight: counters.in_flight.get(),
            pinned_bytes: counters.pinned_bytes.get(),
            cached_bytes: counters.cached_bytes.get(),
            problems: self.board.read(|news| news.problems.clone()),
        }
    }

    pub fn clock<T>(&self, look: impl FnOnce(&mut Clock) -> T) -> T {
        look(&mut self.clock.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Tells the board when a thread ends, by whatever way.
pub(super) struct EndOfThread(pub std::sync::Arc<Shared>);

impl Drop for EndOfThread {
    fn drop(&mut self) {
        self.0.board.post(|news| news.stopped = true);
    }
}
