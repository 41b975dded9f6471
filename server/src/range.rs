//! Byte ranges: which parts of a file a request asks for (RFC 9110, section 14).
//!
//! - One range is answered with `206`, several with `206` as `multipart/byteranges`; those that
//!   overlap or nearly touch are sent as one (section 15.3.7.2), so that no request can make a
//!   response much longer than the file.
//! - Where no range has a byte in the file: `416`.
//! - What is malformed, and more than [`MAX_RANGES`] of them, is refused with `416`, too. A server may
//!   as well ignore such a field (section 14.2), but then whoever has made a mistake of one character
//!   is sent the whole file: hundreds of gigabytes, perhaps, for the few that were meant.
//! - Only another unit than bytes is ignored, as that section demands.

use std::ops::Range;

use axum::http::{HeaderMap, header};

/// Most ranges of one request. Readers of datasets ask for tens; a list of very many has no use but
/// to cost the server reads and the link part heads.
pub(crate) const MAX_RANGES: usize = 256;

/// Ranges with so few bytes between them are sent as one: the head of another part is no shorter.
const MERGED_GAP_BYTES: u64 = 128;

/// What part of the file to send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Selection {
    /// All of it.
    Whole,
    /// These bytes: never empty, within the file.
    Part(Range<u64>),
    /// Two or more such ranges, apart from one another, in the order in which they were asked for.
    Parts(Vec<Range<u64>>),
    /// No range asked for has a byte in the file.
    Unsatisfiable,
    /// The field is refused for this reason.
    Refused(&'static str),
}

impl Selection {
    /// What the `Range` field of a request selects from a file of `len` bytes.
    pub(crate) fn of(headers: &HeaderMap, len: u64) -> Self {
        let mut fields = headers.get_all(header::RANGE).iter();
        let Some(field) = fields.next() else { return Self::Whole };
        // `Range` is no list field: two of them contradict one another.
        if fields.next().is_some() {
            return Self::Refused("more than one Range field");
        }
        let parsed = field.to_str().map_err(|_| "Range is not ASCII");
        parsed.and_then(|field| Self::parse(field, len)).unwrap_or_else(Self::Refused)
    }

    fn parse(field: &str, len: u64) -> Result<Self, &'static str> {
        const MALFORMED: &str = "Range is malformed; write bytes=FIRST-LAST, FIRST- or -LENGTH";
        let (unit, set) = field.split_once('=').ok_or(MALFORMED)?;
        if !unit.eq_ignore_ascii_case("bytes") {
            return if is_token(unit) { Ok(Self::Whole) } else { Err(MALFORMED) };
        }
        // Recipients accept empty list elements (section 5.6.1.2).
        let specs = set.split(',').map(|spec| spec.trim_matches([' ', '\t']));
        let (mut ranges, mut count) = (Vec::new(), 0);
        for spec in specs.filter(|spec| !spec.is_empty()) {
            count += 1;
            if count > MAX_RANGES {
                return Err("too many ranges in one request; 256 are served");
            }
            let range = parse_spec(spec, len).ok_or(MALFORMED)?;
            if !range.is_empty() {
                ranges.push(range);
            }
        }
        match (count, ranges.len()) {
            (0, _) => Err(MALFORMED),
            (_, 0) => Ok(Self::Unsatisfiable),
            (_, 1) => Ok(Self::Part(ranges.swap_remove(0))),
            _ => Ok(Self::merge(ranges)),
        }
    }

    /// Joins what overlaps or nearly touches. A joined range comes where its first part was asked for
    /// (section 15.3.7.2).
    fn merge(ranges: Vec<Range<u64>>) -> Self {
        let mut sorted: Vec<(usize, Range<u64>)> = ranges.into_iter().enumerate().collect();
        sorted.sort_by_key(|(_, range)| range.start);
        let mut merged: Vec<(usize, Range<u64>)> = Vec::with_capacity(sorted.len());
        for (place, range) in sorted {
            match merged.last_mut() {
                Some((first, last)) if range.start <= last.end.saturating_add(MERGED_GAP_BYTES) => {
                    last.end = last.end.max(range.end);
                    *first = place.min(*first);
                }
                _ => merged.push((place, range)),
            }
        }
        if let [(_, range)] = &merged[..] {
            return Self::Part(range.clone());
        }
        merged.sort_by_key(|(place, _)| *place);
        Self::Parts(merged.into_iter().map(|(_, range)| range).collect())
    }
}

/// One range-spec: the bytes of the file that it selects, perhaps none. `None` where it is malformed.
fn parse_spec(spec: &str, len: u64) -> Option<Range<u64>> {
    let (first, last) = spec.split_once('-')?;
    Some(match (first, last) {
        ("", suffix) => len.saturating_sub(position(suffix)?)..len,
        (first, "") => position(first)?..len,
        (first, last) => {
            let (first, last) = (position(first)?, position(last)?);
            if last < first {
                return None;
            }
            first..last.saturating_add(1).min(len)
        }
    })
}

/// Decimal digits; a number beyond 64 bits is beyond every file all the same.
fn position(digits: &str) -> Option<u64> {
    let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| digits.parse().unwrap_or(u64::MAX))
}

/// Whether the text can be a unit's name (section 5.6.2).
fn is_token(text: &str) -> bool {
    let is_tchar = |b: u8| b.is_ascii_alphanumeric() || b"!#$%&'*+-.^_`|~".contains(&b);
    !text.is_empty() && text.bytes().all(is_tchar)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;
    use proptest::prelude::*;

    const LEN: u64 = 10_000;

    fn select(field: &str) -> Selection {
        let field = HeaderValue::from_str(field).expect("a field value");
        Selection::of(&HeaderMap::from_iter([(header::RANGE, field)]), LEN)
    }

    #[test]
    fn single_ranges_select_their_bytes() {
        for (field, range) in [
            ("bytes=0-0", 0..1),
            ("bytes=0-9999", 0..10_000),
            ("bytes=10-100000", 10..10_000),
            ("bytes=9999-", 9999..10_000),
            ("bytes=-1", 9999..10_000),
            ("bytes=-100000", 0..10_000),
            ("Bytes=5-9", 5..10),
            ("bytes= 5-9 ,", 5..10),
            ("bytes=5-18446744073709551615", 5..10_000),
            ("bytes=5-99999999999999999999999", 5..10_000),
            ("bytes=5-9,20000-", 5..10),
        ] {
            assert_eq!(select(field), Selection::Part(range), "{field}");
        }
    }

    #[test]
    fn several_ranges_keep_their_order() {
        let parts = Selection::Parts(vec![5000..5010, 0..10, 9900..10_000]);
        assert_eq!(select("bytes=5000-5009, 0-9,-100"), parts);
        assert_eq!(select("bytes=5000-5009,20000-,0-9,-100,"), parts);
    }

    #[test]
    fn ranges_that_overlap_or_nearly_touch_are_one() {
        assert_eq!(select("bytes=0-9,5-19"), Selection::Part(0..20));
        assert_eq!(select("bytes=200-299,0-99"), Selection::Part(0..300));
        assert_eq!(select("bytes=0-,0-,0-"), Selection::Part(0..10_000));
        let parts = Selection::Parts(vec![5000..5200, 0..10]);
        assert_eq!(select("bytes=5100-5199,0-9,5000-5009"), parts);
    }

    #[test]
    fn ranges_without_a_byte_in_the_file_are_unsatisfiable() {
        for field in ["bytes=10000-", "bytes=10000-20000", "bytes=-0", "bytes=20000-,-0"] {
            assert_eq!(select(field), Selection::Unsatisfiable, "{field}");
        }
        let beyond_64_bits = "bytes=99999999999999999999999-";
        assert_eq!(select(beyond_64_bits), Selection::Unsatisfiable);
    }

    #[test]
    fn malformed_ranges_do_not_bring_the_whole_file() {
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
            "bytes =5-9",
            "bytes=0-1;2-3",
            "bytes=0-1,x",
            "it ems=0-1",
            "=0-1",
        ] {
            assert!(matches!(select(field), Selection::Refused(_)), "{field}");
        }
    }

    #[test]
    fn other_units_are_ignored() {
        assert_eq!(select("items=0-5"), Selection::Whole);
        assert_eq!(select("seconds=1-"), Selection::Whole);
    }

    #[test]
    fn two_range_fields_are_refused() {
        let mut headers = HeaderMap::new();
        headers.append(header::RANGE, HeaderValue::from_static("bytes=0-1"));
        headers.append(header::RANGE, HeaderValue::from_static("bytes=2-3"));
        assert!(matches!(Selection::of(&headers, LEN), Selection::Refused(_)));
    }

    #[test]
    fn more_ranges_than_the_limit_are_refused() {
        let list = |count: u64| {
            let specs: Vec<_> = (0..count).map(|i| format!("{0}-{0}", i * 30)).collect();
            format!("bytes={}", specs.join(","))
        };
        assert!(!matches!(select(&list(MAX_RANGES as u64)), Selection::Refused(_)));
        assert!(matches!(select(&list(MAX_RANGES as u64 + 1)), Selection::Refused(_)));
    }

    proptest! {
        #[test]
        fn merged_ranges_hold_every_byte_asked_for_and_are_apart(
            asked in prop::collection::vec((0..LEN, 0..2000u64), 1..40),
        ) {
            let specs: Vec<_> = asked.iter().map(|(f, n)| format!("{f}-{}", f + n)).collect();
            let mut parts = match select(&format!("bytes={}", specs.join(","))) {
                Selection::Part(part) => vec![part],
                Selection::Parts(parts) => parts,
                other => panic!("{other:?}"),
            };
            for (first, n) in asked {
                let last = (first + n).min(LEN - 1);
                prop_assert!(parts.iter().any(|p| p.start <= first && last < p.end));
            }
            parts.sort_by_key(|part| part.start);
            prop_assert!(parts.iter().all(|p| !p.is_empty() && p.end <= LEN));
            for pair in parts.windows(2) {
                prop_assert!(pair[0].end + MERGED_GAP_BYTES < pair[1].start);
            }
        }
    }
}
