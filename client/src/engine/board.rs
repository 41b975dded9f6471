//! What the engine shows to the outside: the newest plan and how the clouds are.

use std::sync::Arc;

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

/// The board.
pub(super) type Board = Notice<News>;
