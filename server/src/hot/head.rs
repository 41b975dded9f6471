//! Which requests go the short way.

use std::ops::RangeInclusive;

/// A request with more fields than this goes the long way.
const MAX_FIELDS: usize = 32;

/// Fields that change nothing about the answer to a range request. Whatever is not listed here may,
/// and goes the long way.
const INERT: [&str; 18] = [
    "host",
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
    /// One range of one file: a head of so many bytes.
    Range(RangeRequest<'a>, usize),
}

/// `GET` of one range.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct RangeRequest<'a> {
    /// Last part of the path, without escapes.
    pub(super) file_name: &'a str,
    /// The content that is asked for by its address.
    pub(super) version: Option<&'a str>,
    /// First and last byte.
    pub(super) range: RangeInclusive<u64>,
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
    range_request(&request).map_or(Head::Other, |request| Head::Range(request, length))
}

fn range_request<'a>(request: &httparse::Request<'_, 'a>) -> Option<RangeRequest<'a>> {
    if request.method? != "GET" || request.version? != 1 {
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
    let file_name = path.strip_prefix("datasets/").unwrap_or(path);
    if !is_plain(file_name) {
        return None;
    }
    let mut range = None;
    let mut has_host = false;
    for field in &*request.headers {
        let is = |name: &str| field.name.eq_ignore_ascii_case(name);
        if is("range") {
            if range.is_some() {
                return None;
            }
            range = Some(parse_range(field.value)?);
        } else if is("connection") {
            if !field.value.eq_ignore_ascii_case(b"keep-alive") {
                return None;
            }
        } else if is("host") {
            if has_host {
                return None;
            }
            has_host = true;
        } else if !INERT.iter().any(|name| is(name)) {
            return None;
        }
    }
    has_host.then_some(())?;
    Some(RangeRequest { file_name, version, range: range? })
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
    let number = |digits: &str| {
        let is_number =
            (1..19).contains(&digits.len()) && digits.bytes().all(|b| b.is_ascii_digit());
        is_number.then(|| digits.parse::<u64>().ok()).flatten()
    };
    let (first, last) = (number(first)?, number(last)?);
    (first <= last).then_some(first..=last)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(line: &str, fields: &str) -> Vec<u8> {
        format!("{line}\r\nHost: x\r\n{fields}\r\n").into_bytes()
    }

    #[test]
    fn one_range_of_one_file_goes_the_short_way() {
        let bytes = with("GET /datasets/a.lods HTTP/1.1", "Range: bytes=5-9\r\nAccept: */*\r\n");
        let request = RangeRequest { file_name: "a.lods", version: None, range: 5..=9 };
        assert_eq!(read(&bytes), Head::Range(request, bytes.len()));
        let bytes =
            with("GET /a.lods?v=0af HTTP/1.1", "range: bytes=0-0\r\nConnection: Keep-Alive\r\n");
        let request = RangeRequest { file_name: "a.lods", version: Some("0af"), range: 0..=0 };
        assert_eq!(read(&[&bytes[..], b"GET"].concat()), Head::Range(request, bytes.len()));
        assert_eq!(read(&bytes[..bytes.len() - 1]), Head::Partial);
        assert_eq!(read(b""), Head::Partial);
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
