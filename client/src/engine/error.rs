//! Why the engine cannot deliver.

/// Why there is no (settled) picture. Variants follow what a caller does next.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    /// A source can never be read; the message says why.
    #[error("{0}")]
    Cloud(String),
    /// Not in time; the message says what was missing. Waiting on may help.
    #[error("not complete after {seconds:.1} s: {missing}")]
    Timeout {
        /// How long it was waited for.
        seconds: f64,
        /// What was missing, and the last trouble with the source, if there was any.
        missing: String,
    },
    /// No view was set, so there is nothing to settle.
    #[error("no view was set")]
    NoView,
    /// The engine's threads have ended: a defect.
    #[error("the engine's threads have ended unexpectedly; please report this")]
    Stopped,
    /// The system gave no thread.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}
