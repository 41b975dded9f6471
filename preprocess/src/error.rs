//! The one error type of the preprocessor: what a user has to mend.

use std::{io, path::PathBuf};

/// Why a dataset could not be built, checked or exported.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// An input cannot be read as the point cloud it claims to be. The message says what, where
    /// and what to do.
    #[error("{path}: {message}")]
    Input {
        /// The input, as the user named it.
        path: String,
        /// What is wrong, where, and what to do.
        message: String,
    },
    /// Reading or writing a file failed.
    #[error("{}: {action}: {source}{}", path.display(), advice(source))]
    Io {
        /// The file.
        path: PathBuf,
        /// What was being done, as in `cannot read`.
        action: &'static str,
        /// What the system said.
        source: io::Error,
    },
    /// The dataset's bytes are wrong.
    #[error("{path}: {source}")]
    Format {
        /// The dataset.
        path: String,
        /// What is wrong.
        source: lodestream_protocol::Error,
    },
    /// The options or the machine do not allow the build.
    #[error("{0}")]
    Setup(String),
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}

/// What to do about an error of the system, where that is not plain from its words.
fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room, or write to another place"
        }
        _ => "",
    }
}

/// [`std::result::Result`] with this crate's [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An [`Error::Input`].
    pub fn input(path: impl Into<String>, message: impl Into<String>) -> Self {
        Self::Input { path: path.into(), message: message.into() }
    }

    /// Wraps an I/O error: `.map_err(Error::io(path, "cannot read"))`.
    pub fn io(path: impl Into<PathBuf>, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { path, action, source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_told_with_what_to_do() {
        let error = Error::io("out.lods", "cannot write")(io::ErrorKind::StorageFull.into());
        let text = error.to_string();
        assert!(text.starts_with("out.lods: cannot write: "), "{text}");
        assert!(text.ends_with("; make room, or write to another place"), "{text}");
    }
}
