//! A dataset's file: whole, by range, or not again.
//!
//! Under its name a dataset may be replaced by another: what came from there is asked for again
//! after a minute (with `If-None-Match`, which costs no more than a head). With `?v=` and the entity
//! tag, without its quotes, the same address means this very content, which never changes; once it is
//! replaced, there is nothing under that address. The index tells both.

use std::{sync::Arc, time::SystemTime};

use axum::{
    body::Body,
    extract::{Path, RawQuery, State},
    http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header, response::Builder},
    response::{IntoResponse, Response},
};

use super::{Refusal, Site, batch, missing};
use crate::{
    body::FileBody,
    conditional::Verdict,
    file::{DatasetFile, OpenError, UNANSWERED},
    multipart,
    range::Selection,
};

/// How long what comes from an address may be kept. Content never changes under the address that names
/// it; under its name, a dataset may be replaced.
pub(crate) const fn cache_control(by_content: bool) -> &'static str {
    if by_content { "public, max-age=31536000, immutable" } else { "public, max-age=60" }
}

const OFFER: HeaderValue = HeaderValue::from_static(batch::OFFER);
const BYTES: HeaderValue = HeaderValue::from_static("bytes");
const DATASET_TYPE: HeaderValue = HeaderValue::from_static(multipart::DATASET_TYPE);

/// Tells clients that they may ask for batches.
pub(super) const BATCH_OFFER: HeaderName = HeaderName::from_static("lodestream-batch");

/// `GET` and `HEAD` of a dataset. (For `HEAD` axum drops the body, which has read nothing yet.)
pub(super) async fn dataset(
    State(site): State<Arc<Site>>,
    Path(file_name): Path<String>,
    RawQuery(query): RawQuery,
    method: Method,
    headers: HeaderMap,
) -> Response {
    match open(&site, &file_name, query.as_deref()).await {
        Ok(opened) => answer(&site, opened, &method, &headers),
        Err(refusal) => refusal.into_response(),
    }
}

/// A file to be served.
pub(super) struct Opened {
    pub(super) file: Arc<DatasetFile>,
    /// Whether the address names this very content.
    by_content: bool,
}

impl Opened {
    /// How long what comes from this address may be kept.
    pub(super) const fn cache_control(&self) -> HeaderValue {
        HeaderValue::from_static(cache_control(self.by_content))
    }
}

/// Opens the dataset of that name.
pub(super) async fn open(
    site: &Arc<Site>,
    file_name: &str,
    query: Option<&str>,
) -> Result<Opened, Refusal> {
    let file = match site.dataset(file_name).await {
        Ok(file) => file,
        Err(OpenError::Missing) => return Err(missing(file_name)),
        Err(OpenError::Unreadable(reason)) => {
            tracing::warn!("{file_name:?}: {reason}");
            // It may be on its way into the folder: worth another try.
            let line = format!("{file_name} cannot be served: {reason}");
            return Err(Refusal::new(StatusCode::SERVICE_UNAVAILABLE, line));
        }
        Err(OpenError::Unanswered) => return Err(unanswered(file_name)),
    };
    let version = query.and_then(|query| query.split('&').find_map(|p| p.strip_prefix("v=")));
    if version.is_some_and(|version| version != file.validators.etag.trim_matches('"')) {
        let line = format!("{file_name} holds other content than that by now; see /datasets");
        return Err(Refusal::new(StatusCode::NOT_FOUND, line));
    }
    Ok(Opened { file, by_content: version.is_some() })
}

/// The object store fails; the log has it already.
pub(crate) fn unanswered(file_name: &str) -> Refusal {
    let line = format!("{file_name} cannot be served: {UNANSWERED}");
    Refusal::new(StatusCode::SERVICE_UNAVAILABLE, line)
}

fn answer(site: &Site, opened: Opened, method: &Method, headers: &HeaderMap) -> Response {
    let cache_control = opened.cache_control();
    let file = opened.file;
    let length = file.bytes;
    let verdict = file.validators.judge(headers);
    if verdict == Verdict::Failed {
        let line = "the dataset is not the one asked for (If-Match or If-Unmodified-Since)";
        return Refusal::new(StatusCode::PRECONDITION_FAILED, line).into_response();
    }
    let mut response = Response::builder()
        .header(header::ETAG, &file.etag)
        .header(header::CACHE_CONTROL, cache_control);
    if let Some(modified) = &file.last_modified {
        response = response.header(header::LAST_MODIFIED, modified);
    }
    if verdict == Verdict::NotModified {
        return finish(response.status(StatusCode::NOT_MODIFIED), Body::empty());
    }
    // Ranges are defined for `GET` alone (section 14.2).
    let is_ranged =
        method == Method::GET && file.validators.range_applies(headers, SystemTime::now());
    let selection = if is_ranged { Selection::of(headers, length) } else { Selection::Whole };
    let refuse = |line: &str| {
        let content = [(header::CONTENT_RANGE, format!("bytes */{length}"))];
        (content, Refusal::new(StatusCode::RANGE_NOT_SATISFIABLE, line)).into_response()
    };
    response = response.header(header::ACCEPT_RANGES, BYTES);
    let pool = Arc::clone(&site.buffers);
    let (response, content_type, body) = match selection {
        Selection::Whole => {
            let response = response.status(StatusCode::OK).header(BATCH_OFFER, OFFER);
            (response, DATASET_TYPE, FileBody::new(file, 0..length, pool))
        }
        Selection::Part(range) => {
            let content = format!("bytes {}-{}/{length}", range.start, range.end - 1);
            let mut response =
                response.status(StatusCode::PARTIAL_CONTENT).header(header::CONTENT_RANGE, content);
            // Whoever reads a dataset asks for its beginning first.
            if range.start == 0 {
                response = response.header(BATCH_OFFER, OFFER);
            }
            (response, DATASET_TYPE, FileBody::new(file, range, pool))
        }
        Selection::Parts(ranges) => {
            let content_type = HeaderValue::try_from(multipart::content_type());
            let content_type = content_type.expect("the boundary is hexadecimal");
            let body = FileBody::of(file, multipart::segments(ranges, length), pool);
            (response.status(StatusCode::PARTIAL_CONTENT), content_type, body)
        }
        Selection::Unsatisfiable => {
            return refuse(&format!("the range starts beyond the dataset's {length} bytes"));
        }
        Selection::Refused(reason) => return refuse(reason),
    };
    let response = response
        .header(header::CONTENT_TYPE, content_type)
        .header(header::CONTENT_LENGTH, body.left());
    finish(response, Body::new(body))
}

pub(super) fn finish(response: Builder, body: Body) -> Response {
    response.body(body).expect("tag, date and numbers are valid field values")
}
