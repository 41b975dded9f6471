//! Whether the server can do its work.

use std::sync::Arc;

use axum::{extract::State, http::StatusCode, response::IntoResponse};

use super::{Refusal, Site};

/// `GET /healthz`: `ok` while the folder can be read, else `503`.
pub(super) async fn health(State(site): State<Arc<Site>>) -> impl IntoResponse {
    let listing = tokio::task::spawn_blocking(move || site.folder.file_names());
    match listing.await {
        Ok(Ok(_)) => Ok("ok\n"),
        _ => Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the folder cannot be read")),
    }
}
