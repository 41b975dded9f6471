//! What all clients of a run write down together.

use std::{
    sync::{Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use hdrhistogram::Histogram;
use tokio::time::Instant;

use super::waits::Waits;
use crate::engine::Totals;

/// Problems that are told word by word.
const MOST_PROBLEMS: usize = 20;

/// Digits of the waits that are told one by one, and of those of which there are many.
const DIGITS: u8 = 3;
const DIGITS_OVER_TIME: u8 = 1;

/// The book.
#[derive(Debug)]
pub struct Ledger {
    start: Instant,
    interval: Duration,
    entries: Mutex<Entries>,
}

/// Everything that is written down.
#[derive(Debug, Clone)]
pub struct Entries {
    /// From when a node was due to when it was there.
    pub nodes: Waits,
    /// The same by when it was due, one for each stretch of time.
    pub nodes_over_time: Vec<Waits>,
    /// After a cold start.
    pub cold: Arrivals,
    /// After a jump of the camera.
    pub jumps: Arrivals,
    /// Microseconds that views were set after they were due: the load generator's own lateness.
    pub late_us: Histogram<u64>,
    /// Visits that were begun, that went on to the path's end, and that broke down.
    pub begun: u64,
    /// See [`begun`](Self::begun).
    pub complete: u64,
    /// See [`begun`](Self::begun).
    pub failed: u64,
    /// Bytes that were of use: indices, and payloads of nodes that were drawn, each once a visit.
    pub used_bytes: u64,
    /// The engines' own figures.
    pub totals: Totals,
    /// What went wrong, in words; the first few.
    pub problems: Vec<String>,
}

/// How pictures came in.
#[derive(Debug, Clone)]
pub struct Arrivals {
    /// Until anything was drawn.
    pub first: Waits,
    /// Until all was there.
    pub settled: Waits,
    /// Bytes and requests until then, summed.
    pub bytes: u64,
    /// See [`bytes`](Self::bytes).
    pub requests: u64,
}

/// How one picture came in.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// Whether there was nothing before.
    pub is_cold: bool,
    /// When something was drawn.
    pub first: Option<Duration>,
    /// When all was there, and the bytes and requests it took.
    pub settled: Option<(Duration, u64, u64)>,
    /// How long it was waited for at most.
    pub watched: Duration,
}

/// A node's wait.
#[derive(Debug, Clone, Copy)]
pub struct NodeWait {
    /// When it was due.
    pub due: Instant,
    /// When it came, or was given up.
    pub end: Instant,
    /// Whether it came.
    pub came: bool,
}

impl Default for Arrivals {
    fn default() -> Self {
        let (first, settled) = (Waits::new(DIGITS), Waits::new(DIGITS));
        Self { first, settled, bytes: 0, requests: 0 }
    }
}

impl Ledger {
    /// An empty book of what happens from `start` on, in stretches of `interval`, over `seconds`.
    #[must_use]
    pub fn new(start: Instant, interval: Duration, intervals: usize) -> Self {
        let entries = Entries {
            nodes: Waits::new(DIGITS),
            nodes_over_time: vec![Waits::new(DIGITS_OVER_TIME); intervals.max(1)],
            cold: Arrivals::default(),
            jumps: Arrivals::default(),
            late_us: Histogram::new_with_max(3_600_000_000, DIGITS)
                .expect("an hour in three digits"),
            begun: 0,
            complete: 0,
            failed: 0,
            used_bytes: 0,
            totals: Totals::default(),
            problems: Vec::new(),
        };
        Self { start, interval, entries: Mutex::new(entries) }
    }

    /// Writes down nodes' waits.
    pub fn add_nodes(&self, waits: &[NodeWait]) {
        if waits.is_empty() {
            return;
        }
        let mut entries = self.entries();
        for wait in waits {
            let took = wait.end.saturating_duration_since(wait.due);
            let since_start = wait.due.saturating_duration_since(self.start);
            let at = since_start.as_nanos() / self.interval.as_nanos().max(1);
            let last = entries.nodes_over_time.len() - 1;
            let at = usize::try_from(at).unwrap_or(last).min(last);
            let Entries { nodes, nodes_over_time, .. } = &mut *entries;
            for waits in [nodes, &mut nodes_over_time[at]] {
                if wait.came {
                    waits.came(took);
                } else {
                    waits.gave_up(took);
                }
            }
        }
    }

    /// Writes down how a picture came in.
    pub fn add_arrival(&self, arrival: Arrival) {
        let mut entries = self.entries();
        let arrivals = if arrival.is_cold { &mut entries.cold } else { &mut entries.jumps };
        match arrival.first {
            Some(wait) => arrivals.first.came(wait),
            None => arrivals.first.gave_up(arrival.watched),
        }
        match arrival.settled {
            Some((wait, bytes, requests)) => {
                arrivals.settled.came(wait);
                arrivals.bytes += bytes;
                arrivals.requests += requests;
            }
            None => arrivals.settled.gave_up(arrival.watched),
        }
    }

    /// Writes down how late a view was set.
    pub fn add_late(&self, late: Duration) {
        let microseconds = u64::try_from(late.as_micros()).unwrap_or(u64::MAX);
        self.entries().late_us.saturating_record(microseconds);
    }

    /// Writes down anything else.
    pub fn add(&self, add: impl FnOnce(&mut Entries)) {
        add(&mut self.entries());
    }

    /// Everything so far.
    #[must_use]
    pub fn read(&self) -> Entries {
        self.entries().clone()
    }

    /// Looks at what there is so far.
    pub fn look<T>(&self, look: impl FnOnce(&Entries) -> T) -> T {
        look(&self.entries())
    }

    /// Entries are whole whoever panics.
    fn entries(&self) -> MutexGuard<'_, Entries> {
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entries {
    /// Notes what went wrong, if it is new.
    pub fn add_problem(&mut self, problem: String) {
        if self.problems.len() < MOST_PROBLEMS && !self.problems.contains(&problem) {
            self.problems.push(problem);
        }
    }

    /// Adds the figures of an engine that has ended.
    pub fn add_totals(&mut self, totals: Totals) {
        let sum = &mut self.totals;
        sum.requests += totals.requests;
        sum.bytes += totals.bytes;
        sum.retries += totals.retries;
        sum.cancelled += totals.cancelled;
        sum.damaged += totals.damaged;
        sum.page_bytes += totals.page_bytes;
        sum.decoded_nodes += totals.decoded_nodes;
        sum.decode_ms += totals.decode_ms;
        sum.cache_hits += totals.cache_hits;
        sum.evictions += totals.evictions;
    }
}
