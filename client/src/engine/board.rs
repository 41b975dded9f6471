//! What the engine shows to the outside: the newest plan and how the clouds are.

use std::{
    sync::{Arc, OnceLock},
    time::Duration,
};

use lodestream_protocol::Boot;

use super::{notice::Notice, plan::FramePlan};

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

/// The board, and who is woken by it without waiting for it.
#[derive(Debug, Default)]
pub(super) struct Board {
    notice: Notice<News>,
    waker: OnceLock<Waker>,
}

impl Board {
    /// Looks at the news.
    pub fn read<T>(&self, look: impl FnOnce(&News) -> T) -> T {
        self.notice.read(look)
    }

    /// Changes the news and wakes those who wait.
    pub fn post<T>(&self, change: impl FnOnce(&mut News) -> T) -> T {
        let result = self.notice.post(change);
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
    pub fn wait<T>(&self, timeout: Duration, look: impl FnMut(&News) -> Option<T>) -> Option<T> {
        self.notice.wait(timeout, look)
    }
}
