//! Where short file-system calls run: in place while they are quick, else on the blocking pool.
//!
//! Opening a file whose directory entry is cached takes microseconds; a hop to the blocking pool
//! and back costs several times as much, on every request. On a network file system the same call
//! may take milliseconds, during which a runtime thread would serve nobody else. So calls run in
//! place until one was slow, and for a while after that on the pool.

use std::{
    sync::atomic::{AtomicU64, Ordering},
    time::{Duration, Instant},
};

/// A call longer than this counts as slow.
const PATIENCE: Duration = Duration::from_millis(1);
/// How long a slow call sends its followers to the pool.
const CAUTION: Duration = Duration::from_secs(1);

/// Decides by the time that earlier calls took.
#[derive(Debug)]
pub(crate) struct Offload {
    start: Instant,
    /// Milliseconds after `start`.
    cautious_until_ms: AtomicU64,
    patience: Duration,
}

impl Offload {
    pub(crate) fn new() -> Self {
        Self::with_patience(PATIENCE)
    }

    fn with_patience(patience: Duration) -> Self {
        Self { start: Instant::now(), cautious_until_ms: AtomicU64::new(0), patience }
    }

    /// Runs `work`, which must not panic.
    pub(crate) async fn run<T, F>(&self, work: F) -> T
    where
        T: Send + 'static,
        F: FnOnce() -> T + Send + 'static,
    {
        let begin = self.start.elapsed();
        let is_cautious = millis(begin) < self.cautious_until_ms.load(Ordering::Relaxed);
        let result = if is_cautious {
            let outcome = tokio::task::spawn_blocking(work).await;
            outcome.unwrap_or_else(|e| std::panic::resume_unwind(e.into_panic()))
        } else {
            work()
        };
        let end = self.start.elapsed();
        if end.saturating_sub(begin) > self.patience {
            self.cautious_until_ms.fetch_max(millis(end + CAUTION), Ordering::Relaxed);
        }
        result
    }
}

fn millis(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    #[tokio::test]
    async fn quick_calls_stay_on_the_thread() {
        let offload = Offload::with_patience(Duration::MAX);
        for _ in 0..3 {
            assert_eq!(offload.run(|| thread::current().id()).await, thread::current().id());
        }
    }

    #[tokio::test]
    async fn calls_after_a_slow_one_go_to_the_pool() {
        let offload = Offload::with_patience(Duration::ZERO);
        assert_eq!(offload.run(|| thread::current().id()).await, thread::current().id());
        assert_ne!(offload.run(|| thread::current().id()).await, thread::current().id());
    }
}
