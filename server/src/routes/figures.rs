//! The server's figures, for Prometheus.

use std::sync::Arc;

use axum::{
    Extension,
    extract::State,
    http::{StatusCode, header},
    response::IntoResponse,
};

use super::{Refusal, Site};
use crate::access::Rights;

/// `GET /metrics`. The figures name datasets: where there are rules, only a token that says
/// `metrics` opens them.
pub(super) async fn figures(
    State(site): State<Arc<Site>>,
    Extension(rights): Extension<Rights>,
) -> Result<impl IntoResponse, Refusal> {
    if !rights.may_read_metrics() {
        site.metrics.denied.inc();
        return Err(Refusal::new(StatusCode::NOT_FOUND, "nothing here; see /datasets"));
    }
    let fields = [
        (header::CONTENT_TYPE, "application/openmetrics-text; version=1.0.0; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    Ok((fields, site.metrics.render()))
}
