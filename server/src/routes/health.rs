//! Whether the server lives, and whether it can do its work.

use std::sync::Arc;

use axum::{extract::State, http::StatusCode, response::IntoResponse};

use super::{Refusal, Site};

/// `GET /healthz`: `ok` for as long as the server answers at all. Nothing else is looked at: a
/// supervisor that restarts the server because a disk is away would not bring the disk back.
pub(super) async fn health() -> impl IntoResponse {
    "ok\n"
}

/// `GET /readyz`: `ok` while the datasets can be listed and the server is not about to stop, else
/// `503`: whoever spreads requests over several servers sends this one none.
pub(super) async fn readiness(State(site): State<Arc<Site>>) -> impl IntoResponse {
    if site.is_draining() {
        return Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the server is about to stop"));
    }
    match site.storage.list().await {
        Ok(_) => Ok("ok\n"),
        Err(_) => {
            Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, "the datasets cannot be listed"))
        }
    }
}
