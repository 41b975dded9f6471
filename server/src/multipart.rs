//! Several ranges in one response: `multipart/byteranges` (RFC 9110, section 14.6).

use std::{
    hash::{BuildHasher, RandomState},
    ops::Range,
    sync::LazyLock,
};

use bytes::Bytes;

use crate::body::Segment;

/// What a dataset's bytes are.
pub(crate) const DATASET_TYPE: &str = "application/octet-stream";

/// The line between parts: drawn anew by every process, so that no file can be made to hold it.
static BOUNDARY: LazyLock<String> = LazyLock::new(|| {
    let random = || RandomState::new().hash_one(0);
    format!("{:016x}{:016x}", random(), random())
});

/// The media type of the response.
pub(crate) fn content_type() -> String {
    format!("multipart/byteranges; boundary={}", *BOUNDARY)
}

/// The response's body: these ranges of a file of `len` bytes.
pub(crate) fn segments(ranges: Vec<Range<u64>>, len: u64) -> Vec<Segment> {
    let mut segments = Vec::with_capacity(2 * ranges.len() + 1);
    for range in ranges {
        let head = format!(
            "\r\n--{}\r\nContent-Type: {DATASET_TYPE}\r\nContent-Range: bytes {}-{}/{len}\r\n\r\n",
            *BOUNDARY,
            range.start,
            range.end - 1,
        );
        segments.push(Segment::Text(Bytes::from(head)));
        segments.push(Segment::File(range));
    }
    segments.push(Segment::Text(Bytes::from(format!("\r\n--{}--\r\n", *BOUNDARY))));
    segments
}
