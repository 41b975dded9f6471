//! The same engine in simulated time: the same traversal, loader, cache and sources, taking turns on
//! one thread by a clock that jumps to the next thing that happens.
//!
//! What a run brings depends on its input alone: two runs are equal to the last byte, and ten
//! seconds on a slow link take as long as the decoding does. Only waiting counts: computing takes no
//! simulated time. (A node takes some 30 µs to select and 1 ms to decode, a request 40 ms: see what
//! the evaluation says about the real engine on the same link.)
//!
//! Sources must not do their waiting elsewhere, as sockets do: give it
//! [linked](crate::source::Source::linked) files.

use std::{sync::Arc, time::Duration};

use tokio::{
    runtime::Runtime,
    time::{Instant, sleep_until},
};

use super::{
    DepthPyramid, EngineError, EngineStats, FramePlan, SplatReach, View, config::EngineConfig,
    loader::Loader, occlusion::Drawn, shared::Shared, traversal::Traversal,
};
use crate::source::Source;

/// An engine whose time passes when it is told to.
pub struct SimulatedEngine {
    shared: Arc<Shared>,
    traversal: Traversal,
    runtime: Runtime,
    start: Instant,
    now: Instant,
}

impl SimulatedEngine {
    /// An engine at time 0, with nothing asked for yet.
    ///
    /// # Errors
    /// [`EngineError::Thread`] where the system gives no timer.
    pub fn start(sources: Vec<Source>, config: EngineConfig) -> Result<Self, EngineError> {
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_time().start_paused(true).build()?;
        let entered = runtime.enter();
        let start = Instant::now();
        let shared = Arc::new(Shared::new(&config, sources));
        let traversal = Traversal::new(Arc::clone(&shared), &config);
        let loader = Loader::new(Arc::clone(&shared), config);
        runtime.spawn(loader.run());
        drop(entered);
        Ok(Self { shared, traversal, runtime, start, now: start })
    }

    /// Sets the view, now.
    pub fn set_view(&mut self, view: View) {
        let _entered = self.runtime.enter();
        let shared = &self.shared;
        shared.traversal.set_view(view, |generation| shared.start_phase(generation));
    }

    /// Tells of the picture that was drawn of a plan, now: as
    /// [`Engine::set_depth`](super::Engine::set_depth).
    pub fn set_depth(&mut self, plan: &FramePlan, depth: Arc<DepthPyramid>, reach: SplatReach) {
        let _entered = self.runtime.enter();
        if let Some(drawn) = Drawn::new(plan, depth, reach) {
            self.shared.traversal.set_drawn(drawn);
        }
    }

    /// Lets so much time pass and returns the newest plan.
    pub fn advance(&mut self, time: Duration) -> Arc<FramePlan> {
        let end = self.now + time;
        let (shared, traversal) = (&self.shared, &mut self.traversal);
        self.runtime.block_on(async {
            loop {
                while let Some(mail) = shared.traversal.try_take() {
                    traversal.step(mail);
                }
                tokio::select! {
                    biased;
                    () = shared.traversal.posted() => {}
                    () = sleep_until(end) => break,
                }
            }
            // What happened at that very moment.
            while let Some(mail) = shared.traversal.try_take() {
                traversal.step(mail);
            }
        });
        self.now = end;
        self.plan()
    }

    /// Time since the start.
    #[must_use]
    pub fn time(&self) -> Duration {
        self.now - self.start
    }

    /// The newest plan.
    #[must_use]
    pub fn plan(&self) -> Arc<FramePlan> {
        self.shared.board.read(|news| Arc::clone(&news.plan))
    }

    /// Figures so far, in simulated milliseconds.
    #[must_use]
    pub fn stats(&self) -> EngineStats {
        let _entered = self.runtime.enter();
        self.shared.stats()
    }
}
