//! The phases of a build: told to who watches, and timed.

use std::time::Instant;

use super::report::PhaseSeconds;

/// Hears how the build gets on. Called from many threads.
pub trait Progress: Sync {
    /// A phase begins: `total` of `unit` are to be done (0: unknown).
    fn phase(&self, name: &str, total: u64, unit: &str);
    /// So much more of the phase is done.
    fn advance(&self, amount: u64);
    /// Something that the user should know.
    fn warn(&self, line: &str);
}

/// The phase that is under way, and those that are done.
pub(super) struct Phases<'a> {
    progress: &'a dyn Progress,
    started: Instant,
    done: Vec<PhaseSeconds>,
    name: String,
}

impl<'a> Phases<'a> {
    /// None is under way.
    pub(super) fn new(progress: &'a dyn Progress) -> Self {
        Self { progress, started: Instant::now(), done: Vec::new(), name: String::new() }
    }

    /// Ends the phase that is under way and begins another.
    pub(super) fn begin(&mut self, name: &str, total: u64, unit: &str) {
        self.end();
        self.name = name.into();
        self.started = Instant::now();
        self.progress.phase(name, total, unit);
    }

    fn end(&mut self) {
        if !self.name.is_empty() {
            let seconds = self.started.elapsed().as_secs_f64();
            self.done.push(PhaseSeconds { phase: std::mem::take(&mut self.name), seconds });
        }
    }

    /// Ends the last phase; gives the times of all.
    pub(super) fn finish(mut self) -> Vec<PhaseSeconds> {
        self.end();
        self.done
    }
}
