//! What the server answers, one file per resource.

mod batch;
mod compressed;
mod dataset;
mod health;
mod list;
mod options;
mod page;

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use axum::{
    Router,
    extract::Request,
    http::{HeaderName, HeaderValue, Method, StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::get,
};
use tower_http::{
    cors::{Any, CorsLayer},
    timeout::TimeoutLayer,
};

use crate::{
    buffers::BufferPool,
    config::ServeConfig,
    error::Result,
    file::{DatasetFile, OpenError},
    folder::Folder,
    index::{DatasetIndex, IndexCache},
    offload::Offload,
    open_files::{OpenFiles, SWEEP_INTERVAL},
    private_copy::PrivateCopies,
};

use self::compressed::compressed;

pub(crate) use batch::OFFER as BATCH_OFFER;
pub(crate) use dataset::cache_control;

/// What all requests share.
#[derive(Debug)]
pub(crate) struct Site {
    folder: Folder,
    index: IndexCache,
    open_files: OpenFiles,
    pub(crate) buffers: Arc<BufferPool>,
    pub(crate) private_copies: Arc<PrivateCopies>,
    offload: Offload,
}

impl Site {
    pub(crate) fn open(config: &ServeConfig) -> Result<Arc<Self>> {
        Ok(Arc::new(Self {
            folder: Folder::open(config.dir.clone())?,
            index: IndexCache::default(),
            open_files: OpenFiles::default(),
            buffers: Arc::default(),
            private_copies: Arc::default(),
            offload: Offload::new(),
        }))
    }

    /// The dataset's file; `None` where no dataset can be called that.
    pub(crate) async fn dataset(
        self: &Arc<Self>,
        file_name: &str,
    ) -> Option<Result<Arc<DatasetFile>, OpenError>> {
        let path = self.folder.path_of(file_name)?;
        let site = Arc::clone(self);
        Some(self.offload.run(move || site.open_files.open(path)).await)
    }

    /// Lets go of files that nobody asks for any more, now and then; never ends.
    pub(crate) async fn sweep(self: Arc<Self>) {
        loop {
            tokio::time::sleep(SWEEP_INTERVAL).await;
            let site = Arc::clone(&self);
            // It fails only where it panics, which is on standard error then.
            let _ = tokio::task::spawn_blocking(move || site.open_files.sweep()).await;
        }
    }

    /// Reads the folder, off the runtime's threads.
    async fn read_index(self: Arc<Self>) -> Result<DatasetIndex, Refusal> {
        let reading = tokio::task::spawn_blocking(move || self.index.read(&self.folder));
        reading.await.map_err(std::io::Error::other).flatten().map_err(|e| {
            tracing::warn!("cannot read the folder of datasets: {e}");
            Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the folder of datasets cannot be read")
        })
    }
}

/// All routes over a site.
pub(crate) fn router(site: Arc<Site>, response_timeout: Duration) -> Router {
    Router::new()
        .route("/", compressed(get(page::page)))
        .route("/datasets", compressed(get(list::list)))
        .route("/datasets/{file}", get(dataset::dataset))
        .route("/datasets/{file}/batch", batch::route())
        .route("/healthz", get(health::health))
        .route("/{file}", get(dataset::dataset))
        .route("/{file}/batch", batch::route())
        .fallback(async || Refusal::new(StatusCode::NOT_FOUND, "nothing here; see /datasets"))
        .with_state(site)
        .layer(TimeoutLayer::with_status_code(StatusCode::GATEWAY_TIMEOUT, response_timeout))
        .layer(cross_origin())
        .layer(middleware::from_fn(options::options))
        .layer(middleware::from_fn(log_request))
}

/// What the CORS layer adds to every answer, for the answers that it does not see.
pub(crate) const CROSS_ORIGIN_FIELDS: &str = "access-control-allow-origin: *\r\n\
     access-control-expose-headers: lodestream-batch,accept-ranges,content-length,content-range,etag,\
     last-modified\r\n";

/// Datasets are public: any page may read them, and see the fields that range clients need.
fn cross_origin() -> CorsLayer {
    const ASKED: [HeaderName; 7] = [
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

/// One line per request, at level `debug`; the time is that until the response starts.
async fn log_request(request: Request, next: Next) -> Response {
    if !tracing::enabled!(tracing::Level::DEBUG) {
        return next.run(request).await;
    }
    let (method, uri) = (request.method().clone(), request.uri().clone());
    let range = request.headers().get(header::RANGE).cloned();
    let start = Instant::now();
    let response = next.run(request).await;
    let text = |field: Option<&HeaderValue>| {
        field.and_then(|value| value.to_str().ok()).unwrap_or("-").to_owned()
    };
    tracing::debug!(
        "{method} {} {} {} {} bytes {:.2} ms",
        uri.path(),
        text(range.as_ref()),
        response.status().as_u16(),
        text(response.headers().get(header::CONTENT_LENGTH)),
        start.elapsed().as_secs_f64() * 1e3,
    );
    response
}

/// A response that is one line of text.
#[derive(Debug)]
struct Refusal {
    status: StatusCode,
    line: String,
}

impl Refusal {
    fn new(status: StatusCode, line: impl Into<String>) -> Self {
        Self { status, line: line.into() }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        let fields = [
            (header::CONTENT_TYPE, "text/plain; charset=utf-8"),
            (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
            // What is not there may be a moment later.
            (header::CACHE_CONTROL, "no-store"),
        ];
        (self.status, fields, format!("{}\n", self.line)).into_response()
    }
}
