//! One client's connection.

use std::{io::Cursor, sync::Arc, time::Duration};

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::{
    rt::{TokioIo, TokioTimer},
    server::graceful::Watcher,
    service::TowerToHyperService,
};
use tokio::{io::AsyncReadExt, net::TcpStream, sync::watch};
use tokio_io_timeout::TimeoutStream;

use crate::{config::ServeConfig, hot, routes::Site};

/// Most bytes of a request's head, and of a response waiting for the client besides the piece that
/// was read last.
const MAX_QUEUED_BYTES: usize = 64 << 10;

/// What every connection is held to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ConnectionLimits {
    pub(crate) head_timeout: Duration,
    pub(crate) write_timeout: Duration,
}

impl From<&ServeConfig> for ConnectionLimits {
    fn from(config: &ServeConfig) -> Self {
        Self { head_timeout: config.head_timeout, write_timeout: config.write_timeout }
    }
}

/// Serves requests until the client leaves, breaks a limit, or the server stops.
pub(crate) async fn serve(
    stream: TcpStream,
    site: Arc<Site>,
    router: Router,
    limits: ConnectionLimits,
    watcher: Watcher,
    stopping: watch::Receiver<bool>,
) {
    // Without it, a small response waits for the acknowledgement of the one before: 40 ms.
    if let Err(e) = stream.set_nodelay(true) {
        tracing::debug!("connection without TCP_NODELAY: {e}");
    }
    let Some(begun) = hot::serve(&stream, &site, limits, stopping).await else { return };
    let (reader, writer) = stream.into_split();
    // What was read of the request already comes first.
    let stream = tokio::io::join(Cursor::new(begun).chain(reader), writer);
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
