//! A dataset's file: whole, by range, or not again.

use std::{sync::Arc, time::SystemTime};

use axum::{
    body::Body,
    extract::{Path, State},
    http::{HeaderMap, HeaderValue, Method, StatusCode, header, response::Builder},
    response::{IntoResponse, Response},
};

use super::{Refusal, Site};
use crate::{
    body::FileBody,
    conditional::Verdict,
    file::{DatasetFile, OpenError},
    range::Selection,
};

/// A dataset never changes under its name.
const FOREVER: HeaderValue = HeaderValue::from_static("public, max-age=31536000, immutable");

/// `GET` and `HEAD` of a dataset. (For `HEAD` axum drops the body, which has read nothing yet.)
pub(super) async fn dataset(
    State(site): State<Arc<Site>>,
    Path(file_name): Path<String>,
    method: Method,
    headers: HeaderMap,
) -> Response {
    let missing = || {
        let line = format!("no dataset file {file_name:?} here; /datasets lists all");
        Refusal::new(StatusCode::NOT_FOUND, line).into_response()
    };
    let Some(path) = site.folder.path_of(&file_name) else { return missing() };
    match site.offload.run(move || DatasetFile::open(path)).await {
        Ok(file) => answer(&site, file, &method, &headers),
        Err(OpenError::Missing) => missing(),
        Err(OpenError::Unreadable(reason)) => {
            tracing::warn!("{file_name}: {reason}");
            // It may be on its way into the folder: worth another try.
            let line = format!("{file_name} cannot be served: {reason}");
            Refusal::new(StatusCode::SERVICE_UNAVAILABLE, line).into_response()
        }
    }
}

fn answer(site: &Site, file: DatasetFile, method: &Method, headers: &HeaderMap) -> Response {
    let length = file.bytes;
    let mut response = Response::builder().header(header::ETAG, &file.validators.etag);
    if let Some(modified) = file.validators.modified {
        response = response.header(header::LAST_MODIFIED, modified.to_string());
    }
    match file.validators.judge(headers) {
        Verdict::Failed => {
            let line = "the dataset is not the one asked for (If-Match or If-Unmodified-Since)";
            return Refusal::new(StatusCode::PRECONDITION_FAILED, line).into_response();
        }
        Verdict::NotModified => {
            let response = response.header(header::CACHE_CONTROL, FOREVER);
            return finish(response.status(StatusCode::NOT_MODIFIED), Body::empty());
        }
        Verdict::Proceed => {}
    }
    // Ranges are defined for `GET` alone (RFC 9110, section 14.2).
    let is_ranged =
        method == Method::GET && file.validators.range_applies(headers, SystemTime::now());
    let selection = if is_ranged { Selection::of(headers, length) } else { Selection::Whole };
    let response = response.header(header::ACCEPT_RANGES, "bytes");
    let (response, range) = match selection {
        Selection::Whole => (response.status(StatusCode::OK), 0..length),
        Selection::Part(range) => {
            let content = format!("bytes {}-{}/{length}", range.start, range.end - 1);
            let response = response.header(header::CONTENT_RANGE, content);
            (response.status(StatusCode::PARTIAL_CONTENT), range)
        }
        Selection::Unsatisfiable => {
            let line = format!("the range starts beyond the dataset's {length} bytes");
            let refusal = Refusal::new(StatusCode::RANGE_NOT_SATISFIABLE, line);
            let content = [(header::CONTENT_RANGE, format!("bytes */{length}"))];
            return (content, refusal).into_response();
        }
    };
    let response = response
        .header(header::CACHE_CONTROL, FOREVER)
        .header(header::CONTENT_TYPE, "application/octet-stream")
        .header(header::CONTENT_LENGTH, range.end - range.start);
    finish(response, Body::new(FileBody::new(Arc::new(file), range, Arc::clone(&site.buffers))))
}

fn finish(response: Builder, body: Body) -> Response {
    response.body(body).expect("tag, date and numbers are valid field values")
}
