//! Connections to hosts, shared by the sources that are used together.
//!
//! A client of its own for each source would read the system's certificates for each, and connect anew for
//! each dataset of the same host.

use std::{
    sync::{Arc, Mutex, OnceLock, PoisonError},
    time::Duration,
};

use reqwest::{Client, Url, header};

use super::token::authorization;

/// Connections to one host that are kept for the next request.
const MOST_IDLE: usize = 16;

/// How long a host may be silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timeouts {
    /// Until a connection stands.
    pub connect: Duration,
    /// Until the head of an answer or the next part of its body arrives. There is no limit for a
    /// whole answer: a slow link is no failure.
    pub silence: Duration,
}

impl Default for Timeouts {
    /// 10 s to connect, 15 s of silence.
    fn default() -> Self {
        Self { connect: Duration::from_secs(10), silence: Duration::from_secs(15) }
    }
}

/// An HTTP client that is made when it is first needed.
#[derive(Debug)]
pub(super) struct Connector {
    timeouts: Timeouts,
    /// Whether it connects to this machine: then no proxy is asked.
    is_loopback: bool,
    /// Whether it may have to do with https.
    needs_certificates: bool,
    client: OnceLock<Result<Client, String>>,
}

impl Connector {
    pub fn new(timeouts: Timeouts, url: &Url) -> Self {
        Self {
            timeouts,
            is_loopback: is_local(url),
            needs_certificates: true,
            client: OnceLock::new(),
        }
    }

    /// The same, for http alone. To read the system's certificates takes 6 ms of processor time: more than
    /// all else that a client does until its first picture.
    pub fn without_certificates(self) -> Self {
        Self { needs_certificates: false, ..self }
    }

    /// The client, or why there is none.
    pub fn client(&self) -> Result<&Client, &str> {
        self.client.get_or_init(|| self.build()).as_ref().map_err(String::as_str)
    }

    fn build(&self) -> Result<Client, String> {
        // An error means that the process has chosen its provider already: just as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut builder = Client::builder()
            .user_agent(concat!("lodestream/", env!("CARGO_PKG_VERSION")))
            .tcp_nodelay(true)
            .pool_max_idle_per_host(MOST_IDLE)
            .connect_timeout(self.timeouts.connect)
            .read_timeout(self.timeouts.silence);
        if let Some(token) = authorization() {
            builder =
                builder.default_headers([(header::AUTHORIZATION, token)].into_iter().collect());
        }
        if self.is_loopback {
            builder = builder.no_proxy();
        }
        if !self.needs_certificates {
            builder = builder.tls_certs_only([]);
        }
        builder.build().map_err(|e| format!("no HTTP client: {e}"))
    }

    fn is_like(&self, other: &Self) -> bool {
        self.timeouts == other.timeouts
            && self.is_loopback == other.is_loopback
            && self.needs_certificates == other.needs_certificates
    }
}

/// The connections of sources that are used in one runtime.
#[derive(Debug, Default)]
pub(crate) struct Connections {
    connectors: Mutex<Vec<Arc<Connector>>>,
}

impl Connections {
    /// The one that is like it, which is that itself where it is the first of its kind.
    pub(super) fn shared(&self, connector: &Arc<Connector>) -> Arc<Connector> {
        let mut connectors = self.connectors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = connectors.iter().find(|known| known.is_like(connector)) {
            return Arc::clone(known);
        }
        connectors.push(Arc::clone(connector));
        Arc::clone(connector)
    }
}

/// Whether a URL names this machine by its loopback address.
#[must_use]
pub fn is_local(url: &Url) -> bool {
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
}
