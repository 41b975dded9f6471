//! What the engine's threads have in common.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicUsize, Ordering},
};

use super::{
    board::{Board, CloudStatus},
    config::EngineConfig,
    event::Event,
    inbox::{Change, LoaderInbox, TraversalInbox},
    settings::Settings,
    stats::{Clock, Counters, EngineStats},
};
use crate::source::Source;

/// Letter boxes, the board and the figures. No two locks are ever held at once, save for the clock
/// inside the traversal's inbox.
#[derive(Debug)]
pub(super) struct Shared {
    pub traversal: TraversalInbox,
    pub loader: LoaderInbox,
    pub board: Board,
    pub counters: Counters,
    clock: Mutex<Clock>,
    /// Indices of clouds given out so far.
    clouds: AtomicUsize,
}

impl Shared {
    pub fn new(config: &EngineConfig, sources: Vec<Source>) -> Self {
        let shared = Self {
            traversal: TraversalInbox::new(Settings::new(config)),
            loader: LoaderInbox::new(),
            board: Board::default(),
            counters: Counters::default(),
            clock: Mutex::new(Clock::new()),
            clouds: AtomicUsize::new(0),
        };
        sources.into_iter().for_each(|source| _ = shared.add(source));
        shared
    }

    /// An index that no cloud has had.
    pub fn next_cloud(&self) -> usize {
        self.clouds.fetch_add(1, Ordering::Relaxed)
    }

    /// Adds a cloud; returns its number.
    pub fn add(&self, source: Source) -> usize {
        let status = CloudStatus { source: source.describe(), ..CloudStatus::default() };
        let number = self.board.post(|news| {
            news.clouds.push(status);
            news.clouds.len() - 1
        });
        let cloud = self.next_cloud();
        // In this order: what the loader tells of a cloud comes after the cloud.
        self.change_clouds(Event::Added { cloud, number });
        self.loader.change(Change::Add { cloud, number, source });
        number
    }

    /// Removes the cloud of that number.
    pub fn remove(&self, number: usize) {
        self.board.post(|news| {
            news.cloud(number, |cloud| {
                let source = std::mem::take(&mut cloud.source);
                *cloud = CloudStatus { source, removed: true, ..CloudStatus::default() };
            });
        });
        self.change_clouds(Event::Removed { number });
        self.loader.change(Change::Remove { number });
    }

    /// Tells the last trouble with the cloud of that number, or that it is over.
    pub fn trouble(&self, number: Option<usize>, trouble: Option<String>) {
        let Some(number) = number else { return };
        self.board.post(|news| news.cloud(number, |cloud| cloud.trouble = trouble));
    }

    fn change_clouds(&self, event: Event) {
        self.traversal.change_clouds(event, |generation| self.start_phase(generation));
    }

    /// Changes the settings; returns the generation.
    pub fn set(&self, change: impl FnOnce(&mut Settings)) -> u64 {
        self.traversal.set(change, |generation| self.start_phase(generation))
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
