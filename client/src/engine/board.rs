//! What the engine shows to the outside: the newest plan and how the clouds are.
//!
//! One mutex, held for a few moves only, and one condition variable: whoever waits checks under the
//! mutex what it waits for, so no news is missed.

use std::{
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock},
    time::{Duration, Instant},
};

use lodestream_protocol::Boot;

use super::plan::FramePlan;

/// Most lines about what has failed.
const MAX_PROBLEMS: usize = 100;

/// How a cloud is.
#[derive(Debug, Clone, Default)]
pub struct CloudStatus {
    /// The source, for people.
    pub source: String,
    /// Header, manifest and root page, once they are loaded.
    pub boot: Option<Arc<Boot>>,
    /// The last trouble with the source, where the last request failed; it is being repeated.
    pub trouble: Option<String>,
    /// Why the source can no longer be read, where that is so. What is loaded is drawn on. A cloud that
    /// was open is tried again from time to time, others with [`Engine::reopen`](super::Engine::reopen).
    pub failure: Option<String>,
    /// How often another version of the dataset has been opened in place of the one before.
    pub replaced: u32,
    /// Whether the cloud was removed: then there is nothing else to tell.
    pub removed: bool,
}

/// What is shown.
#[derive(Debug, Default)]
pub(super) struct News {
    pub plan: Arc<FramePlan>,
    pub clouds: Vec<CloudStatus>,
    pub problems: Vec<String>,
    /// Whether a thread has ended.
    pub stopped: bool,
}

impl News {
    /// Changes how a cloud is, unless it was removed.
    pub fn cloud(&mut self, number: usize, change: impl FnOnce(&mut CloudStatus)) {
        self.clouds.get_mut(number).filter(|cloud| !cloud.removed).map(change);
    }

    /// The clouds that were not removed.
    pub fn present(&self) -> impl Iterator<Item = &CloudStatus> {
        self.clouds.iter().filter(|cloud| !cloud.removed)
    }

    /// Notes what has failed for good.
    pub fn add_problem(&mut self, line: String) {
        tracing::warn!("{line}");
        if self.problems.len() < MAX_PROBLEMS {
            self.problems.push(line);
        }
    }
}

/// What is called when there is news.
struct Waker(Box<dyn Fn() + Send + Sync>);

impl std::fmt::Debug for Waker {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str("Waker")
    }
}

/// The board.
#[derive(Debug, Default)]
pub(super) struct Board {
    news: Mutex<News>,
    changed: Condvar,
    waker: OnceLock<Waker>,
}

impl Board {
    /// Looks at the news.
    pub fn read<T>(&self, look: impl FnOnce(&News) -> T) -> T {
        look(&self.lock())
    }

    /// Changes the news and wakes those who wait.
    pub fn post<T>(&self, change: impl FnOnce(&mut News) -> T) -> T {
        let result = change(&mut self.lock());
        self.changed.notify_all();
        if let Some(Waker(wake)) = self.waker.get() {
            wake();
        }
        result
    }

    /// Calls `wake` after every change from now on, on the thread that made it. The first one stays.
    pub fn wake_by(&self, wake: impl Fn() + Send + Sync + 'static) {
        // A second one would be a mistake of the one caller there is.
        let _ = self.waker.set(Waker(Box::new(wake)));
    }

    /// Waits until `look` finds what it looks for; `None` where the time runs out.
    pub fn wait<T>(
        &self,
        timeout: Duration,
        mut look: impl FnMut(&News) -> Option<T>,
    ) -> Option<T> {
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
    fn lock(&self) -> MutexGuard<'_, News> {
        self.news.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}
