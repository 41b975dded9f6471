//! The list of datasets for programs.

use std::sync::Arc;

use axum::{Json, extract::State, http::header, response::IntoResponse};

use super::{Refusal, Site};

/// `GET /datasets`: the list as JSON.
pub(super) async fn list(State(site): State<Arc<Site>>) -> Result<impl IntoResponse, Refusal> {
    let index = site.read_index().await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(index)))
}
