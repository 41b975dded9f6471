//! Which requests go the short way.

use std::ops::RangeInclusive;

use lodestream_protocol::{BATCH_REQUEST_TYPE, MAX_BATCH_REQUEST_BYTES};

use crate::metrics::Kind;

/// A request with more fields than this goes the long way.
const MAX_FIELDS: usize = 32;

/// Fields that change nothing about the answer to a range request. Whatever is not listed here may,
/// and goes the long way.
const INERT: [&str; 17] = [
    "user-agent",
    "accept",
    "accept-encoding",
    "accept-language",
    "cache-control",
    "pragma",
    "referer",
    "origin",
    "dnt",
    "priority",
    "sec-ch-ua",
    "sec-ch-ua-mobile",
    "sec-ch-ua-platform",
    "sec-fetch-dest",
    "sec-fetch-mode",
    "sec-fetch-site",
    "sec-gpc",
];

/// What the bytes are that a client has sent.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Head<'a> {
    /// The beginning of a head.
    Partial,
    /// Something for the long way.
    Other,
    /// A request for the short way, whose head has so many bytes.
    Short(Request<'a>, usize),
}

/// A request for a part of a file, or for several.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Request<'a> {
    /// The file's part of the path, without escapes.
    pub(super) file_name: &'a str,
    /// The content that is asked for by its address.
    pub(super) version: Option<&'a str>,
    pub(super) wanted: Wanted,
}

/// What is asked for.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Wanted {
    /// `GET` from the first to the last byte.
    Range(RangeInclusive<u64>),
    /// `POST` of a batch request of so many bytes.
    Batch(usize),
}

impl Wanted {
    /// For the figures.
    pub(super) const fn kind(&self) -> Kind {
        match self {
            Self::Range(_) => Kind::File,
            Self::Batch(_) => Kind::Batch,
        }
    }
}

/// Looks at what a connection begins with.
pub(super) fn read(bytes: &[u8]) -> Head<'_> {
    let mut fields = [httparse::EMPTY_HEADER; MAX_FIELDS];
    let mut request = httparse::Request::new(&mut fields);
    let length = match request.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return Head::Partial,
        // Whatever is wrong with it, the long way has an answer.
        Err(_) => return Head::Other,
    };
    short(&request).map_or(Head::Other, |request| Head::Short(request, length))
}

fn short<'a>(request: &httparse::Request<'_, 'a>) -> Option<Request<'a>> {
    let is_batch = match request.method? {
        "GET" => false,
        "POST" => true,
        _ => return None,
    };
    if request.version? != 1 {
        return None;
    }
    let (path, query) = match request.path?.split_once('?') {
        Some((path, query)) => (path, Some(query)),
        None => (request.path?, None),
    };
    // A query that holds more may hold a signature.
    let version = match query {
        None => None,
        Some(query) => Some(query.strip_prefix("v=").filter(|v| is_plain(v))?),
    };
    let path = path.strip_prefix('/')?;
    let path = path.strip_prefix("datasets/").unwrap_or(path);
    let file_name = if is_batch { path.strip_suffix("/batch")? } else { path };
    if !is_plain(file_name) {
        return None;
    }
    // What must come once, and may not come twice.
    let (mut hosts, mut types, mut wanted) = (0, 0, None);
    for field in &*request.headers {
        let is = |name: &str| field.name.eq_ignore_ascii_case(name);
        if is("range") && !is_batch && wanted.is_none() {
            wanted = Some(Wanted::Range(parse_range(field.value)?));
        } else if is("content-length") && is_batch && wanted.is_none() {
            let length = usize::try_from(number(std::str::from_utf8(field.value).ok()?)?).ok()?;
            wanted = Some(Wanted::Batch(length)).filter(|_| length <= MAX_BATCH_REQUEST_BYTES);
            wanted.as_ref()?;
        } else if is("content-type") && is_batch && field.value == BATCH_REQUEST_TYPE.as_bytes() {
            types += 1;
        } else if is("connection") {
            field.value.eq_ignore_ascii_case(b"keep-alive").then_some(())?;
        } else if is("host") {
            hosts += 1;
        } else if !INERT.iter().any(|name| is(name)) {
            return None;
        }
    }
    let is_complete = hosts == 1 && types == usize::from(is_batch);
    Some(Request { file_name, version, wanted: wanted.filter(|_| is_complete)? })
}

/// Letters that stand for themselves in an address.
fn is_plain(text: &str) -> bool {
    let is_plain = |b: u8| b.is_ascii_alphanumeric() || b"-._~".contains(&b);
    !text.is_empty() && text.bytes().all(is_plain)
}

/// `bytes=FIRST-LAST`, as nearly everyone writes it.
fn parse_range(value: &[u8]) -> Option<RangeInclusive<u64>> {
    let value = std::str::from_utf8(value).ok()?.strip_prefix("bytes=")?;
    let (first, last) = value.split_once('-')?;
    let (first, last) = (number(first)?, number(last)?);
    (first <= last).then_some(first..=last)
}

/// A number of which there can be no doubt.
fn number(digits: &str) -> Option<u64> {
    let is_number = (1..19).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| digits.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(line: &str, fields: &str) -> Vec<u8> {
        format!("{line}\r\nHost: x\r\n{fields}\r\n").into_bytes()
    }

    #[test]
    fn one_range_of_one_file_goes_the_short_way() {
        let range = |version, range| {
            let wanted = Wanted::Range(range);
            Request { file_name: "a.lods", version, wanted }
        };
        let bytes = with("GET /datasets/a.lods HTTP/1.1", "Range: bytes=5-9\r\nAccept: */*\r\n");
        assert_eq!(read(&bytes), Head::Short(range(None, 5..=9), bytes.len()));
        let fields = "range: bytes=0-0\r\nConnection: Keep-Alive\r\n";
        let bytes = with("GET /a.lods?v=0af HTTP/1.1", fields);
        let more = [&bytes[..], b"GET"].concat();
        assert_eq!(read(&more), Head::Short(range(Some("0af"), 0..=0), bytes.len()));
        assert_eq!(read(&bytes[..bytes.len() - 1]), Head::Partial);
        assert_eq!(read(b""), Head::Partial);
    }

    #[test]
    fn a_batch_goes_the_short_way() {
        let fields = format!("Content-Type: {BATCH_REQUEST_TYPE}\r\nContent-Length: 65536\r\n");
        let bytes = with("POST /datasets/a.lods/batch HTTP/1.1", &fields);
        let wanted = Wanted::Batch(65_536);
        let request = Request { file_name: "a.lods", version: None, wanted };
        assert_eq!(read(&bytes), Head::Short(request, bytes.len()));
        let kind = format!("Content-Type: {BATCH_REQUEST_TYPE}\r\n");
        for fields in [
            String::new(),
            kind.clone(),
            "Content-Length: 5\r\n".into(),
            "Content-Length: 5\r\nContent-Type: text/plain\r\n".into(),
            format!("{kind}Content-Length: 65537\r\n"),
            format!("{kind}Content-Length: -1\r\n"),
            format!("{kind}Content-Length: 5\r\nContent-Length: 5\r\n"),
            format!("{kind}{kind}Content-Length: 5\r\n"),
            format!("{kind}Content-Length: 5\r\nContent-Encoding: gzip\r\n"),
            format!("{kind}Content-Length: 5\r\nTransfer-Encoding: chunked\r\n"),
            format!("{kind}Content-Length: 5\r\nExpect: 100-continue\r\n"),
            format!("{kind}Content-Length: 5\r\nRange: bytes=0-9\r\n"),
        ] {
            assert_eq!(
                read(&with("POST /a.lods/batch HTTP/1.1", &fields)),
                Head::Other,
                "{fields}"
            );
        }
    }

    #[test]
    fn everything_else_goes_the_long_way() {
        let range = "Range: bytes=5-9\r\n";
        for (line, fields) in [
            ("POST /a.lods HTTP/1.1", range),
            ("HEAD /a.lods HTTP/1.1", range),
            ("GET /a.lods HTTP/1.0", range),
            ("GET /a%2elods HTTP/1.1", range),
            ("GET /datasets/b/a.lods HTTP/1.1", range),
            ("GET /../a.lods HTTP/1.1", range),
            ("GET http://x/a.lods HTTP/1.1", range),
            ("GET /a.lods?v=1&signature=x HTTP/1.1", range),
            ("GET /a.lods? HTTP/1.1", range),
            ("GET /a.lods HTTP/1.1", ""),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=-5\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=9-5\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=0-1,5-9\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=0-99999999999999999999\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nRange: bytes=5-9\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nHost: y\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nIf-Range: \"x\"\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nIf-None-Match: \"x\"\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nAuthorization: Bearer x\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nConnection: close\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nContent-Length: 5\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nExpect: 100-continue\r\n"),
            ("GET /a.lods HTTP/1.1", "Range: bytes=5-9\r\nX-Forwarded-For: 1.1.1.1\r\n"),
            ("PRI * HTTP/2.0", ""),
        ] {
            assert_eq!(read(&with(line, fields)), Head::Other, "{line} {fields}");
        }
        assert_eq!(read(b"GET /a.lods HTTP/1.1\r\nRange: bytes=0-1\r\n\r\n"), Head::Other);
        assert_eq!(read(b"\x16\x03\x01\x02\x00"), Head::Other);
    }
}
