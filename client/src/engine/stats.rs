//! Figures about the engine's work.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use serde::Serialize;
// Its clock can be a simulated one.
use tokio::time::Instant;

use super::plan::FramePlan;

/// A number that threads add to.
#[derive(Debug, Default)]
pub(super) struct Counter(AtomicU64);

impl Counter {
    pub fn add(&self, amount: u64) {
        self.0.fetch_add(amount, Ordering::Relaxed);
    }

    pub fn set(&self, value: u64) {
        self.0.store(value, Ordering::Relaxed);
    }

    pub fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// All counters; each has one writer at a time.
#[derive(Debug, Default)]
pub(super) struct Counters {
    pub requests: Counter,
    pub bytes: Counter,
    pub useful_bytes: Counter,
    pub gap_bytes: Counter,
    pub retries: Counter,
    pub cancelled: Counter,
    pub damaged: Counter,
    pub page_bytes: Counter,
    pub decoded_nodes: Counter,
    pub decode_nanos: Counter,
    pub plans: Counter,
    pub plan_nanos: Counter,
    pub cache_hits: Counter,
    pub evictions: Counter,
    pub queued: Counter,
    pub in_flight: Counter,
    pub pinned_bytes: Counter,
    pub cached_bytes: Counter,
}

impl Counters {
    pub fn totals(&self) -> Totals {
        Totals {
            requests: self.requests.get(),
            bytes: self.bytes.get(),
            useful_bytes: self.useful_bytes.get(),
            gap_bytes: self.gap_bytes.get(),
            retries: self.retries.get(),
            cancelled: self.cancelled.get(),
            damaged: self.damaged.get(),
            page_bytes: self.page_bytes.get(),
            decoded_nodes: self.decoded_nodes.get(),
            decode_ms: Duration::from_nanos(self.decode_nanos.get()).as_secs_f64() * 1e3,
            plans: self.plans.get(),
            plan_ms: Duration::from_nanos(self.plan_nanos.get()).as_secs_f64() * 1e3,
            cache_hits: self.cache_hits.get(),
            evictions: self.evictions.get(),
        }
    }
}

/// Work done in a span of time.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Totals {
    /// Requests sent, repeated ones included.
    pub requests: u64,
    /// Bytes of bodies received, including those that were of no use.
    pub bytes: u64,
    /// Of these, the bytes of nodes, hierarchy pages and indices that were wanted when they had come.
    pub useful_bytes: u64,
    /// Of these, the bytes between pieces that were asked for together.
    pub gap_bytes: u64,
    /// Requests that failed and whose bytes had to be asked for again.
    pub retries: u64,
    /// Requests broken off because the view had moved on.
    pub cancelled: u64,
    /// Pieces that arrived but could not be decoded.
    pub damaged: u64,
    /// Bytes of hierarchy pages that arrived, save for the roots'.
    pub page_bytes: u64,
    /// Payloads and pages decoded.
    pub decoded_nodes: u64,
    /// Milliseconds spent decoding, summed over threads.
    pub decode_ms: f64,
    /// Plans made.
    pub plans: u64,
    /// Milliseconds spent making them.
    pub plan_ms: f64,
    /// Nodes that a view needed and that were still in the cache.
    pub cache_hits: u64,
    /// Nodes dropped from the cache.
    pub evictions: u64,
}

impl Totals {
    /// Bytes that the view had left when they came, or that came of requests that were broken off or
    /// failed.
    #[must_use]
    pub const fn wasted_bytes(&self) -> u64 {
        self.bytes.saturating_sub(self.useful_bytes + self.gap_bytes)
    }

    fn since(self, earlier: Self) -> Self {
        Self {
            requests: self.requests - earlier.requests,
            bytes: self.bytes - earlier.bytes,
            useful_bytes: self.useful_bytes - earlier.useful_bytes,
            gap_bytes: self.gap_bytes - earlier.gap_bytes,
            retries: self.retries - earlier.retries,
            cancelled: self.cancelled - earlier.cancelled,
            damaged: self.damaged - earlier.damaged,
            page_bytes: self.page_bytes - earlier.page_bytes,
            decoded_nodes: self.decoded_nodes - earlier.decoded_nodes,
            decode_ms: self.decode_ms - earlier.decode_ms,
            plans: self.plans - earlier.plans,
            plan_ms: self.plan_ms - earlier.plan_ms,
            cache_hits: self.cache_hits - earlier.cache_hits,
            evictions: self.evictions - earlier.evictions,
        }
    }
}

/// Work and times since a moment.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Phase {
    /// Work done.
    #[serde(flatten)]
    pub totals: Totals,
    /// Milliseconds until the first plan that had points.
    pub first_points_ms: Option<f64>,
    /// Milliseconds until the first settled plan.
    pub settled_ms: Option<f64>,
}

/// Figures about an engine.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct EngineStats {
    /// Since the engine was started.
    pub since_start: Phase,
    /// Since the view was last changed.
    pub since_view: Phase,
    /// Pieces that wait for a request.
    pub queued: u64,
    /// Requests in flight.
    pub in_flight: u64,
    /// Bytes of decoded nodes that the view needs.
    pub pinned_bytes: u64,
    /// Bytes of decoded nodes that are kept besides.
    pub cached_bytes: u64,
    /// What has failed for good, one line each; the first hundred.
    pub problems: Vec<String>,
}

/// When things happened.
#[derive(Debug)]
pub(super) struct Clock {
    start: Moment,
    view: Moment,
    /// The view that `view` is about.
    view_generation: u64,
}

#[derive(Debug)]
struct Moment {
    begin: Instant,
    before: Totals,
    first_points_ms: Option<f64>,
    settled_ms: Option<f64>,
}

impl Moment {
    fn new(before: Totals) -> Self {
        Self { begin: Instant::now(), before, first_points_ms: None, settled_ms: None }
    }

    fn note(&mut self, plan: &FramePlan) {
        let now = self.begin.elapsed().as_secs_f64() * 1e3;
        if plan.points > 0 {
            self.first_points_ms.get_or_insert(now);
        }
        if plan.settled {
            self.settled_ms.get_or_insert(now);
        }
    }

    fn phase(&self, now: Totals) -> Phase {
        Phase {
            totals: now.since(self.before),
            first_points_ms: self.first_points_ms,
            settled_ms: self.settled_ms,
        }
    }
}

impl Clock {
    pub fn new() -> Self {
        let moment = || Moment::new(Totals::default());
        Self { start: moment(), view: moment(), view_generation: 0 }
    }

    /// The view has changed.
    pub fn start_view(&mut self, generation: u64, totals: Totals) {
        self.view = Moment::new(totals);
        self.view_generation = generation;
    }

    /// A plan is published.
    pub fn note(&mut self, plan: &FramePlan) {
        self.start.note(plan);
        if plan.view_generation == self.view_generation {
            self.view.note(plan);
        }
    }

    /// Since the start, and since the view.
    pub fn phases(&self, totals: Totals) -> (Phase, Phase) {
        (self.start.phase(totals), self.view.phase(totals))
    }
}
