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

#[cfg(test)]
mod tests {
    use std::sync::Barrier;

    use axum::{
        Router,
        routing::{MethodRouter, get},
    };
    use tokio::{
        io::{AsyncReadExt, AsyncWriteExt},
        sync::{Notify, oneshot},
        task::{JoinHandle, spawn_blocking},
        time::timeout,
    };

    use super::*;

    /// Far beyond what anything here takes: a test fails rather than hangs.
    const GUARD: Duration = Duration::from_secs(20);

    const REQUEST: &[u8] = b"GET / HTTP/1.1\r\nhost: x\r\n\r\n";

    struct Running {
        site: Arc<Site>,
        addr: SocketAddr,
        stop: oneshot::Sender<()>,
        running: JoinHandle<()>,
    }

    impl Running {
        /// A server that has this in place of all its routes.
        async fn start(handler: MethodRouter) -> Self {
            let folder = tempfile::tempdir().expect("temporary");
            let mut config = ServeConfig::new(folder.path(), SocketAddr::from(([127, 0, 0, 1], 0)));
            config.drain_timeout = Duration::from_millis(50);
            let mut server = Server::bind(config).await.expect("port 0 is free");
            let host = Arc::get_mut(&mut server.host).expect("nobody else has it yet");
            host.router = Router::new().route("/", handler);
            let (site, addr) = (Arc::clone(&host.site), server.addr);
            let (stop, stopped) = oneshot::channel();
            let running = tokio::spawn(server.run(async { stopped.await.unwrap_or_default() }));
            Self { site, addr, stop, running }
        }

        async fn connect(&self) -> TcpStream {
            TcpStream::connect(self.addr).await.expect("the server accepts")
        }

        async fn ask(&self) -> TcpStream {
            let mut stream = self.connect().await;
            stream.write_all(REQUEST).await.expect("the server reads");
            stream
        }

        async fn stop(self) -> bool {
            drop(self.stop);
            timeout(GUARD, self.running).await.is_ok_and(|ended| ended.is_ok())
        }
    }

    /// A call that comes back only when it is let.
    #[derive(Clone)]
    struct Stuck {
        begun: Arc<Notify>,
        end: Arc<Barrier>,
    }

    impl Stuck {
        fn new() -> Self {
            Self { begun: Arc::default(), end: Arc::new(Barrier::new(2)) }
        }

        fn call(&self) {
            self.begun.notify_one();
            self.end.wait();
        }
    }

    #[tokio::test]
    async fn it_ends_though_a_call_on_the_pool_does_not() {
        let stuck = Stuck::new();
        let called = stuck.clone();
        let handler = get(async move || _ = spawn_blocking(move || called.call()).await);
        let server = Running::start(handler).await;
        let _client = server.ask().await;
        stuck.begun.notified().await;
        assert!(server.stop().await);
        stuck.end.wait();
    }

    #[tokio::test]
    async fn it_ends_though_a_thread_of_connections_is_stuck_in_a_call() {
        let stuck = Stuck::new();
        let called = stuck.clone();
        let server = Running::start(get(async move || called.call())).await;
        let _client = server.ask().await;
        stuck.begun.notified().await;
        assert!(server.stop().await);
        stuck.end.wait();
    }

    #[tokio::test]
    async fn a_handler_that_panics_ends_its_connection_and_no_other() {
        async fn panics() {
            panic!("as a test");
        }
        let server = Running::start(get(panics)).await;
        let connections = &server.site.metrics.connections;
        let mut other = server.connect().await;
        // Taken before the one that panics, by whichever thread.
        while connections.get() < 1 {
            tokio::task::yield_now().await;
        }
        let mut answer = Vec::new();
        let ended = server.ask().await.read_to_end(&mut answer).await;
        assert!(ended.is_err() || answer.is_empty(), "{answer:?}");
        // It counts no longer once it has ended.
        let ended = async {
            while connections.get() > 1 {
                tokio::task::yield_now().await;
            }
        };
        timeout(GUARD, ended).await.expect("it still counts");
        other.write_all(b"HEAD /none HTTP/1.1\r\nhost: x\r\n\r\n").await.expect("it stands");
        other.read_exact(&mut [0; 12]).await.expect("an answer");
        assert!(server.stop().await);
    }
}
