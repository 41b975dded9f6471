//! Where short file-system calls run: in place while they are quick, else on the blocking pool.
//!
//! Opening a file whose directory entry is cached takes microseconds; a hop to the blocking pool
//! and back costs several times as much, on every request. On a slow disk the same call may take
//! milliseconds, during which a runtime thread would serve nobody else. So calls run in place until
//! several were slow, and on the pool until most are quick again. One slow call says nothing: on a
//! busy machine, the thread may just have lost its processor for a while.
//!
//! A server of files that has gone away keeps a call for minutes, or for good. No earlier call tells
//! of that, and under load every thread has its next one out before anyone can know, with health,
//! figures, timeouts and all other connections stuck behind it. So only what is known to lie on a
//! [disk of this machine](crate::disk) is asked in place, and anything else on the pool whatever its
//! time: there a hung call costs one of [a few threads](crate::disk::elsewhere) that nobody waits for, and the
//! client is answered when its time is over. (Tried with a FUSE file system that stops to answer under load: in place, not even
//! `/healthz` was answered any more.)

use std::{
    sync::atomic::{AtomicU32, Ordering},
    time::{Duration, Instant},
};

use crate::disk;

/// A call longer than this counts as slow.
const PATIENCE: Duration = Duration::from_millis(1);
/// What a slow call adds to the score; a quick one takes 1 away. So calls go to the pool while more
/// than one in 11 is slow.
const SLOW_SCORE: u32 = 10;
/// From this score on, calls go to the pool.
const POOL_SCORE: u32 = 2 * SLOW_SCORE;
/// No memory reaches further back.
const MAX_SCORE: u32 = 3 * SLOW_SCORE;

/// Decides by the time that earlier calls took.
#[derive(Debug)]
pub(crate) struct Offload {
    score: AtomicU32,
    patience: Duration,
}

impl Offload {
    pub(crate) const fn new() -> Self {
        Self { score: AtomicU32::new(0), patience: PATIENCE }
    }

    /// Runs `work`, which asks about a file of a disk of this machine, or of who knows where.
    pub(crate) async fn run<T, F>(&self, is_local: bool, work: F) -> T
    where
        T: Send + 'static,
        F: FnOnce() -> T + Send + 'static,
    {
        if !is_local {
            return disk::elsewhere(work).await;
        }
        let timed = || {
            let start = Instant::now();
            let result = work();
            (result, start.elapsed())
        };
        let (result, duration) = if self.score.load(Ordering::Relaxed) < POOL_SCORE {
            timed()
        } else {
            disk::on_pool(timed).await
        };
        self.note(duration > self.patience);
        result
    }

    fn note(&self, was_slow: bool) {
        let score = self.score.load(Ordering::Relaxed);
        let next = match was_slow {
            true => (score + SLOW_SCORE).min(MAX_SCORE),
            false => score.saturating_sub(1),
        };
        // Of two threads at once one may be forgotten: it is a rule of thumb. A score that stays
        // zero is not written, so that threads share the line in their caches.
        if next != score {
            self.score.store(next, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{sync::mpsc, thread};

    async fn is_in_place(offload: &Offload) -> bool {
        offload.run(true, || thread::current().id()).await == thread::current().id()
    }

    #[tokio::test]
    async fn quick_calls_stay_on_the_thread() {
        let offload = Offload { patience: Duration::MAX, ..Offload::new() };
        for _ in 0..100 {
            assert!(is_in_place(&offload).await);
        }
    }

    #[tokio::test]
    async fn one_slow_call_changes_nothing_but_two_do() {
        let mut offload = Offload { patience: Duration::ZERO, ..Offload::new() };
        assert!(is_in_place(&offload).await);
        assert!(is_in_place(&offload).await);
        assert!(!is_in_place(&offload).await);
        offload.patience = Duration::MAX;
        while !is_in_place(&offload).await {}
    }

    #[tokio::test]
    async fn a_mount_that_hangs_keeps_nobody_else_waiting() {
        let offload = Offload::new();
        let (answer, answered) = mpsc::channel();
        // Far beyond what this test takes: it fails rather than hangs where it is wrong.
        let hung = offload.run(false, move || answered.recv_timeout(Duration::from_secs(10)));
        let others = async {
            assert!(is_in_place(&offload).await, "local files are none the worse for it");
            answer.send(()).expect("somebody waits");
        };
        assert_eq!(tokio::join!(hung, others).0, Ok(()));
    }
}
