//! Counts what the requests of many sources come to, over time.

use std::{
    collections::BTreeMap,
    sync::{
        Mutex, MutexGuard, PoisonError,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use hdrhistogram::Histogram;
use tokio::time::Instant;

use super::Fault;

/// Significant digits of the times.
const DIGITS: u8 = 3;

/// The longest time that is told apart.
const LONGEST: Duration = Duration::from_secs(3600);

/// Counts requests. Shared by all sources whose requests it is to count.
#[derive(Debug)]
pub struct Meter {
    start: Instant,
    interval: Duration,
    most_requests: u64,
    requests: AtomicU64,
    bytes: AtomicU64,
    in_flight: AtomicU64,
    state: Mutex<Counted>,
}

/// What was counted.
#[derive(Debug, Clone)]
pub struct Counted {
    /// Requests that were answered to the end.
    pub complete: u64,
    /// Requests broken off by their sender.
    pub broken_off: u64,
    /// Failures by kind.
    pub faults: BTreeMap<Fault, u64>,
    /// Microseconds from sending a request to the head of its answer, of those that were answered.
    pub head_us: Histogram<u64>,
    /// Microseconds from sending a request to the last byte of its answer, of those answered to the
    /// end.
    pub whole_us: Histogram<u64>,
    /// One for each stretch of time.
    pub intervals: Vec<Traffic>,
}

/// What happened in a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Traffic {
    /// Requests sent.
    pub requests: u64,
    /// Bytes of bodies received.
    pub bytes: u64,
    /// Requests that failed.
    pub faults: u64,
}

impl Meter {
    /// A meter whose time begins at `start` and is divided into stretches of `interval`. Only so many
    /// requests may be sent.
    ///
    /// # Panics
    /// Where `interval` is 0.
    #[must_use]
    pub fn new(start: Instant, interval: Duration, most_requests: u64) -> Self {
        assert!(!interval.is_zero(), "time is divided into stretches of some length");
        let counted = Counted {
            complete: 0,
            broken_off: 0,
            faults: BTreeMap::new(),
            head_us: new_histogram(),
            whole_us: new_histogram(),
            intervals: Vec::new(),
        };
        Self {
            start,
            interval,
            most_requests,
            requests: AtomicU64::new(0),
            bytes: AtomicU64::new(0),
            in_flight: AtomicU64::new(0),
            state: Mutex::new(counted),
        }
    }

    /// Requests sent.
    #[must_use]
    pub fn requests(&self) -> u64 {
        self.requests.load(Ordering::Relaxed).min(self.most_requests)
    }

    /// Bytes of bodies received.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Requests on their way.
    #[must_use]
    pub fn in_flight(&self) -> u64 {
        self.in_flight.load(Ordering::Relaxed)
    }

    /// Whether a request was refused because as many as may be sent had been.
    #[must_use]
    pub fn is_spent(&self) -> bool {
        self.requests.load(Ordering::Relaxed) > self.most_requests
    }

    /// Notes a failure that is not of a request itself.
    pub fn fail(&self, fault: Fault) {
        self.count(|state, at| state.fail(fault, at));
    }

    /// Requests that failed.
    #[must_use]
    pub fn faults(&self) -> u64 {
        self.state().all_faults()
    }

    /// Everything so far.
    #[must_use]
    pub fn counted(&self) -> Counted {
        self.state().clone()
    }

    /// Counts a request as sent; `None` where no more may be.
    pub(super) fn depart(&self) -> Option<Instant> {
        if self.requests.fetch_add(1, Ordering::Relaxed) >= self.most_requests {
            return None;
        }
        self.in_flight.fetch_add(1, Ordering::Relaxed);
        self.count(|state, at| state.traffic(at).requests += 1);
        Some(Instant::now())
    }

    pub(super) fn answered(&self, sent: Instant) {
        record(&mut self.state().head_us, sent.elapsed());
    }

    pub(super) fn received(&self, bytes: u64) {
        self.bytes.fetch_add(bytes, Ordering::Relaxed);
        self.count(|state, at| state.traffic(at).bytes += bytes);
    }

    /// A request has ended: with an error, well, or (`None`) by its sender's wish.
    pub(super) fn arrive(&self, sent: Instant, outcome: Option<Result<(), Fault>>) {
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        self.count(|state, at| match outcome {
            None => state.broken_off += 1,
            Some(Ok(())) => {
                state.complete += 1;
                record(&mut state.whole_us, sent.elapsed());
            }
            Some(Err(fault)) => state.fail(fault, at),
        });
    }

    fn count(&self, count: impl FnOnce(&mut Counted, usize)) {
        let at = self.start.elapsed().as_nanos() / self.interval.as_nanos();
        count(&mut self.state(), usize::try_from(at).unwrap_or(usize::MAX));
    }

    /// Counts stay whole whoever panics.
    fn state(&self) -> MutexGuard<'_, Counted> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Counted {
    /// Failures of all kinds.
    #[must_use]
    pub fn all_faults(&self) -> u64 {
        self.faults.values().sum()
    }

    fn fail(&mut self, fault: Fault, at: usize) {
        *self.faults.entry(fault).or_default() += 1;
        self.traffic(at).faults += 1;
    }

    fn traffic(&mut self, at: usize) -> &mut Traffic {
        // What comes after the time that can be told counts in its last stretch.
        let at = at.min(MOST_INTERVALS - 1);
        if self.intervals.len() <= at {
            self.intervals.resize(at + 1, Traffic::default());
        }
        &mut self.intervals[at]
    }
}

/// Stretches of time that are told apart.
const MOST_INTERVALS: usize = 1 << 16;

/// Of microseconds, up to the longest time.
fn new_histogram() -> Histogram<u64> {
    let longest = u64::try_from(LONGEST.as_micros()).unwrap_or(u64::MAX);
    Histogram::new_with_max(longest, DIGITS).expect("an hour in three digits")
}

fn record(histogram: &mut Histogram<u64>, time: Duration) {
    histogram.saturating_record(u64::try_from(time.as_micros()).unwrap_or(u64::MAX));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test(start_paused = true)]
    async fn requests_are_counted_by_their_end_and_their_time() {
        let meter = Meter::new(Instant::now(), Duration::from_secs(1), 3);
        let first = meter.depart().expect("one of three");
        let second = meter.depart().expect("two of three");
        assert_eq!(meter.in_flight(), 2);
        tokio::time::advance(Duration::from_millis(1500)).await;
        meter.answered(first);
        meter.received(700);
        meter.arrive(first, Some(Ok(())));
        meter.arrive(second, Some(Err(Fault::Status(503))));
        let third = meter.depart().expect("three of three");
        meter.arrive(third, None);
        assert!(!meter.is_spent());
        assert!(meter.depart().is_none() && meter.is_spent(), "no fourth");

        let counted = meter.counted();
        assert_eq!((meter.requests(), meter.bytes(), meter.in_flight()), (3, 700, 0));
        assert_eq!((counted.complete, counted.broken_off, counted.all_faults()), (1, 1, 1));
        assert_eq!(counted.faults[&Fault::Status(503)], 1);
        assert!((1_499_000..1_502_000).contains(&counted.whole_us.max()), "{:?}", counted.whole_us);
        let traffic = |requests, bytes, faults| Traffic { requests, bytes, faults };
        assert_eq!(counted.intervals, [traffic(2, 0, 0), traffic(1, 700, 1)]);
    }
}
