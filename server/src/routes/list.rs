//! The list of datasets for programs.

use std::sync::Arc;

use axum::{Extension, Json, extract::State, http::header, response::IntoResponse};

use super::{Refusal, Site};
use crate::access::Rights;

/// `GET /datasets`: the list as JSON.
pub(super) async fn list(
    State(site): State<Arc<Site>>,
    Extension(rights): Extension<Rights>,
) -> Result<impl IntoResponse, Refusal> {
    let index = site.read_index(&rights).await?;
    Ok(([(header::CACHE_CONTROL, "no-cache")], Json(index)))
}
