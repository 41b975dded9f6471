//! A notice board: what it shows is replaced as a whole, and whoever waits for something looks for it under
//! the mutex, so that no news is missed. The mutex is held for a few moves only: who reads never waits for
//! work. Tried in every order by `tests/handover.rs`, as `mailbox.rs` is.

use std::{
    sync::PoisonError,
    time::{Duration, Instant},
};

use super::sync::{Condvar, Mutex, MutexGuard};

/// A board that shows an `N`.
#[derive(Debug, Default)]
pub struct Notice<N> {
    news: Mutex<N>,
    changed: Condvar,
}

impl<N> Notice<N> {
    /// Looks at it.
    pub fn read<T>(&self, look: impl FnOnce(&N) -> T) -> T {
        look(&self.lock())
    }

    /// Changes it and wakes those who wait.
    pub fn post<T>(&self, change: impl FnOnce(&mut N) -> T) -> T {
        let result = change(&mut self.lock());
        self.changed.notify_all();
        result
    }

    /// Waits until `look` finds what it looks for; `None` where the time runs out.
    pub fn wait<T>(&self, timeout: Duration, mut look: impl FnMut(&N) -> Option<T>) -> Option<T> {
        let deadline = Instant::now().checked_add(timeout);
        let mut news = self.lock();
        loop {
            if let Some(found) = look(&news) {
                return Some(found);
            }
            // Without a deadline the timeout is longer than the clock can tell.
            let left = match deadline {
                Some(deadline) => deadline.saturating_duration_since(Instant::now()),
                None => Duration::MAX,
            };
            if left.is_zero() {
                return None;
            }
            news = match self.changed.wait_timeout(news, left) {
                Ok((news, _)) => news,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }

    /// A thread that panicked while it held the lock leaves whole values behind: every change is a
    /// move.
    fn lock(&self) -> MutexGuard<'_, N> {
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
