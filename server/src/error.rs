//! Why a server could not start or go on.

use std::{io, net::SocketAddr, path::PathBuf};

/// What an operator has to mend.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The folder to serve cannot be read.
    #[error("{}: cannot read the folder: {source}", dir.display())]
    Folder {
        /// The folder.
        dir: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {addr}: {source}")]
    Listen {
        /// The address.
        addr: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The system gave no thread or no runtime.
    #[error("cannot start the server's thread: {0}")]
    Thread(io::Error),
    /// The server's thread panicked; its message went to standard error.
    #[error("the server's thread ended in a panic")]
    Panicked,
}

/// [`std::result::Result`] with this crate's [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;
