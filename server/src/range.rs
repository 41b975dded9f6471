//! Byte ranges: which part of a file a request asks for (RFC 9110, section 14).
//!
//! One range is answered with `206`, or with `416` where it starts beyond the end. A server may
//! ignore `Range` (section 14.2); this one does where the field is malformed, in another unit, or
//! asks for several ranges, and answers `200` with the whole file.

use std::ops::Range;

use axum::http::{HeaderMap, header};

/// What part of the file to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Selection {
    /// All of it.
    Whole,
    /// These bytes: never empty, within the file.
    Part(Range<u64>),
    /// The one range asked for has no byte in the file.
    Unsatisfiable,
}

impl Selection {
    /// What the `Range` field of a request selects from a file of `len` bytes.
    pub(crate) fn of(headers: &HeaderMap, len: u64) -> Self {
        // `Range` is no list field: two of them contradict one another.
        let mut fields = headers.get_all(header::RANGE).iter();
        match (fields.next().map(|value| value.to_str()), fields.next()) {
            (Some(Ok(field)), None) => Self::parse(field, len).unwrap_or(Self::Whole),
            _ => Self::Whole,
        }
    }

    /// `None` where the field is to be ignored.
    fn parse(field: &str, len: u64) -> Option<Self> {
        let (unit, set) = field.split_once('=')?;
        if !unit.trim().eq_ignore_ascii_case("bytes") {
            return None;
        }
        // Recipients accept empty list elements (section 5.6.1.2).
        let mut specs = set.split(',').map(|spec| spec.trim_matches([' ', '\t']));
        let mut specs = specs.by_ref().filter(|spec| !spec.is_empty());
        let spec = specs.next()?;
        if specs.next().is_some() {
            return None;
        }
        let (first, last) = spec.split_once('-')?;
        let range = match (first, last) {
            ("", suffix) => len.saturating_sub(position(suffix)?)..len,
            (first, "") => position(first)?..len,
            (first, last) => {
                let (first, last) = (position(first)?, position(last)?);
                if last < first {
                    return None;
                }
                first..last.saturating_add(1).min(len)
            }
        };
        Some(if range.is_empty() { Self::Unsatisfiable } else { Self::Part(range) })
    }
}

/// Decimal digits; a number beyond 64 bits is beyond every file all the same.
fn position(digits: &str) -> Option<u64> {
    let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| digits.parse().unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn select(field: &'static str) -> Selection {
        let headers = HeaderMap::from_iter([(header::RANGE, HeaderValue::from_static(field))]);
        Selection::of(&headers, 100)
    }

    #[test]
    fn single_ranges_select_their_bytes() {
        for (field, range) in [
            ("bytes=0-0", 0..1),
            ("bytes=0-99", 0..100),
            ("bytes=10-1000", 10..100),
            ("bytes=99-", 99..100),
            ("bytes=-1", 99..100),
            ("bytes=-1000", 0..100),
            ("Bytes=5-9", 5..10),
            ("bytes= 5-9 ,", 5..10),
            ("bytes=5-18446744073709551615", 5..100),
            ("bytes=5-99999999999999999999999", 5..100),
        ] {
            assert_eq!(select(field), Selection::Part(range), "{field}");
        }
    }

    #[test]
    fn ranges_without_a_byte_in_the_file_are_unsatisfiable() {
        for field in ["bytes=100-", "bytes=100-200", "bytes=-0", "bytes=99999999999999999999999-"] {
            assert_eq!(select(field), Selection::Unsatisfiable, "{field}");
        }
    }

    #[test]
    fn malformed_foreign_and_multiple_ranges_are_ignored() {
        for field in [
            "",
            "bytes",
            "bytes=",
            "bytes=,",
            "bytes=-",
            "bytes=a-b",
            "bytes=5",
            "bytes=9-5",
            "bytes=+5-9",
            "bytes=5-9-12",
            "bytes=5 - 9",
            "items=0-5",
            "bytes=0-1,5-9",
            "bytes=200-,300-",
        ] {
            assert_eq!(select(field), Selection::Whole, "{field}");
        }
    }

    #[test]
    fn two_range_fields_are_ignored() {
        let mut headers = HeaderMap::new();
        headers.append(header::RANGE, HeaderValue::from_static("bytes=0-1"));
        headers.append(header::RANGE, HeaderValue::from_static("bytes=2-3"));
        assert_eq!(Selection::of(&headers, 100), Selection::Whole);
    }
}
