//! Many parts of a dataset by one request, streamed in the order in which they were asked for.
//!
//! The body is one [`BatchRequest`], the answer what `docs/PROTOCOL.md` says. Parts are named by their
//! place in the file, so this needs to know nothing of the tree. A client that no longer wants the
//! rest closes the connection (or, over HTTP/2, the stream): no more is read than what was on its way.
//! Bodies are never decompressed: 64 KiB hold every request that is allowed.

use std::sync::Arc;

use axum::{
    body::Body,
    extract::{DefaultBodyLimit, Path, RawQuery, State, rejection::BytesRejection},
    http::{HeaderMap, StatusCode, header},
    response::Response,
    routing::{MethodRouter, post},
};
use bytes::{Bytes, BytesMut};
use lodestream_protocol::{
    BATCH_HEAD_BYTES, BATCH_REQUEST_TYPE, BATCH_TYPE, BatchRequest, FRAME_HEAD_BYTES,
    MAX_BATCH_REQUEST_BYTES, batch_head, frame_head,
};

use super::{
    Refusal, Site,
    dataset::{finish, open},
};
use crate::{
    body::{FileBody, Segment},
    file::DatasetFile,
};

/// What the first answer about a dataset says of batches: the version, and the limits of a request.
pub(crate) const OFFER: &str = "1; parts=4096; bytes=67108864";

/// `POST` of a batch request.
pub(super) fn route() -> MethodRouter<Arc<Site>> {
    post(batch).layer(DefaultBodyLimit::max(MAX_BATCH_REQUEST_BYTES))
}

async fn batch(
    State(site): State<Arc<Site>>,
    Path(file_name): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
    body: Result<Bytes, BytesRejection>,
) -> Result<Response, Refusal> {
    let opened = open(&site, &file_name, query.as_deref()).await?;
    let is_plain = headers.get(header::CONTENT_ENCODING).is_none_or(|c| c == "identity");
    if headers.get(header::CONTENT_TYPE).is_none_or(|t| t != BATCH_REQUEST_TYPE) || !is_plain {
        let line = format!("the body must be {BATCH_REQUEST_TYPE}, not compressed");
        return Err(Refusal::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, line));
    }
    let body = body.map_err(|rejection| {
        let line = format!("the body cannot be taken: {}", rejection.body_text());
        Refusal::new(rejection.status(), line)
    })?;
    let request = BatchRequest::decode(&body)
        .map_err(|e| Refusal::new(StatusCode::BAD_REQUEST, e.to_string()))?;
    answer(&site, opened.file, &request).map_err(|(status, line)| Refusal::new(status, line))
}

fn answer(
    site: &Site,
    file: Arc<DatasetFile>,
    request: &BatchRequest,
) -> Result<Response, (StatusCode, String)> {
    if request.content_id != file.content_id {
        let line = "the dataset is not the one asked for: it was replaced".to_owned();
        return Err((StatusCode::PRECONDITION_FAILED, line));
    }
    let is_beyond = |part: &lodestream_protocol::BatchPart| {
        part.offset.checked_add(u64::from(part.bytes)).is_none_or(|end| end > file.bytes)
    };
    if let Some(index) = request.parts.iter().position(is_beyond) {
        let line = format!("part {index} reaches beyond the dataset's {} bytes", file.bytes);
        return Err((StatusCode::RANGE_NOT_SATISFIABLE, line));
    }
    let body = FileBody::of(file, segments(request), Arc::clone(&site.buffers));
    let response = Response::builder()
        .header(header::CONTENT_TYPE, BATCH_TYPE)
        .header(header::CONTENT_LENGTH, body.left())
        .header(header::CACHE_CONTROL, "no-store");
    Ok(finish(response, Body::new(body)))
}

fn segments(request: &BatchRequest) -> Vec<Segment> {
    let count = request.parts.len();
    // All heads lie in one piece of memory.
    let mut heads = BytesMut::with_capacity(BATCH_HEAD_BYTES + FRAME_HEAD_BYTES * count);
    heads.extend_from_slice(&batch_head(&request.content_id));
    let mut segments = Vec::with_capacity(1 + 2 * count);
    segments.push(Segment::Text(heads.split().freeze()));
    for (index, part) in (0..).zip(&request.parts) {
        heads.extend_from_slice(&frame_head(index, part.bytes));
        segments.push(Segment::Text(heads.split().freeze()));
        segments.push(Segment::File(part.offset..part.offset + u64::from(part.bytes)));
    }
    segments
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{MAX_BATCH_BYTES, MAX_BATCH_PARTS};

    use super::*;

    #[test]
    fn the_offer_tells_the_limits() {
        let limits = format!("1; parts={MAX_BATCH_PARTS}; bytes={MAX_BATCH_BYTES}");
        assert_eq!(OFFER, limits);
    }
}
