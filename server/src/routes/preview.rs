//! A dataset's picture, which the build has left beside it.

use std::sync::Arc;

use axum::{
    extract::{Path, RawQuery, State},
    http::{HeaderValue, StatusCode, header},
    response::IntoResponse,
};
use lodestream_preprocess::preview::preview_content_id;

use super::{Refusal, Site, dataset};
use crate::file::OpenError;

/// `GET` of a preview: only one that shows the very content that the dataset has now.
pub(super) async fn preview(
    State(site): State<Arc<Site>>,
    Path(file_name): Path<String>,
    RawQuery(query): RawQuery,
) -> Result<impl IntoResponse, Refusal> {
    let opened = dataset::open(&site, &file_name, query.as_deref()).await?;
    let content_id = opened.file.validators.etag.trim_matches('"').to_owned();
    let picture = match site.storage.preview(&file_name).await {
        // Whether there is one, nobody knows.
        Err(OpenError::Unanswered) => return Err(dataset::unanswered(&file_name)),
        picture => picture.ok(),
    };
    let picture = picture.filter(|picture| preview_content_id(&picture.bytes) == Some(content_id));
    let Some(picture) = picture else {
        let line = "there is no picture of this dataset; `lodestream-server preview` makes one";
        return Err(Refusal::new(StatusCode::NOT_FOUND, line));
    };
    let fields = [
        (header::CONTENT_TYPE, HeaderValue::from_static("image/png")),
        (header::CACHE_CONTROL, opened.cache_control()),
        (header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff")),
    ];
    Ok((fields, picture.bytes))
}
