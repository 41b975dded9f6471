//! Runs the chunks on all threads, each after those of its neighbours that come before it.
//!
//! Chunks are coloured so that no two that touch share a colour; colours, then Morton order, say who
//! comes before whom. What a chunk sees of its neighbours is thus the same for any number of threads.

use std::{
    collections::BTreeSet,
    sync::{Condvar, Mutex},
};

use crate::error::Result;

/// For each chunk the neighbours that must be built before it, ascending.
pub fn dependencies(neighbours: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let colours = colours(neighbours);
    neighbours
        .iter()
        .enumerate()
        .map(|(i, touching)| {
            touching.iter().copied().filter(|&j| colours[j] < colours[i]).collect()
        })
        .collect()
}

/// The smallest colour that no neighbour before has.
fn colours(neighbours: &[Vec<usize>]) -> Vec<usize> {
    let mut colours: Vec<usize> = Vec::with_capacity(neighbours.len());
    for (i, touching) in neighbours.iter().enumerate() {
        let taken: BTreeSet<usize> =
            touching.iter().filter(|&&j| j < i).map(|&j| colours[j]).collect();
        let free = (0..).find(|c| !taken.contains(c)).expect("finitely many are taken");
        colours.push(free);
    }
    colours
}

struct State {
    ready: BTreeSet<usize>,
    waiting_for: Vec<usize>,
    unfinished: usize,
    running_cost: u64,
    failed: bool,
}

/// Calls `work(i)` once for every `i`, after all of `dependencies[i]`, on `threads` threads. Jobs run
/// beside others only while the `cost` of all running ones stays within `budget`.
///
/// # Errors
/// The first error of `work`; no further work is started after it.
pub fn run(
    dependencies: &[Vec<usize>],
    threads: usize,
    cost: impl Fn(usize) -> u64 + Sync,
    budget: u64,
    work: impl Fn(usize) -> Result<()> + Sync,
) -> Result<()> {
    let count = dependencies.len();
    let mut dependents = vec![Vec::new(); count];
    for (i, before) in dependencies.iter().enumerate() {
        before.iter().for_each(|&j| dependents[j].push(i));
    }
    let state = Mutex::new(State {
        ready: (0..count).filter(|&i| dependencies[i].is_empty()).collect(),
        waiting_for: dependencies.iter().map(Vec::len).collect(),
        unfinished: count,
        running_cost: 0,
        failed: false,
    });
    let changed = Condvar::new();
    let worker = || -> Result<()> {
        loop {
            let mut state_now = lock(&state);
            let job = loop {
                if state_now.unfinished == 0 || state_now.failed {
                    return Ok(());
                }
                // Chunks that others wait for first, then in order.
                let next = state_now
                    .ready
                    .iter()
                    .copied()
                    .max_by_key(|&i| (dependents[i].len(), std::cmp::Reverse(i)));
                match next {
                    Some(i)
                        if state_now.running_cost == 0
                            || state_now.running_cost + cost(i) <= budget =>
                    {
                        break i;
                    }
                    _ => state_now = changed.wait(state_now).expect("no holder panics"),
                }
            };
            state_now.ready.remove(&job);
            state_now.running_cost += cost(job);
            drop(state_now);
            // A panic must not leave the others waiting for ever.
            let result = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| work(job)));
            let mut state_now = lock(&state);
            state_now.running_cost -= cost(job);
            state_now.unfinished -= 1;
            if matches!(result, Ok(Ok(()))) {
                for &i in &dependents[job] {
                    state_now.waiting_for[i] -= 1;
                    if state_now.waiting_for[i] == 0 {
                        state_now.ready.insert(i);
                    }
                }
            } else {
                state_now.failed = true;
            }
            drop(state_now);
            changed.notify_all();
            match result {
                Ok(result) => result?,
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(worker)).collect();
        let mut outcome = Ok(());
        for handle in workers {
            match handle.join() {
                Ok(result) => outcome = outcome.and(result),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        outcome
    })
}

fn lock(state: &Mutex<State>) -> std::sync::MutexGuard<'_, State> {
    state.lock().expect("no holder panics")
}
