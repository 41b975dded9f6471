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
    /// The object store's address means nothing, or its settings do not.
    #[error("{url}: {reason}")]
    Objects {
        /// The address.
        url: String,
        /// What is wrong.
        reason: String,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {addr}: {source}")]
    Listen {
        /// The address.
        addr: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// Other machines reach the address, and nothing says that they may.
    #[error(
        "{addr} is reached by other machines: say who may read what in the configuration's [access], \
         or that everyone may read everything with --public"
    )]
    Exposed {
        /// The address.
        addr: SocketAddr,
    },
    /// Certificate or key cannot be used.
    #[error("{}: {reason}", path.display())]
    Tls {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
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
