//! What the server answers, one file per resource.

mod batch;
mod compressed;
mod dataset;
mod figures;
mod guard;
mod health;
mod list;
mod options;
mod page;
mod preview;

use std::{
    net::IpAddr,
    sync::{
        Arc, PoisonError, RwLock,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use axum::{
    Router,
    http::{HeaderName, Method, StatusCode, header},
    middleware,
    response::{IntoResponse, Response},
    routing::get,
};
use tower_http::{
    catch_panic::CatchPanicLayer,
    cors::{Any, CorsLayer},
    limit::RequestBodyLimitLayer,
    timeout::TimeoutLayer,
};

use crate::{
    access::{Access, Rights},
    buffers::BufferPool,
    config::ServeConfig,
    error::Result,
    file::{DatasetFile, OpenError},
    index::{DatasetIndex, IndexCache},
    metrics::Metrics,
    observe::observe,
    offload::Offload,
    openapi,
    private_copy::PrivateCopies,
    rate::RateLimiter,
    storage::{SWEEP_INTERVAL, Storage},
};

use self::compressed::compressed;

pub(crate) use batch::{OFFER as BATCH_OFFER, reaches_beyond, segments as batch_segments};
pub(crate) use dataset::{cache_control, unanswered};

/// What all requests share.
#[derive(Debug)]
pub(crate) struct Site {
    storage: Arc<Storage>,
    index: IndexCache,
    pub(crate) buffers: Arc<BufferPool>,
    pub(crate) private_copies: Arc<PrivateCopies>,
    offload: Offload,
    access: RwLock<Arc<Access>>,
    rate: Option<RateLimiter>,
    is_draining: AtomicBool,
    pub(crate) trusted_proxies: Vec<IpAddr>,
    pub(crate) access_log: bool,
    pub(crate) metrics: Metrics,
}

impl Site {
    pub(crate) fn open(config: &ServeConfig) -> Result<Arc<Self>> {
        let metrics = Metrics::new();
        Ok(Arc::new(Self {
            storage: Arc::new(Storage::open(config, &metrics.storage)?),
            index: IndexCache::default(),
            buffers: Arc::default(),
            private_copies: Arc::default(),
            offload: Offload::new(),
            access: RwLock::new(Arc::new(config.access.clone())),
            rate: config.rate.map(RateLimiter::new),
            is_draining: AtomicBool::new(false),
            trusted_proxies: config.trusted_proxies.clone(),
            access_log: config.access_log,
            metrics,
        }))
    }

    /// Whether plain ranges may go the short way, past all layers: only where none of them has
    /// anything to do with a request.
    pub(crate) fn has_short_way(&self) -> bool {
        let is_open = matches!(*self.access(), Access::Open);
        is_open && self.rate.is_none() && !self.access_log
    }

    /// The dataset's file.
    pub(crate) async fn dataset(&self, file_name: &str) -> Result<Arc<DatasetFile>, OpenError> {
        self.storage.dataset(file_name, &self.offload).await
    }

    /// The rules in force.
    fn access(&self) -> Arc<Access> {
        Arc::clone(&self.access.read().unwrap_or_else(PoisonError::into_inner))
    }

    pub(crate) fn set_access(&self, access: Access) {
        *self.access.write().unwrap_or_else(PoisonError::into_inner) = Arc::new(access);
    }

    /// From now on the server is not ready for further clients.
    pub(crate) fn begin_drain(&self) {
        self.is_draining.store(true, Ordering::Relaxed);
    }

    fn is_draining(&self) -> bool {
        self.is_draining.load(Ordering::Relaxed)
    }

    /// Lets go of files whose names lead elsewhere by now, every so often; never ends.
    pub(crate) async fn sweep(self: Arc<Self>) {
        loop {
            tokio::time::sleep(SWEEP_INTERVAL).await;
            self.storage.sweep().await;
        }
    }

    /// What there is for whoever has these rights.
    async fn read_index(&self, rights: &Rights) -> Result<DatasetIndex, Refusal> {
        let mut index = self.index.read(&self.storage).await.map_err(|e| {
            tracing::warn!("cannot list the datasets: {e}");
            Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the datasets cannot be listed")
        })?;
        index.keep_readable(rights);
        Ok(index)
    }
}

/// All routes over a site.
pub(crate) fn router(site: Arc<Site>, config: &ServeConfig) -> Router {
    // Whatever is asked of one dataset belongs here: a route with a `{file}`, behind the guard.
    let of_datasets = Router::new()
        .route("/datasets/{file}", get(dataset::dataset))
        .route("/datasets/{file}/batch", batch::route())
        .route("/datasets/{file}/preview.png", get(preview::preview))
        .route("/{file}", get(dataset::dataset))
        .route("/{file}/batch", batch::route())
        .route_layer(middleware::from_fn_with_state(Arc::clone(&site), guard::may_read));
    let routes = Router::new()
        .route("/", compressed(get(page::page)))
        .route("/datasets", compressed(get(list::list)))
        .route("/openapi.json", compressed(get(openapi::document)))
        .route("/healthz", get(health::health))
        .route("/readyz", get(health::readiness))
        .route("/metrics", get(figures::figures))
        .merge(of_datasets)
        .fallback(async || Refusal::new(StatusCode::NOT_FOUND, "nothing here; see /datasets"))
        .with_state(Arc::clone(&site));
    layered(routes, site, config)
}

/// What every request goes through, from the last to the first.
fn layered(routes: Router, site: Arc<Site>, config: &ServeConfig) -> Router {
    routes
        .layer(RequestBodyLimitLayer::new(config.max_body_bytes))
        .layer(TimeoutLayer::with_status_code(StatusCode::GATEWAY_TIMEOUT, config.response_timeout))
        .layer(middleware::from_fn_with_state(Arc::clone(&site), guard::admit))
        .layer(CatchPanicLayer::custom(on_panic))
        .layer(cross_origin())
        .layer(middleware::from_fn(options::options))
        .layer(middleware::from_fn(options::host))
        .layer(middleware::from_fn_with_state(site, observe))
}

/// What the CORS layer adds to every answer, for the answers that it does not see.
pub(crate) const CROSS_ORIGIN_FIELDS: &str = "access-control-allow-origin: *\r\n\
     access-control-expose-headers: lodestream-batch,accept-ranges,content-length,content-range,etag,\
     last-modified\r\n";

/// Any page may read what its user may, and see the fields that range clients need. Rights come from
/// what the page itself sends, never from cookies.
fn cross_origin() -> CorsLayer {
    const ASKED: [HeaderName; 8] = [
        header::AUTHORIZATION,
        header::CONTENT_TYPE,
        header::RANGE,
        header::IF_RANGE,
        header::IF_MATCH,
        header::IF_NONE_MATCH,
        header::IF_MODIFIED_SINCE,
        header::IF_UNMODIFIED_SINCE,
    ];
    const TOLD: [HeaderName; 6] = [
        dataset::BATCH_OFFER,
        header::ACCEPT_RANGES,
        header::CONTENT_LENGTH,
        header::CONTENT_RANGE,
        header::ETAG,
        header::LAST_MODIFIED,
    ];
    CorsLayer::new()
        .allow_origin(Any)
        .allow_methods([Method::GET, Method::HEAD, Method::POST])
        .allow_headers(ASKED)
        .expose_headers(TOLD)
        .max_age(Duration::from_secs(24 * 60 * 60))
}

/// One request is lost, not the connection and the others on it. The system's hook has told the log.
fn on_panic(_: Box<dyn std::any::Any + Send>) -> Response {
    Refusal::new(StatusCode::INTERNAL_SERVER_ERROR, "the server's fault; its log says more")
        .into_response()
}

/// There is no such dataset; or not for whoever asks, which nobody can tell from this.
fn missing(file_name: &str) -> Refusal {
    let line = format!("no dataset file {file_name:?} here; /datasets lists all");
    Refusal::new(StatusCode::NOT_FOUND, line)
}

/// A response that is one line of text.
#[derive(Debug)]
pub(crate) struct Refusal {
    status: StatusCode,
    line: String,
}

impl Refusal {
    fn new(status: StatusCode, line: impl Into<String>) -> Self {
        Self { status, line: line.into() }
    }

    /// Status, fields and body.
    pub(crate) fn into_parts(self) -> (StatusCode, [(HeaderName, &'static str); 3], String) {
        let fields = [
            (header::CONTENT_TYPE, "text/plain; charset=utf-8"),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            // What is not there may be a moment later.
            (header::CACHE_CONTROL, "no-store"),
        ];
        (self.status, fields, format!("{}\n", self.line))
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        self.into_parts().into_response()
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use axum::{body::to_bytes, extract::Request};
    use hyper::service::Service;
    use hyper_util::service::TowerToHyperService;

    use super::*;
    use crate::peer::Peer;

    #[tokio::test]
    async fn a_handler_that_panics_is_a_refusal_and_the_servers_fault() {
        async fn panics() {
            panic!("as a test");
        }
        let folder = tempfile::tempdir().expect("temporary");
        let config = ServeConfig::new(folder.path(), SocketAddr::from(([127, 0, 0, 1], 0)));
        let site = Site::open(&config).expect("a folder");
        let router =
            layered(Router::new().route("/healthz", get(panics)), Arc::clone(&site), &config);
        let request = Request::get("/healthz").header(header::HOST, "x");
        let peer = Peer { ip: [127, 0, 0, 1].into(), is_encrypted: false };
        let request = request.extension(peer).body(axum::body::Body::empty()).expect("a request");
        let answer = TowerToHyperService::new(router).call(request).await;
        let answer = answer.unwrap_or_else(|never| match never {});
        assert_eq!(answer.status(), StatusCode::INTERNAL_SERVER_ERROR);
        assert_eq!(answer.headers()[header::ACCESS_CONTROL_ALLOW_ORIGIN], "*");
        let body = to_bytes(answer.into_body(), 1000).await.expect("a body");
        assert_eq!(body, "the server's fault; its log says more\n");
        let figures = site.metrics.render();
        assert!(figures.contains("status=\"500\"} 1"), "{figures}");
    }
}
