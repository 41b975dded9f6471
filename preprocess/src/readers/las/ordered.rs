//! Work in parallel, delivered in order, with a bound on what is under way.
//!
//! The units run on rayon's current pool while the caller's thread consumes them, so that neither
//! waits for the other for longer than it must. The caller may itself be a worker of that pool,
//! even its only one: instead of blocking while work is left, it helps.

use std::{
    collections::BTreeMap,
    sync::{
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, TryRecvError},
    },
};

use rayon::Yield;

use crate::error::Result;

/// Calls `work` for every unit in parallel, at most `window` units ahead, and `deliver` on the
/// calling thread with what comes out, in order. Stops at the first error of either.
///
/// `work` must not panic: a unit that never arrives is waited for.
pub(super) fn in_order<T: Send>(
    units: usize,
    window: usize,
    work: impl Fn(usize) -> Result<T> + Sync,
    mut deliver: impl FnMut(T) -> Result<()>,
) -> Result<()> {
    let stop = AtomicBool::new(false);
    let (sender, receiver) = mpsc::channel();
    // First in, first out: a worker that helps must take the unit that is needed next.
    rayon::in_place_scope_fifo(|scope| {
        let start = |unit: usize| {
            let (sender, work, stop) = (sender.clone(), &work, &stop);
            scope.spawn_fifo(move |_| {
                if !stop.load(Ordering::Relaxed) {
                    // The receiver outlives the scope.
                    let _ = sender.send((unit, work(unit)));
                }
            });
        };
        let mut early = BTreeMap::new();
        let mut consume = || -> Result<()> {
            (0..units.min(window)).for_each(start);
            for unit in 0..units {
                let outcome = loop {
                    if let Some(outcome) = early.remove(&unit) {
                        break outcome;
                    }
                    let (arrived, outcome) = next(&receiver);
                    early.insert(arrived, outcome);
                };
                let outcome = outcome?;
                if unit + window < units {
                    start(unit + window);
                }
                deliver(outcome)?;
            }
            Ok(())
        };
        let outcome = consume();
        stop.store(true, Ordering::Relaxed);
        outcome
    })
}

fn next<T>(receiver: &Receiver<T>) -> T {
    loop {
        match receiver.try_recv() {
            Ok(arrived) => return arrived,
            // Not in a pool, or all that is left runs on other threads: block.
            Err(TryRecvError::Empty) if rayon::yield_now() != Some(Yield::Executed) => {
                return receiver.recv().expect("this function's caller holds a sender");
            }
            Err(TryRecvError::Empty) => {}
            Err(TryRecvError::Disconnected) => {
                unreachable!("this function's caller holds a sender")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use super::*;
    use crate::Error;

    fn squares(units: usize, window: usize) -> Vec<usize> {
        let mut seen = Vec::new();
        in_order(
            units,
            window,
            |unit| Ok(unit * unit),
            |square| {
                seen.push(square);
                Ok(())
            },
        )
        .expect("nothing fails");
        seen
    }

    #[test]
    fn delivers_in_order_from_outside_a_pool_and_from_its_only_worker() {
        let expected: Vec<usize> = (0..500).map(|unit| unit * unit).collect();
        assert_eq!(squares(500, 7), expected);
        assert_eq!(squares(0, 7), Vec::<usize>::new());
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("a pool can be made");
            assert_eq!(pool.install(|| squares(500, 1)), expected);
            assert_eq!(pool.install(|| squares(500, 7)), expected);
        }
    }

    #[test]
    fn never_runs_further_ahead_than_the_window() {
        let (started, delivered) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let furthest = AtomicUsize::new(0);
        in_order(
            200,
            5,
            |_| {
                let started = started.fetch_add(1, Ordering::SeqCst) + 1;
                furthest.fetch_max(started - delivered.load(Ordering::SeqCst), Ordering::SeqCst);
                Ok(())
            },
            |()| {
                delivered.fetch_add(1, Ordering::SeqCst);
                Ok(())
            },
        )
        .expect("nothing fails");
        // The unit that is being delivered counts too.
        assert!(furthest.into_inner() <= 6);
    }

    #[test]
    fn stops_at_the_first_error_of_either_side() {
        let failing = |unit: usize| {
            if unit == 40 { Err(Error::Setup("unit 40".into())) } else { Ok(unit) }
        };
        let mut last = 0;
        let outcome = in_order(100, 4, failing, |unit| {
            last = unit;
            Ok(())
        });
        assert_eq!(outcome.expect_err("unit 40 fails").to_string(), "unit 40");
        assert_eq!(last, 39);

        let worked = AtomicUsize::new(0);
        let outcome = in_order(
            100_000,
            4,
            |_| {
                worked.fetch_add(1, Ordering::SeqCst);
                Ok(())
            },
            |()| Err(Error::Interrupted),
        );
        assert!(matches!(outcome, Err(Error::Interrupted)));
        assert!(worked.into_inner() <= 5);
    }
}
