//! What may be asked of a resource.

use axum::{
    extract::Request,
    http::{Method, StatusCode, Version, header},
    middleware::Next,
    response::{IntoResponse, Response},
};

/// Refuses HTTP/1.1 without a host, or with two (RFC 9112, section 3.2).
pub(super) async fn host(request: Request, next: Next) -> Response {
    let hosts = request.headers().get_all(header::HOST).iter().count();
    if request.version() == Version::HTTP_11 && hosts != 1 {
        return (StatusCode::BAD_REQUEST, "a request of HTTP/1.1 names its host, once\n")
            .into_response();
    }
    next.run(request).await
}

/// Answers `OPTIONS` (RFC 9110, section 9.3.7), save a browser's question whether a page from elsewhere
/// may ask, which the CORS layer behind answers. The answer is the same for all addresses, so that it
/// tells nothing of what is there.
pub(super) async fn options(request: Request, next: Next) -> Response {
    let is_preflight = request.headers().contains_key(header::ACCESS_CONTROL_REQUEST_METHOD);
    if request.method() != Method::OPTIONS || is_preflight {
        return next.run(request).await;
    }
    let path = request.uri().path();
    let allowed = if path.ends_with("/batch") { "POST, OPTIONS" } else { "GET, HEAD, OPTIONS" };
    (StatusCode::NO_CONTENT, [(header::ALLOW, allowed)]).into_response()
}
