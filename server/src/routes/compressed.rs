//! Compressed answers, for what is text. Payloads are compressed as they are: no route of theirs is here.

use axum::{
    body::{Body, to_bytes},
    extract::Request,
    http::{HeaderValue, Method, StatusCode, header},
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing::MethodRouter,
};
use tower_http::compression::CompressionLayer;

/// More than any list or page here.
const MAX_TEXT_BYTES: usize = 64 << 20;

/// The route, compressed with gzip for clients that take it, and always with a length.
pub(super) fn compressed<S>(route: MethodRouter<S>) -> MethodRouter<S>
where
    S: Clone + Send + Sync + 'static,
{
    route.layer(CompressionLayer::new()).layer(middleware::from_fn(with_length))
}

/// What is compressed on its way has no length before its end. Texts are short: they can wait for it,
/// and whoever reads them can see that all of it has come.
async fn with_length(request: Request, next: Next) -> Response {
    let is_head = request.method() == Method::HEAD;
    let response = next.run(request).await;
    if is_head || response.headers().contains_key(header::CONTENT_LENGTH) {
        return response;
    }
    let (mut head, body) = response.into_parts();
    let Ok(bytes) = to_bytes(body, MAX_TEXT_BYTES).await else {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    };
    head.headers.insert(header::CONTENT_LENGTH, HeaderValue::from(bytes.len()));
    Response::from_parts(head, Body::from(bytes))
}
