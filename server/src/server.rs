//! The server: a bound socket, then a loop that accepts connections until it is asked to stop.
//!
//! The loop is axum's own, but for what that one does not offer: a limit on connections, timeouts
//! on slow clients, TLS whose certificate can be changed, an end to draining, and [a thread](crate::workers)
//! for each connection to stay on.

use std::{future::Future, io, net::SocketAddr, pin::pin, sync::Arc, time::Duration};

use hyper_util::server::graceful::GracefulShutdown;
use tokio::{
    net::{TcpListener, TcpStream},
    sync::watch,
    task::JoinSet,
    time::MissedTickBehavior,
};

use crate::{
    access::Access,
    config::ServeConfig,
    connection::{self, ConnectionLimits, Host},
    error::{Error, Result},
    routes::{self, Site},
    tls::Tls,
    workers::Workers,
};

/// For connections that were cut off to end.
const LAST_WAIT: Duration = Duration::from_secs(1);

/// How often certificate and key are looked at.
const CERTIFICATE_CHECK: Duration = Duration::from_secs(30);

/// A server that is bound to its address.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    addr: SocketAddr,
    host: Arc<Host>,
    workers: Workers,
    config: ServeConfig,
}

/// Changes a server while it runs.
#[derive(Debug, Clone)]
pub struct Control {
    host: Arc<Host>,
    config: ServeConfig,
}

impl Control {
    /// Says anew who may read what, for requests from now on.
    ///
    /// # Errors
    /// [`Error::Exposed`]: the old rules hold then.
    pub fn set_access(&self, access: Access) -> Result<()> {
        ServeConfig { access: access.clone(), ..self.config.clone() }.check()?;
        self.host.site.set_access(access);
        Ok(())
    }

    /// Reads certificate and key again, for connections from now on.
    ///
    /// # Errors
    /// [`Error::Tls`]: the old ones stay in use then.
    pub fn reload_tls(&self) -> Result<()> {
        self.host.tls.as_ref().map_or(Ok(()), |tls| tls.reload())
    }
}

impl Server {
    /// Checks the configuration and binds the address. Needs a tokio runtime with I/O and time.
    ///
    /// # Errors
    /// [`Error::Exposed`], [`Error::Folder`], [`Error::Tls`], [`Error::Listen`] or [`Error::Thread`].
    pub async fn bind(config: ServeConfig) -> Result<Self> {
        config.check()?;
        let site = Site::open(&config)?;
        let tls = config.tls.clone().map(Tls::open).transpose()?.map(Arc::new);
        let failed = |source| Error::Listen { addr: config.listen, source };
        let listener = TcpListener::bind(config.listen).await.map_err(failed)?;
        let addr = listener.local_addr().map_err(failed)?;
        let router = routes::router(Arc::clone(&site), &config);
        let limits = ConnectionLimits::from(&config);
        let host = Arc::new(Host { site, router, tls, limits });
        let workers = Workers::start().map_err(Error::Thread)?;
        Ok(Self { listener, addr, host, workers, config })
    }

    /// The address it listens on, with the port that was taken for port 0.
    #[must_use]
    pub const fn local_addr(&self) -> SocketAddr {
        self.addr
    }

    /// `http://ADDRESS:PORT` or `https://…`, without a slash at the end.
    #[must_use]
    pub fn url(&self) -> String {
        let scheme = if self.host.tls.is_some() { "https" } else { "http" };
        format!("{scheme}://{}", self.addr)
    }

    /// What changes the server once it runs.
    #[must_use]
    pub fn control(&self) -> Control {
        Control { host: Arc::clone(&self.host), config: self.config.clone() }
    }

    /// Serves until `shutdown` is ready, goes on for [`ServeConfig::drain_delay`], then lets
    /// responses under way end within [`ServeConfig::drain_timeout`].
    pub async fn run(self, shutdown: impl Future<Output = ()>) {
        let graceful = GracefulShutdown::new();
        let mut connections = JoinSet::new();
        let (stop, stopping) = watch::channel(false);
        let site = Arc::clone(&self.host.site);
        let sweeping = tokio::spawn(Arc::clone(&site).sweep());
        let mut shutdown = pin!(async {
            shutdown.await;
            site.begin_drain();
            tokio::time::sleep(self.config.drain_delay).await;
        });
        let mut certificate_check = tokio::time::interval(CERTIFICATE_CHECK);
        certificate_check.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = &mut shutdown => break,
                Some(_) = connections.join_next(), if !connections.is_empty() => {}
                _ = certificate_check.tick(), if self.host.tls.is_some() => self.check_certificate(),
                accepted = self.listener.accept(),
                    if connections.len() < self.config.max_connections =>
                {
                    // From this thread's poller to that of the worker.
                    match accepted.and_then(|(stream, address)| Ok((stream.into_std()?, address))) {
                        Ok((stream, address)) => {
                            let (host, watcher) = (Arc::clone(&self.host), graceful.watcher());
                            let stopping = stopping.clone();
                            let (worker, seat) = self.workers.least_busy();
                            let serving = async move {
                                let _seat = seat;
                                match TcpStream::from_std(stream) {
                                    Ok(stream) => {
                                        connection::serve(stream, address, host, watcher, stopping)
                                            .await;
                                    }
                                    Err(e) => tracing::warn!("cannot serve {address}: {e}"),
                                }
                            };
                            connections.spawn_on(serving, worker);
                        }
                        Err(e) => recover(&e).await,
                    }
                }
            }
        }
        drop(self.listener);
        // It fails only where nobody listens.
        let _ = stop.send(true);
        let drained = async {
            graceful.shutdown().await;
            while connections.join_next().await.is_some() {}
        };
        if tokio::time::timeout(self.config.drain_timeout, drained).await.is_err() {
            tracing::warn!("{} connections cut off at shutdown", connections.len());
        }
        // What is stuck in a call of the system cannot be ended.
        let _ = tokio::time::timeout(LAST_WAIT, connections.shutdown()).await;
        sweeping.abort();
    }

    /// Takes a renewed certificate into use.
    fn check_certificate(&self) {
        let Some(tls) = self.host.tls.as_ref().filter(|tls| tls.has_changed()) else { return };
        match tls.reload() {
            Ok(()) => tracing::info!("certificate and key were read again"),
            Err(e) => tracing::error!("the old certificate stays in use: {e}"),
        }
    }
}

/// A failed accept concerns one connection, or the system is out of files: then a pause lets
/// others end.
async fn recover(error: &io::Error) {
    use io::ErrorKind;
    let is_of_the_peer = matches!(
        error.kind(),
        ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset | ErrorKind::ConnectionRefused
    );
    if !is_of_the_peer {
        tracing::warn!("cannot accept a connection: {error}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}
