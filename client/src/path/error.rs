//! Why something is no camera path.

use std::path::PathBuf;

/// What is wrong, where, and what would be right.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// The file cannot be read or written.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        why: String,
    },
    /// The text is not a path file.
    #[error("not a camera path: {0}")]
    Json(String),
    /// A key frame cannot be one.
    #[error("key {number}: {why}")]
    Key {
        /// Which, counting from 1.
        number: usize,
        /// What is wrong with it.
        why: String,
    },
    /// The keys together are no path.
    #[error("{0}")]
    Keys(String),
    /// The line names no generator, or one with options that it does not have.
    #[error("{0}")]
    Spec(String),
    /// No path can be made for such a cloud.
    #[error("{0}")]
    Extent(String),
}
