//! The streaming engine: from sources and a view to what is to be drawn (Fraiss 2017, 3.2).
//!
//! Three threads, each with one job:
//! - the caller's (a window's render thread, or a tool): [`Engine::set_view`] and
//!   [`Engine::plan`], neither of which ever waits for the other two;
//! - the traversal thread (`traversal.rs`): decides what is drawn and what is loaded;
//! - the loader thread (`loader/`): requests, decoding, retries.
//!
//! They talk through two letter boxes (`inbox.rs`) and one board (`board.rs`), in which no news can be lost
//! (`mailbox.rs`, `notice.rs`; a model checker tries them in every order). The view, the settings and the
//! demand are latest-wins, everything else is bounded. With nothing to do, all threads sleep. The
//! engine knows no GPU: whoever draws takes a [`FramePlan`] and reads its nodes. Decoding has threads of its
//! own, so that it never stands in a queue before those who draw.

mod board;
mod clip;
mod clouds;
mod commons;
mod config;
mod depth;
mod drawing;
mod error;
mod event;
mod inbox;
mod loader;
mod mailbox;
mod notice;
mod occlusion;
mod piece;
mod plan;
mod policy;
mod priority;
mod selection;
mod settings;
mod shared;
mod simulated;
mod stats;
mod store;
mod sync;
mod tasked;
#[cfg(test)]
pub(crate) mod testing;
mod traversal;
mod tree;
mod view;

use std::{sync::Arc, thread::JoinHandle, time::Duration};

use lodestream_protocol::Boot;

pub use board::CloudStatus;
pub use clip::ClipBox;
pub use commons::Commons;
pub use config::{Coalesce, EngineConfig, LoadOrder, Payloads};
pub use depth::DepthPyramid;
pub use error::EngineError;
pub use occlusion::SplatReach;
pub use plan::{DrawNode, FramePlan, LeftOut, MissingPage, Tally, WantedNode};
pub use policy::Policy;
pub use priority::Priority;
pub use simulated::SimulatedEngine;
pub use stats::{EngineStats, Phase, Totals};
pub use tasked::TaskedEngine;
pub use view::View;
pub(crate) use view::{Optics, WorldBox};

use self::{
    board::News,
    inbox::Change,
    loader::Loader,
    occlusion::Drawn,
    shared::{EndOfThread, Shared},
    traversal::Traversal,
};
use crate::source::Source;

/// Most threads that read local files.
const FILE_THREADS: usize = 8;

/// A running engine. Clouds may come and go, and settings change, while it runs: none of that waits, and
/// the newest counts. Dropping it ends and joins its threads at once, requests or not.
#[derive(Debug)]
pub struct Engine {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

impl Engine {
    /// Starts the threads and begins to open the sources; clouds are numbered in the order of `sources`.
    ///
    /// # Errors
    /// [`EngineError::Thread`] where the system gives no thread.
    pub fn start(sources: Vec<Source>, config: EngineConfig) -> Result<Self, EngineError> {
        let shared = Arc::new(Shared::new(&config, sources));
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .max_blocking_threads(FILE_THREADS)
            .build()?;
        let traversal = Traversal::new(Arc::clone(&shared), &config);
        let loader = Loader::new(Arc::clone(&shared), config).with_decoders()?;
        // From here on, dropping the engine ends whatever threads it has.
        let mut engine = Self { shared, threads: Vec::new() };
        engine.spawn("traversal", || traversal.run())?;
        engine.spawn("loader", move || {
            runtime.block_on(loader.run());
            // Does not wait for a file system or a name server that hangs.
            runtime.shutdown_background();
        })?;
        Ok(engine)
    }

    fn spawn(
        &mut self,
        name: &str,
        run: impl FnOnce() + Send + 'static,
    ) -> Result<(), EngineError> {
        let end = EndOfThread(Arc::clone(&self.shared));
        let thread = std::thread::Builder::new().name(name.into()).spawn(move || {
            let _end = end;
            run();
        })?;
        self.threads.push(thread);
        Ok(())
    }

    /// Adds a cloud and begins to open it; counts as a new view. Never waits. Returns the cloud's number, by
    /// which plans and [`clouds`](Self::clouds) know it; no other cloud ever has it.
    pub fn add(&self, source: Source) -> usize {
        self.shared.add(source)
    }

    /// Removes a cloud and forgets all that is loaded of it; counts as a new view. Never waits. The other
    /// clouds keep their numbers.
    pub fn remove(&self, cloud: usize) {
        self.shared.remove(cloud);
    }

    /// Tries at once to open a cloud that has failed, or failed in parts. Where its dataset has been replaced
    /// meanwhile, the new one stands in its place. Never waits. (Clouds that were open are tried again
    /// from time to time without it.)
    pub fn reopen(&self, cloud: usize) {
        self.shared.loader.change(Change::Reopen { number: cloud });
    }

    /// How the clouds are, by number.
    #[must_use]
    pub fn clouds(&self) -> Vec<CloudStatus> {
        self.shared.board.read(|news| news.clouds.clone())
    }

    /// Waits until the header, manifest and root page of every cloud that was not removed are loaded.
    ///
    /// # Errors
    /// [`EngineError::Cloud`] for the first source that can never be read;
    /// [`EngineError::Timeout`] with the last trouble.
    pub fn wait_open(&self, timeout: Duration) -> Result<Vec<Arc<Boot>>, EngineError> {
        self.wait(timeout, |news| news.present().map(|cloud| cloud.boot.clone()).collect())
    }

    /// Sets the view; the newest one counts. Never waits. Returns the view's number, which
    /// [`FramePlan::view_generation`] repeats; the same view again keeps its number.
    pub fn set_view(&self, view: View) -> u64 {
        self.shared.traversal.set_view(view, |generation| self.shared.start_phase(generation))
    }

    /// Tells of the picture that was drawn of a plan: what lies behind it is neither loaded nor drawn
    /// any more. Pictures of other views than the newest, and those told of before, change nothing. Never
    /// waits. The depths must be of a picture with one sample a pixel.
    pub fn set_depth(&self, plan: &FramePlan, depth: Arc<DepthPyramid>, reach: SplatReach) {
        if let Some(drawn) = Drawn::new(plan, depth, reach) {
            self.shared.traversal.set_drawn(drawn);
        }
    }

    /// Sets the attributes that the view needs (see [`EngineConfig::attributes`]); counts as a new
    /// view. Never waits.
    pub fn set_attributes(&self, attributes: Vec<String>) -> u64 {
        self.shared
            .traversal
            .set_attributes(attributes, |generation| self.shared.start_phase(generation))
    }

    /// Sets the [point budget](EngineConfig::point_budget); another one counts as a new view. Never
    /// waits.
    pub fn set_budget(&self, points: u64) -> u64 {
        self.shared.set(|settings| settings.point_budget = points)
    }

    /// Sets the [least size of a node](EngineConfig::min_size_px); another one counts as a new view. Never
    /// waits.
    pub fn set_min_size_px(&self, min_size_px: f64) -> u64 {
        self.shared.set(|settings| settings.min_size_px = min_size_px)
    }

    /// Limits the view to a box; another one counts as a new view. Never waits.
    pub fn set_clip(&self, clip: Option<ClipBox>) -> u64 {
        self.shared.set(|settings| settings.clip = clip)
    }

    /// Sets whether a cloud is to be seen; a change counts as a new view. A cloud that is not takes nothing
    /// of the budget, and nothing of it is loaded but what opening brings. Never waits.
    pub fn set_visible(&self, cloud: usize, is_visible: bool) -> u64 {
        self.shared.set(|settings| {
            if is_visible {
                settings.hidden.remove(&cloud);
            } else {
                settings.hidden.insert(cloud);
            }
        })
    }

    /// Sets [how much is kept](EngineConfig::cache_bytes); another size counts as a new view. Never waits.
    pub fn set_cache_bytes(&self, cache_bytes: u64) -> u64 {
        self.shared.set(|settings| settings.cache_bytes = cache_bytes)
    }

    /// Has `wake` called whenever there is a newer plan or a cloud is another: for callers that sleep where
    /// this engine cannot wake them. It is called on the engine's threads (and the caller's own), and must
    /// not wait. Of several, the first counts.
    pub fn on_news(&self, wake: impl Fn() + Send + Sync + 'static) {
        self.shared.board.wake_by(wake);
    }

    /// The newest plan. Never waits.
    #[must_use]
    pub fn plan(&self) -> Arc<FramePlan> {
        self.shared.board.read(|news| Arc::clone(&news.plan))
    }

    /// Waits for a plan newer than `sequence`; `None` where the time runs out.
    #[must_use]
    pub fn wait_plan(&self, sequence: u64, timeout: Duration) -> Option<Arc<FramePlan>> {
        self.shared
            .board
            .wait(timeout, |news| (news.plan.sequence > sequence).then(|| Arc::clone(&news.plan)))
    }

    /// Waits until the picture of the newest view is complete: everything wanted is loaded, or has
    /// failed for good ([`EngineStats::problems`] tells what).
    ///
    /// # Errors
    /// [`EngineError::NoView`] before the first [`set_view`](Self::set_view);
    /// [`EngineError::Cloud`] where a source can no longer be read; [`EngineError::Timeout`].
    pub fn wait_settled(&self, timeout: Duration) -> Result<Arc<FramePlan>, EngineError> {
        let (generation, has_view) = self.shared.traversal.generation();
        if !has_view {
            return Err(EngineError::NoView);
        }
        self.wait(timeout, |news| {
            let plan = &news.plan;
            (plan.settled && plan.view_generation >= generation).then(|| Arc::clone(plan))
        })
    }

    fn wait<T>(
        &self,
        timeout: Duration,
        found: impl Fn(&News) -> Option<T>,
    ) -> Result<T, EngineError> {
        let result = self.shared.board.wait(timeout, |news| {
            if let Some(failure) = news.clouds.iter().find_map(|cloud| cloud.failure.clone()) {
                return Some(Err(EngineError::Cloud(failure)));
            }
            if news.stopped {
                return Some(Err(EngineError::Stopped));
            }
            found(news).map(Ok)
        });
        result.unwrap_or_else(|| {
            let missing = self.shared.board.read(describe_missing);
            Err(EngineError::Timeout { seconds: timeout.as_secs_f64(), missing })
        })
    }

    /// Figures since the start and since the view last changed.
    #[must_use]
    pub fn stats(&self) -> EngineStats {
        self.shared.stats()
    }
}

impl Drop for Engine {
    fn drop(&mut self) {
        self.shared.traversal.shut_down();
        self.shared.loader.shut_down();
        for thread in self.threads.drain(..) {
            // A thread that panicked has said so already.
            let _ = thread.join();
        }
    }
}

/// What a plan that is not settled waits for.
fn describe_missing(news: &News) -> String {
    let plan = &news.plan;
    let closed = news.present().filter(|cloud| cloud.boot.is_none()).count();
    let mut missing = if closed > 0 {
        format!("{closed} of {} sources are not open", news.present().count())
    } else {
        let pages = plan.pages_loading;
        format!("{} nodes and {pages} hierarchy pages are missing", plan.left_out.loading.nodes)
    };
    if let Some(trouble) = news.clouds.iter().find_map(|cloud| cloud.trouble.as_ref()) {
        missing.push_str("; ");
        missing.push_str(trouble);
    }
    missing
}
