//! The server: a bound socket, then a loop that accepts connections until it is asked to stop.
//!
//! The loop is axum's own, but for what that one does not offer: a limit on connections, timeouts
//! on slow clients, and an end to draining.

use std::{future::Future, net::SocketAddr, pin::pin, sync::Arc, time::Duration};

use axum::Router;
use hyper_util::server::graceful::GracefulShutdown;
use tokio::{net::TcpListener, sync::watch, task::JoinSet};

use crate::{
    config::ServeConfig,
    connection::{self, ConnectionLimits},
    error::{Error, Result},
    routes::{self, Site},
};

/// A server that is bound to its address.
#[derive(Debug)]
pub struct Server {
    listener: TcpListener,
    addr: SocketAddr,
    router: Router,
    site: Arc<Site>,
    config: ServeConfig,
}

impl Server {
    /// Checks the folder and binds the address. Needs a tokio runtime with I/O and time.
    ///
    /// # Errors
    /// [`Error::Folder`] or [`Error::Listen`].
    pub async fn bind(config: ServeConfig) -> Result<Self> {
        let site = Site::open(&config)?;
        let failed = |source| Error::Listen { addr: config.listen, source };
        let listener = TcpListener::bind(config.listen).await.map_err(failed)?;
        let addr = listener.local_addr().map_err(failed)?;
        let router = routes::router(Arc::clone(&site), config.response_timeout);
        Ok(Self { listener, addr, router, site, config })
    }

    /// The address it listens on, with the port that was taken for port 0.
    #[must_use]
    pub const fn local_addr(&self) -> SocketAddr {
        self.addr
    }

    /// Serves until `shutdown` is ready, then lets responses under way end within
    /// [`ServeConfig::drain_timeout`].
    pub async fn run(self, shutdown: impl Future<Output = ()>) {
        let limits = ConnectionLimits::from(&self.config);
        let graceful = GracefulShutdown::new();
        let mut connections = JoinSet::new();
        let (stop, stopping) = watch::channel(false);
        let sweeping = tokio::spawn(Arc::clone(&self.site).sweep());
        let mut shutdown = pin!(shutdown);
        loop {
            tokio::select! {
                () = &mut shutdown => break,
                Some(_) = connections.join_next(), if !connections.is_empty() => {}
                accepted = self.listener.accept(),
                    if connections.len() < self.config.max_connections =>
                {
                    match accepted {
                        Ok((stream, _)) => {
                            let (site, router) = (Arc::clone(&self.site), self.router.clone());
                            let (watcher, stopping) = (graceful.watcher(), stopping.clone());
                            connections.spawn(connection::serve(
                                stream, site, router, limits, watcher, stopping,
                            ));
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
        connections.shutdown().await;
        sweeping.abort();
    }
}

/// A failed accept concerns one connection, or the system is out of files: then a pause lets
/// others end.
async fn recover(error: &std::io::Error) {
    use std::io::ErrorKind;
    let is_of_the_peer = matches!(
        error.kind(),
        ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset | ErrorKind::ConnectionRefused
    );
    if !is_of_the_peer {
        tracing::warn!("cannot accept a connection: {error}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}
