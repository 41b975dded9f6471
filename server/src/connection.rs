//! One client's connection.

use std::{
    io::Cursor,
    net::SocketAddr,
    pin::{Pin, pin},
    sync::Arc,
    time::Duration,
};

use axum::Router;
use hyper::{
    server::conn::{http1, http2},
    service::{Service, service_fn},
};
use hyper_util::{
    rt::{TokioExecutor, TokioIo, TokioTimer},
    server::graceful::Watcher,
    service::TowerToHyperService,
};
use prometheus_client::metrics::gauge::Gauge;
use tokio::{
    io::{AsyncRead, AsyncReadExt, AsyncWrite},
    net::TcpStream,
    sync::watch,
    time::timeout,
};
use tokio_io_timeout::TimeoutStream;
use tower_http::add_extension::AddExtension;

use crate::{activity::Activity, config::ServeConfig, hot, peer::Peer, routes::Site, tls::Tls};

/// Most bytes of a request's head, and of a response waiting for the client besides the piece that
/// was read last.
const MAX_QUEUED_BYTES: usize = 64 << 10;
/// Most requests at a time of a connection of HTTP/2; each holds a buffer.
const MAX_STREAMS: u32 = 32;
/// What a client says first that speaks HTTP/2 without having agreed on it (RFC 9113, section 3.4).
const PREFACE: &[u8] = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n";

/// What every connection is held to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ConnectionLimits {
    pub(crate) head_timeout: Duration,
    pub(crate) write_timeout: Duration,
    pub(crate) response_timeout: Duration,
    pub(crate) max_body_bytes: usize,
}

impl From<&ServeConfig> for ConnectionLimits {
    fn from(config: &ServeConfig) -> Self {
        Self {
            head_timeout: config.head_timeout,
            write_timeout: config.write_timeout,
            response_timeout: config.response_timeout,
            max_body_bytes: config.max_body_bytes,
        }
    }
}

/// What all connections share.
#[derive(Debug)]
pub(crate) struct Host {
    pub(crate) site: Arc<Site>,
    pub(crate) router: Router,
    pub(crate) tls: Option<Arc<Tls>>,
    pub(crate) limits: ConnectionLimits,
}

/// Serves requests until the client leaves, breaks a limit, or the server stops.
pub(crate) async fn serve(
    stream: TcpStream,
    address: SocketAddr,
    host: Arc<Host>,
    watcher: Watcher,
    stopping: watch::Receiver<bool>,
) {
    let metrics = &host.site.metrics;
    metrics.accepted.inc();
    let _standing = Standing::begin(&metrics.connections);
    if let Err(e) = converse(stream, address, &host, watcher, stopping).await {
        tracing::debug!("connection of {address} ended: {e}");
    }
}

/// A connection that is counted until it ends, by a panic or cut off, too.
struct Standing<'a>(&'a Gauge);

impl<'a> Standing<'a> {
    fn begin(gauge: &'a Gauge) -> Self {
        gauge.inc();
        Self(gauge)
    }
}

impl Drop for Standing<'_> {
    fn drop(&mut self) {
        self.0.dec();
    }
}

type Failure = Box<dyn std::error::Error + Send + Sync>;

async fn converse(
    mut stream: TcpStream,
    address: SocketAddr,
    host: &Host,
    watcher: Watcher,
    stopping: watch::Receiver<bool>,
) -> Result<(), Failure> {
    // Without it, a small response waits for the acknowledgement of the one before: 40 ms.
    if let Err(e) = stream.set_nodelay(true) {
        tracing::debug!("connection without TCP_NODELAY: {e}");
    }
    let limits = host.limits;
    let peer = Peer { ip: address.ip(), is_encrypted: host.tls.is_some() };
    if let Some(tls) = &host.tls {
        let handshake = tls.acceptor().accept(limited(stream, limits));
        let stream = match timeout(limits.head_timeout, handshake).await {
            Ok(Ok(stream)) => stream,
            failed => {
                host.site.metrics.handshakes_failed.inc();
                failed??;
                return Ok(());
            }
        };
        let is_http2 = stream.get_ref().1.alpn_protocol() == Some(b"h2");
        return speak(stream, is_http2, peer, host, watcher, stopping).await;
    }
    let begun = hot::serve(&mut stream, &host.site, limits, stopping.clone()).await;
    let Some(begun) = begun else { return Ok(()) };
    let is_http2 = PREFACE.starts_with(&begun) || begun.starts_with(PREFACE);
    let (reader, writer) = stream.into_split();
    // What was read of a request already comes first.
    let stream = tokio::io::join(Cursor::new(begun).chain(reader), writer);
    speak(limited(stream, limits), is_http2, peer, host, watcher, stopping).await
}

fn limited<S>(stream: S, limits: ConnectionLimits) -> Pin<Box<TimeoutStream<S>>>
where
    S: AsyncRead + AsyncWrite,
{
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(limits.write_timeout));
    Box::pin(stream)
}

async fn speak<S>(
    stream: S,
    is_http2: bool,
    peer: Peer,
    host: &Host,
    watcher: Watcher,
    mut stopping: watch::Receiver<bool>,
) -> Result<(), Failure>
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let service = TowerToHyperService::new(AddExtension::new(host.router.clone(), peer));
    let stream = TokioIo::new(stream);
    let limits = host.limits;
    if is_http2 {
        let mut builder = http2::Builder::new(TokioExecutor::new());
        builder
            .timer(TokioTimer::new())
            .max_header_list_size(MAX_QUEUED_BYTES as u32)
            .max_concurrent_streams(MAX_STREAMS)
            .keep_alive_interval(Some(limits.head_timeout))
            .keep_alive_timeout(limits.write_timeout);
        let activity = Activity::new();
        let watched = service_fn(|request| {
            let (handling, answer) = (activity.begin(), service.call(request));
            async { answer.await.map(|response| handling.watch(response)) }
        });
        let mut connection = pin!(builder.serve_connection(stream, watched));
        let is_over = tokio::select! {
            ended = &mut connection => return Ok(ended?),
            () = activity.end(limits) => true,
            () = stop(&mut stopping) => false,
        };
        connection.as_mut().graceful_shutdown();
        if is_over {
            // What is not taken now never will be.
            timeout(limits.write_timeout, connection).await??;
        } else {
            connection.await?;
        }
        // The server waits until all watchers are gone.
        drop(watcher);
    } else {
        let mut builder = http1::Builder::new();
        builder
            .timer(TokioTimer::new())
            .header_read_timeout(limits.head_timeout)
            .max_buf_size(MAX_QUEUED_BYTES);
        watcher.watch(builder.serve_connection(stream, service)).await?;
    }
    Ok(())
}

/// Waits until the server stops.
async fn stop(stopping: &mut watch::Receiver<bool>) {
    // Where nobody is left to say so, it has.
    let _ = stopping.wait_for(|stop| *stop).await;
}
