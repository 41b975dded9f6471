//! What a request of the short way is answered.

use std::{io::Write, ops::Range, sync::Arc, time::SystemTime};

use httpdate::HttpDate;
use lodestream_protocol::{BATCH_TYPE, BatchRequest};

use super::{
    head::{Request, Wanted},
    refused::Refused,
};
use crate::{
    file::{DatasetFile, OpenError},
    multipart::DATASET_TYPE,
    routes::{BATCH_OFFER, CROSS_ORIGIN_FIELDS, Site, cache_control, reaches_beyond, unanswered},
};

/// An answer that nothing stands against.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) file: Arc<DatasetFile>,
    /// Whether the address names this very content.
    by_content: bool,
    pub(super) content: Content,
}

/// What is sent.
#[derive(Debug)]
pub(super) enum Content {
    /// Never empty, within the file.
    Range(Range<u64>),
    /// Parts within the file.
    Batch(BatchRequest),
}

impl Answer {
    /// `None` where the long way has another answer.
    ///
    /// # Errors
    /// Where a store has failed: asked again on the long way, it may take as long once more.
    pub(super) async fn to(
        site: &Arc<Site>,
        request: &Request<'_>,
        body: &[u8],
    ) -> Result<Option<Self>, Refused> {
        match site.dataset(request.file_name).await {
            Ok(file) => Ok(Self::from(file, request, body)),
            Err(OpenError::Unanswered) => Err(unanswered(request.file_name).into()),
            Err(OpenError::Missing | OpenError::Unreadable(_)) => Ok(None),
        }
    }

    fn from(file: Arc<DatasetFile>, request: &Request<'_>, body: &[u8]) -> Option<Self> {
        let tag = file.validators.etag.trim_matches('"');
        if request.version.is_some_and(|version| version != tag) {
            return None;
        }
        let content = match &request.wanted {
            Wanted::Range(range) => {
                let (first, last) = (*range.start(), *range.end());
                (first < file.bytes).then(|| Content::Range(first..(last + 1).min(file.bytes)))?
            }
            Wanted::Batch(_) => {
                let batch = BatchRequest::decode(body).ok()?;
                let is_good =
                    batch.content_id == file.content_id && reaches_beyond(&batch, &file).is_none();
                is_good.then_some(Content::Batch(batch))?
            }
        };
        Some(Self { file, by_content: request.version.is_some(), content })
    }

    pub(super) fn status(&self) -> u16 {
        match self.content {
            Content::Range(_) => 206,
            Content::Batch(_) => 200,
        }
    }

    /// Bytes behind the head.
    pub(super) fn len(&self) -> u64 {
        match &self.content {
            Content::Range(range) => range.end - range.start,
            Content::Batch(batch) => batch.response_bytes(),
        }
    }

    /// The fields of the long way.
    pub(super) fn write_head(&self, head: &mut Vec<u8>) {
        let file = &self.file;
        let mut put = |text: &str| head.extend_from_slice(text.as_bytes());
        let content_type = match &self.content {
            Content::Range(range) => {
                put("HTTP/1.1 206 Partial Content\r\netag: ");
                put(&file.validators.etag);
                put("\r\ncache-control: ");
                put(cache_control(self.by_content));
                if let Some(modified) = &file.last_modified {
                    put("\r\nlast-modified: ");
                    head.extend_from_slice(modified.as_bytes());
                }
                // Writing to memory does not fail.
                let (first, last, all) = (range.start, range.end - 1, file.bytes);
                let _ = write!(
                    head,
                    "\r\naccept-ranges: bytes\r\ncontent-range: bytes {first}-{last}/{all}\r\n"
                );
                if range.start == 0 {
                    let _ = write!(head, "lodestream-batch: {BATCH_OFFER}\r\n");
                }
                DATASET_TYPE
            }
            Content::Batch(_) => {
                put("HTTP/1.1 200 OK\r\ncache-control: no-store\r\n");
                BATCH_TYPE
            }
        };
        let (length, now) = (self.len(), HttpDate::from(SystemTime::now()));
        let _ = write!(
            head,
            "content-type: {content_type}\r\ncontent-length: {length}\r\n{CROSS_ORIGIN_FIELDS}\
             date: {now}\r\n\r\n"
        );
    }
}
