//! The same engine as tasks on the caller's runtime, in real time: many of them on few threads.
//!
//! The traversal takes its steps where [`TaskedEngine::next_plan`] is waited for; the loader is a task
//! of its own and decodes on it. So a thousand engines need no thread of their own, and whoever
//! drives one has no second thread to share with.

use std::sync::Arc;

use tokio::task::AbortHandle;

use super::{
    Commons, EngineStats, FramePlan, MissingPage, View, WantedNode, board::CloudStatus,
    config::EngineConfig, loader::Loader, shared::Shared, traversal::Traversal,
};
use crate::source::Source;

/// An engine that works while it is waited for. Dropping it breaks its requests off.
pub struct TaskedEngine {
    shared: Arc<Shared>,
    traversal: Traversal,
    loader: AbortHandle,
}

impl TaskedEngine {
    /// Begins to open the sources. To be called within a runtime that has time and I/O.
    #[must_use]
    pub fn start(sources: Vec<Source>, config: EngineConfig, commons: Arc<Commons>) -> Self {
        let shared = Arc::new(Shared::new(&config, sources));
        let traversal = Traversal::new(Arc::clone(&shared), &config).sharing(Arc::clone(&commons));
        let loader = Loader::new(Arc::clone(&shared), config).sharing(commons);
        let loader = tokio::spawn(loader.run()).abort_handle();
        Self { shared, traversal, loader }
    }

    /// Sets the view; the newest one counts. Returns its number, as
    /// [`Engine::set_view`](super::Engine::set_view) does.
    pub fn set_view(&self, view: View) -> u64 {
        self.shared.traversal.set_view(view, |generation| self.shared.start_phase(generation))
    }

    /// Waits for news, takes them in, and returns the plan that comes of them. May be given up at any
    /// time.
    pub async fn next_plan(&mut self) -> Arc<FramePlan> {
        loop {
            if let Some(mail) = self.shared.traversal.try_take() {
                self.traversal.step(mail);
                return self.plan();
            }
            self.shared.traversal.posted().await;
        }
    }

    /// The newest plan.
    #[must_use]
    pub fn plan(&self) -> Arc<FramePlan> {
        self.shared.board.read(|news| Arc::clone(&news.plan))
    }

    /// What the newest plan wants, and whether it is there.
    pub fn wanted(&self) -> impl Iterator<Item = WantedNode> {
        self.traversal.wanted()
    }

    /// The parts of the indices that the newest plan lacks. While view, datasets and settings stay, a node that a plan
    /// wants, though the one before did not, lies below one of those that the one before lacked.
    pub fn missing_pages(&self) -> impl Iterator<Item = MissingPage> {
        self.traversal.unknown()
    }

    /// Looks at how the clouds are, in the order of the sources.
    pub fn look_at_clouds<T>(&self, look: impl FnOnce(&[CloudStatus]) -> T) -> T {
        self.shared.board.read(|news| look(&news.clouds))
    }

    /// Figures so far.
    #[must_use]
    pub fn stats(&self) -> EngineStats {
        self.shared.stats()
    }
}

impl Drop for TaskedEngine {
    fn drop(&mut self) {
        // Flights and openings hold what the loader reads from: they end with it.
        self.shared.loader.shut_down();
        self.loader.abort();
    }
}
