//! What a server is told.

use std::{net::SocketAddr, path::PathBuf, time::Duration};

/// What to serve, where, and within which limits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ServeConfig {
    /// The folder of `*.lods` files.
    pub dir: PathBuf,
    /// Address to listen on; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Most connections at a time; further ones wait in the system's queue.
    pub max_connections: usize,
    /// How long a client may take to send a request's head, and how long an idle connection stays.
    pub head_timeout: Duration,
    /// How long a client may leave the bytes of a response untaken before it is cut off.
    pub write_timeout: Duration,
    /// How long a handler may take until its response starts.
    pub response_timeout: Duration,
    /// How long responses under way may take once the server is asked to stop.
    pub drain_timeout: Duration,
}

impl ServeConfig {
    /// The default limits.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, listen: SocketAddr) -> Self {
        Self {
            dir: dir.into(),
            listen,
            max_connections: 4096,
            head_timeout: Duration::from_secs(60),
            write_timeout: Duration::from_secs(60),
            response_timeout: Duration::from_secs(30),
            drain_timeout: Duration::from_secs(10),
        }
    }
}
