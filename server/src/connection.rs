//! One client's connection.

use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::graceful::Watcher,
    service::TowerToHyperService,
};
use tokio::net::TcpStream;
use tokio_io_timeout::TimeoutStream;

use crate::config::ServeConfig;

/// Most bytes of a request's head, and of a response waiting for the client besides the piece that
/// was read last.
const MAX_QUEUED_BYTES: usize = 64 << 10;

/// What every connection is held to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ConnectionLimits {
    head_timeout: Duration,
    write_timeout: Duration,
}

impl From<&ServeConfig> for ConnectionLimits {
    fn from(config: &ServeConfig) -> Self {
        Self { head_timeout: config.head_timeout, write_timeout: config.write_timeout }
    }
}

/// Serves requests until the client leaves, breaks a limit, or the server stops.
pub(crate) async fn serve(
    stream: TcpStream,
    router: Router,
    limits: ConnectionLimits,
    watcher: Watcher,
) {
    // Without it, a small response waits for the acknowledgement of the one before: 40 ms.
    if let Err(e) = stream.set_nodelay(true) {
        tracing::debug!("connection without TCP_NODELAY: {e}");
    }
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(limits.write_timeout));
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(limits.head_timeout)
        .max_buf_size(MAX_QUEUED_BYTES)
        .serve_connection(TokioIo::new(Box::pin(stream)), TowerToHyperService::new(router));
    if let Err(e) = watcher.watch(connection).await {
        tracing::debug!("connection ended: {e}");
    }
}
