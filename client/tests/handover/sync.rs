//! Loom's locks in place of the engine's.

use std::{
    future::poll_fn,
    sync::PoisonError,
    task::{Poll, Waker},
};

pub use loom::sync::{Condvar, Mutex, MutexGuard};

/// What tokio's `Notify` does for one waiter: `notify_one` stores a permit, at most one, and a wait takes
/// it. (Tokio checks its own with loom.)
#[derive(Debug)]
pub struct Notify(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    permit: bool,
    waiter: Option<Waker>,
}

impl Notify {
    pub fn new() -> Self {
        Self(Mutex::new(State::default()))
    }

    pub fn notify_one(&self) {
        let waiter = {
            let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            state.permit = true;
            state.waiter.take()
        };
        if let Some(waiter) = waiter {
            waiter.wake();
        }
    }

    pub async fn notified(&self) {
        poll_fn(|context| {
            let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            if std::mem::take(&mut state.permit) {
                return Poll::Ready(());
            }
            state.waiter = Some(context.waker().clone());
            Poll::Pending
        })
        .await;
    }
}
