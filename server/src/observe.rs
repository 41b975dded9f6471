//! Every request is counted, and logged where the operator wants that.
//!
//! Both happen when the response ends, not when it begins: only then is known how many bytes the
//! client took. Whose client goes away before it begins has the status 499, as nginx has it. A log line has the path and the client's address; it never has the query, which may
//! hold a signature, nor the `Authorization` field.

use std::{
    net::IpAddr,
    pin::Pin,
    sync::{Arc, LazyLock},
    task::{Context, Poll},
    time::{Duration, Instant},
};

use axum::{
    body::Body,
    extract::{MatchedPath, Request, State},
    http::{HeaderValue, Method, StatusCode, Uri, Version, header},
    middleware::Next,
    response::Response,
};
use bytes::Bytes;
use http_body::{Body as HttpBody, Frame, SizeHint};

use crate::{
    metrics::{Answered, Kind},
    peer::Peer,
    routes::Site,
};

/// Which dataset a response is from; a response's extension that routes leave for the log and the
/// figures, on success alone.
#[derive(Debug, Clone)]
pub(crate) struct ServedDataset(pub(crate) String);

/// The name of the token that a request came with; likewise.
#[derive(Debug, Clone)]
pub(crate) struct Holder(pub(crate) String);

/// The status of a request whose client does not wait for the response.
static CLIENT_CLOSED: LazyLock<StatusCode> =
    LazyLock::new(|| StatusCode::from_u16(499).expect("three digits"));

/// Counts and logs.
pub(crate) async fn observe(
    State(site): State<Arc<Site>>,
    route: Option<MatchedPath>,
    request: Request,
    next: Next,
) -> Response {
    let start = Instant::now();
    let kind = Kind::of(route.as_ref().map(MatchedPath::as_str));
    let is_head = request.method() == Method::HEAD;
    let entry = site.access_log.then(|| Entry::of(&site, &request));
    let mut record = Record {
        site,
        entry,
        kind,
        dataset: String::new(),
        holder: None,
        status: *CLIENT_CLOSED,
        bytes: 0,
        start,
        until_first_byte: None,
        is_whole: false,
    };
    let mut response = next.run(request).await;
    let extensions = response.extensions_mut();
    record.dataset = extensions.remove().map_or_else(String::new, |ServedDataset(name)| name);
    record.holder = extensions.remove().map(|Holder(name)| name);
    record.status = response.status();
    record.until_first_byte = Some(start.elapsed());
    // A body of nothing is never looked at, nor is what `HEAD` leaves out.
    record.is_whole = is_head || response.body().is_end_stream();
    response.map(|body| Body::new(ObservedBody { inner: body, record }))
}

/// What the log tells of a request.
#[derive(Debug)]
struct Entry {
    client: Option<IpAddr>,
    method: Method,
    uri: Uri,
    version: Version,
    range: Option<HeaderValue>,
}

impl Entry {
    fn of(site: &Site, request: &Request) -> Self {
        let peer = request.extensions().get::<Peer>();
        Self {
            client: peer.map(|peer| peer.client(request.headers(), &site.trusted_proxies)),
            method: request.method().clone(),
            uri: request.uri().clone(),
            version: request.version(),
            range: request.headers().get(header::RANGE).cloned(),
        }
    }
}

/// What is known of a request and its response; told when it is dropped, which is when the response
/// has ended in whatever way.
#[derive(Debug)]
struct Record {
    site: Arc<Site>,
    entry: Option<Entry>,
    kind: Kind,
    dataset: String,
    holder: Option<String>,
    status: StatusCode,
    bytes: u64,
    start: Instant,
    until_first_byte: Option<Duration>,
    is_whole: bool,
}

impl Drop for Record {
    fn drop(&mut self) {
        let until_last_byte = self.start.elapsed();
        if std::thread::panicking() && self.until_first_byte.is_none() {
            self.status = StatusCode::INTERNAL_SERVER_ERROR;
        }
        let until_first_byte = self.until_first_byte.unwrap_or(until_last_byte);
        self.site.metrics.count(&Answered {
            dataset: &self.dataset,
            kind: self.kind,
            status: self.status.as_u16(),
            bytes: self.bytes,
            until_first_byte,
            until_last_byte,
            is_whole: self.is_whole,
        });
        let Some(entry) = &self.entry else { return };
        let ms = |time: Duration| (time.as_secs_f64() * 1e5).round() / 1e2;
        tracing::info!(
            target: "access",
            client = %entry.client.map_or_else(|| "-".into(), |ip| ip.to_string()),
            method = %entry.method,
            path = entry.uri.path(),
            version = ?entry.version,
            range = entry.range.as_ref().and_then(|value| value.to_str().ok()),
            status = self.status.as_u16(),
            bytes = self.bytes,
            first_byte_ms = ms(until_first_byte),
            last_byte_ms = ms(until_last_byte),
            kind = self.kind.name(),
            token = self.holder.as_deref(),
            broken = (!self.is_whole).then_some(true),
        );
    }
}

/// A body that counts its bytes.
#[derive(Debug)]
struct ObservedBody {
    inner: Body,
    record: Record,
}

impl HttpBody for ObservedBody {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        let polled = Pin::new(&mut self.inner).poll_frame(cx);
        match &polled {
            Poll::Ready(Some(Ok(frame))) => {
                self.record.bytes += frame.data_ref().map_or(0, |data| data.len() as u64);
                self.record.is_whole = self.inner.is_end_stream();
            }
            Poll::Ready(None) => self.record.is_whole = true,
            _ => {}
        }
        polled
    }

    fn is_end_stream(&self) -> bool {
        self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.inner.size_hint()
    }
}

#[cfg(test)]
mod tests {
    use std::{future::pending, net::SocketAddr};

    use axum::{
        Router,
        middleware::from_fn_with_state,
        routing::{MethodRouter, get},
    };
    use hyper::service::Service;
    use hyper_util::service::TowerToHyperService;

    use super::*;
    use crate::ServeConfig;

    fn site() -> (tempfile::TempDir, Arc<Site>) {
        let folder = tempfile::tempdir().expect("temporary");
        let config = ServeConfig::new(folder.path(), SocketAddr::from(([127, 0, 0, 1], 0)));
        let site = Site::open(&config).expect("a folder");
        (folder, site)
    }

    async fn ask(site: &Arc<Site>, handler: MethodRouter) -> Response {
        let router = Router::new()
            .route("/healthz", handler)
            .layer(from_fn_with_state(Arc::clone(site), observe));
        let request = Request::get("/healthz").body(Body::empty()).expect("a request");
        let answer = TowerToHyperService::new(router).call(request).await;
        answer.unwrap_or_else(|never| match never {})
    }

    #[tokio::test]
    async fn who_goes_away_before_the_response_is_counted() {
        let (_folder, site) = site();
        let answer = ask(&site, get(pending::<()>));
        let waiting = tokio::time::timeout(Duration::from_millis(10), answer);
        assert!(waiting.await.is_err(), "never answered");
        let figures = site.metrics.render();
        assert!(figures.contains("status=\"499\"} 1"), "{figures}");
    }

    #[tokio::test]
    async fn a_handler_that_panics_is_counted_as_the_servers_fault() {
        async fn panics() {
            panic!("as a test");
        }
        let (_folder, site) = site();
        let asking = {
            let site = Arc::clone(&site);
            tokio::spawn(async move { ask(&site, get(panics)).await })
        };
        assert!(asking.await.is_err_and(|e| e.is_panic()), "it goes on to the connection's task");
        let figures = site.metrics.render();
        assert!(figures.contains("status=\"500\"} 1"), "{figures}");
        assert!(figures.contains("responses_broken_total{dataset=\"\",kind=\"operation\"} 1"));
    }
}
