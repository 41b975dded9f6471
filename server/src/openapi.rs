//! What of the server is JSON, described as OpenAPI 3.1: for programs that look for datasets.

use axum::{Json, http::header, response::IntoResponse};
use utoipa::OpenApi;

use crate::index::DatasetIndex;

/// The document; the functions below only carry what it says of each route.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "lodestream",
        description = "Datasets of points with levels of detail, by byte range. Addresses are relative \
                       to that of the list; a dataset that may not be read does not exist.",
    ),
    paths(datasets, file, preview, batch, healthz, readyz, metrics),
    components(schemas(DatasetIndex)),
    security((), ("token" = [])),
    modifiers(&Token),
)]
struct Document;

/// Says how tokens are sent.
struct Token;

impl utoipa::Modify for Token {
    fn modify(&self, document: &mut utoipa::openapi::OpenApi) {
        use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
        let scheme = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
        let components = document.components.get_or_insert_default();
        components.add_security_scheme("token", SecurityScheme::Http(scheme));
    }
}

#[utoipa::path(get, path = "/datasets", responses(
    (status = 200, description = "What may be read", body = DatasetIndex),
    (status = 401, description = "The token is not known"),
    (status = 503, description = "The datasets cannot be listed"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn datasets() {}

#[utoipa::path(get, path = "/datasets/{file}", params(
    ("file" = String, Path, description = "The dataset's name and .lods"),
    ("v" = Option<String>, Query, description = "Its content_id: brings this content or none"),
    ("Range" = Option<String>, Header, description = "Ranges of bytes, as RFC 9110 has them"),
), responses(
    (status = 200, description = "The whole file", content_type = "application/octet-stream"),
    (status = 206, description = "The ranges", content_type = "application/octet-stream"),
    (status = 304, description = "The client has it already"),
    (status = 404, description = "There is none, or not for whoever asks"),
    (status = 412, description = "It is not the one that the condition names"),
    (status = 416, description = "It is shorter than that"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn file() {}

#[utoipa::path(get, path = "/datasets/{file}/preview.png", params(
    ("file" = String, Path, description = "The dataset's name and .lods"),
    ("v" = Option<String>, Query, description = "Its content_id: brings this content's or none"),
), responses(
    (status = 200, description = "A small picture of it", content_type = "image/png"),
    (status = 404, description = "There is none"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn preview() {}

#[utoipa::path(post, path = "/datasets/{file}/batch", params(
    ("file" = String, Path, description = "The dataset's name and .lods"),
), request_body(
    description = "A batch request, as docs/PROTOCOL.md has it",
    content_type = "application/vnd.lodestream.batch-request",
), responses(
    (status = 200, description = "The parts, in the order asked for"),
    (status = 404, description = "There is none, or not for whoever asks"),
    (status = 412, description = "The dataset was replaced"),
    (status = 416, description = "A part reaches beyond the dataset"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn batch() {}

#[utoipa::path(get, path = "/healthz", responses((status = 200, description = "The server lives")))]
#[expect(dead_code, reason = "carries a description only")]
fn healthz() {}

#[utoipa::path(get, path = "/readyz", responses(
    (status = 200, description = "The server can do its work"),
    (status = 503, description = "It cannot, or is about to stop"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn readyz() {}

#[utoipa::path(get, path = "/metrics", responses(
    (status = 200, description = "Figures", content_type = "application/openmetrics-text"),
    (status = 404, description = "Not for whoever asks"),
))]
#[expect(dead_code, reason = "carries a description only")]
fn metrics() {}

/// `GET /openapi.json`.
pub(crate) async fn document() -> impl IntoResponse {
    ([(header::CACHE_CONTROL, "public, max-age=3600")], Json(Document::openapi()))
}
