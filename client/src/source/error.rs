//! Why a source did not deliver.

use super::Fault;

/// Why bytes could not be had. Variants follow what a caller does next.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SourceError {
    /// Trying again later may help: the host is busy, away, or broke off.
    #[error("{place}: {message}")]
    Transient {
        /// The source, as [`Source::describe`](super::Source::describe) names it.
        place: String,
        /// What happened.
        message: String,
        /// Its kind.
        fault: Fault,
    },
    /// The file is no longer the one that was opened: nothing more of that one can be had.
    /// [`Source::renew`](super::Source::renew) makes a source of the one that is there now.
    #[error("{place}: the file was replaced while it was in use; open it again")]
    Replaced {
        /// The source, as [`Source::describe`](super::Source::describe) names it.
        place: String,
    },
    /// Trying again cannot help; the message says what would.
    #[error("{place}: {message}")]
    Permanent {
        /// The source, as [`Source::describe`](super::Source::describe) names it.
        place: String,
        /// What is wrong and what to do.
        message: String,
        /// Its kind.
        fault: Fault,
    },
}

impl SourceError {
    /// Whether trying again later may help.
    #[must_use]
    pub const fn is_transient(&self) -> bool {
        matches!(self, Self::Transient { .. })
    }

    /// The kind of failure.
    #[must_use]
    pub const fn fault(&self) -> Fault {
        match self {
            Self::Transient { fault, .. } | Self::Permanent { fault, .. } => *fault,
            Self::Replaced { .. } => Fault::Replaced,
        }
    }

    pub(super) fn transient(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Transient { place: place.into(), message: message.into(), fault: Fault::Other }
    }

    pub(super) fn permanent(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Permanent { place: place.into(), message: message.into(), fault: Fault::Other }
    }

    /// The same, of that kind.
    pub(super) fn of(mut self, kind: Fault) -> Self {
        match &mut self {
            Self::Transient { fault, .. } | Self::Permanent { fault, .. } => *fault = kind,
            Self::Replaced { .. } => {}
        }
        self
    }
}
