//! What a server is told.

use std::{
    net::{IpAddr, SocketAddr},
    path::PathBuf,
    time::Duration,
};

use crate::{
    access::Access,
    error::{Error, Result},
};

/// What to serve, to whom, where, and within which limits.
#[derive(Debug, Clone, PartialEq)]
pub struct ServeConfig {
    /// Where the datasets are.
    pub data: DataPlace,
    /// Most memory for what was read from an object store, in bytes.
    pub cache_bytes: u64,
    /// Address to listen on; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Who may read what.
    pub access: Access,
    /// Whether everything may be read by everyone even where other machines reach the address.
    pub is_public: bool,
    /// Certificate and key; without them connections are not encrypted.
    pub tls: Option<TlsFiles>,
    /// Addresses whose `X-Forwarded-…` fields are believed: those of proxies in front.
    pub trusted_proxies: Vec<IpAddr>,
    /// Whether every request is logged.
    pub access_log: bool,
    /// Most connections at a time; further ones wait in the system's queue.
    pub max_connections: usize,
    /// Most bytes of a request's body.
    pub max_body_bytes: usize,
    /// How often one client may ask.
    pub rate: Option<RateLimit>,
    /// How long a client may take to send a request's head, and how long an idle connection stays.
    pub head_timeout: Duration,
    /// How long a client may leave the bytes of a response untaken before it is cut off; over HTTP/2, how long
    /// it may take for 16 KiB of what it asked for.
    pub write_timeout: Duration,
    /// How long a handler may take until its response starts.
    pub response_timeout: Duration,
    /// How long the server goes on, telling that it is not ready, once it is asked to stop: so that
    /// whoever sends it clients has time to see that.
    pub drain_delay: Duration,
    /// How long responses under way may take after that.
    pub drain_timeout: Duration,
}

/// Where the datasets are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DataPlace {
    /// The `*.lods` files of a folder.
    Folder(PathBuf),
    /// Those of an object store.
    Objects(ObjectPlace),
}

/// An object store, and how to reach it.
#[derive(Clone, PartialEq, Eq)]
pub struct ObjectPlace {
    /// `s3://BUCKET/PREFIX`, `gs://…`, `az://…`, `https://…`.
    pub url: String,
    /// Settings in the words of the `object_store` crate (`region`, `endpoint`, keys).
    pub options: Vec<(String, String)>,
}

impl DataPlace {
    /// What an operator has written: an address with a scheme is an object store's.
    #[must_use]
    pub fn new(text: &str, options: Vec<(String, String)>) -> Self {
        if text.contains("://") {
            Self::Objects(ObjectPlace { url: text.to_owned(), options })
        } else {
            Self::Folder(text.into())
        }
    }
}

impl std::fmt::Debug for ObjectPlace {
    // Without the options: some of them are secrets.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ObjectPlace").field("url", &self.url).finish_non_exhaustive()
    }
}

/// Where certificate and key are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// The certificate and those between it and a root, in PEM.
    pub cert: PathBuf,
    /// The certificate's private key, in PEM.
    pub key: PathBuf,
}

/// How often one client may ask.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RateLimit {
    /// Requests a second in the long run; above zero.
    pub per_second: f64,
    /// Requests at once after a pause.
    pub burst: u32,
}

impl ServeConfig {
    /// The default limits.
    #[must_use]
    pub fn new(dir: impl Into<PathBuf>, listen: SocketAddr) -> Self {
        Self {
            data: DataPlace::Folder(dir.into()),
            cache_bytes: 256 << 20,
            listen,
            access: Access::Open,
            is_public: false,
            tls: None,
            trusted_proxies: Vec::new(),
            access_log: false,
            max_connections: 8192,
            max_body_bytes: 1 << 20,
            rate: None,
            head_timeout: Duration::from_secs(60),
            write_timeout: Duration::from_secs(60),
            response_timeout: Duration::from_secs(30),
            drain_delay: Duration::ZERO,
            drain_timeout: Duration::from_secs(10),
        }
    }

    /// Refuses what would show datasets to strangers without anyone having said so.
    pub(crate) fn check(&self) -> Result<()> {
        let is_exposed = !self.listen.ip().is_loopback();
        if is_exposed && self.access == Access::Open && !self.is_public {
            return Err(Error::Exposed { addr: self.listen });
        }
        Ok(())
    }
}
