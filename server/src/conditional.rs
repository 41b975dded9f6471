//! Conditional requests (RFC 9110, section 13).

use std::time::{Duration, SystemTime};

use axum::http::{HeaderMap, HeaderName, header};
use httpdate::HttpDate;

/// What a client can compare its copy with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Validators {
    /// Strong entity tag, with its quotes.
    pub(crate) etag: String,
    /// When the file was last changed, where HTTP can express it.
    pub(crate) modified: Option<HttpDate>,
}

/// What the preconditions of a request come to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Answer the request.
    Proceed,
    /// The client's copy is good: `304`.
    NotModified,
    /// The client expects another file: `412`.
    Failed,
}

/// A modification time as HTTP tells it: `None` before 1970, after 9999 and in the future
/// (section 8.8.2.1).
pub(crate) fn http_date(modified: SystemTime, now: SystemTime) -> Option<HttpDate> {
    const YEAR_10000: Duration = Duration::from_secs(253_402_300_800);
    let age = modified.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    (age < YEAR_10000 && modified <= now).then(|| HttpDate::from(modified))
}

impl Validators {
    /// Evaluates a `GET` or `HEAD` request's preconditions in the order of section 13.2.2.
    pub(crate) fn judge(&self, headers: &HeaderMap) -> Verdict {
        if headers.contains_key(header::IF_MATCH) {
            if !self.is_listed(headers, header::IF_MATCH, Comparison::Strong) {
                return Verdict::Failed;
            }
        } else if let (Some(date), Some(modified)) =
            (date(headers, header::IF_UNMODIFIED_SINCE), self.modified)
            && modified > date
        {
            return Verdict::Failed;
        }
        if headers.contains_key(header::IF_NONE_MATCH) {
            if self.is_listed(headers, header::IF_NONE_MATCH, Comparison::Weak) {
                return Verdict::NotModified;
            }
        } else if let (Some(date), Some(modified)) =
            (date(headers, header::IF_MODIFIED_SINCE), self.modified)
            && modified <= date
        {
            return Verdict::NotModified;
        }
        Verdict::Proceed
    }

    /// Whether `Range` is to be honoured: `If-Range`, where there is one, names this very file
    /// (section 13.1.5).
    pub(crate) fn range_applies(&self, headers: &HeaderMap, now: SystemTime) -> bool {
        let Some(value) = headers.get(header::IF_RANGE) else { return true };
        let Ok(value) = value.to_str() else { return false };
        if value == self.etag {
            return true;
        }
        // A date is strong only where the file cannot have changed twice within its second
        // (section 8.8.2.2).
        let settled = |date: HttpDate| {
            now.duration_since(SystemTime::from(date)).is_ok_and(|age| age.as_secs() >= 2)
        };
        value.parse().is_ok_and(|date| self.modified == Some(date) && settled(date))
    }

    fn is_listed(&self, headers: &HeaderMap, name: HeaderName, comparison: Comparison) -> bool {
        // Our tags hold no comma, so that a foreign one that does cannot be cut into ours.
        headers.get_all(name).iter().filter_map(|value| value.to_str().ok()).any(|value| {
            let mut tags = value.split(',').map(str::trim);
            // The star is no tag: it stands alone (section 13.1.1).
            value.trim() == "*"
                || tags.any(|tag| {
                    let weak = tag.strip_prefix("W/").filter(|_| comparison == Comparison::Weak);
                    weak.unwrap_or(tag) == self.etag
                })
        })
    }
}

/// How entity tags are compared (section 8.8.3.2).
#[derive(Clone, Copy, PartialEq)]
enum Comparison {
    /// Weak tags match nothing.
    Strong,
    /// Weak and strong tags match alike.
    Weak,
}

/// The date of a field; an invalid one is as good as none (section 13.1.3).
fn date(headers: &HeaderMap, name: HeaderName) -> Option<HttpDate> {
    headers.get(name)?.to_str().ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    const EARLIER: &str = "Sun, 06 Nov 1994 08:49:36 GMT";
    const MODIFIED: &str = "Sun, 06 Nov 1994 08:49:37 GMT";
    const LATER: &str = "Sun, 06 Nov 1994 08:49:38 GMT";

    fn validators() -> Validators {
        Validators { etag: "\"abc\"".into(), modified: MODIFIED.parse().ok() }
    }

    fn judge(fields: &[(HeaderName, &'static str)]) -> Verdict {
        let fields = fields.iter().map(|(n, v)| (n.clone(), HeaderValue::from_static(v)));
        validators().judge(&fields.collect())
    }

    #[test]
    fn a_known_tag_is_not_sent_again() {
        for tags in ["\"abc\"", "W/\"abc\"", "*", "\"x\", \"abc\"", "\"x\" ,W/\"abc\",\"y\""] {
            assert_eq!(judge(&[(header::IF_NONE_MATCH, tags)]), Verdict::NotModified, "{tags}");
        }
        for tags in ["\"x\"", "abc", "", "\"abcd\"", "\"ab,c\"", "\"x\", *", "w/\"abc\""] {
            assert_eq!(judge(&[(header::IF_NONE_MATCH, tags)]), Verdict::Proceed, "{tags}");
        }
    }

    #[test]
    fn if_match_compares_strongly() {
        assert_eq!(judge(&[(header::IF_MATCH, "\"x\", \"abc\"")]), Verdict::Proceed);
        assert_eq!(judge(&[(header::IF_MATCH, "*")]), Verdict::Proceed);
        assert_eq!(judge(&[(header::IF_MATCH, "W/\"abc\"")]), Verdict::Failed);
        assert_eq!(judge(&[(header::IF_MATCH, "\"x\"")]), Verdict::Failed);
    }

    #[test]
    fn dates_count_only_without_their_tag_counterpart() {
        let since = header::IF_MODIFIED_SINCE;
        assert_eq!(judge(&[(since.clone(), MODIFIED)]), Verdict::NotModified);
        assert_eq!(judge(&[(since.clone(), EARLIER)]), Verdict::Proceed);
        assert_eq!(judge(&[(since.clone(), "yesterday")]), Verdict::Proceed);
        let both = [(since, LATER), (header::IF_NONE_MATCH, "\"x\"")];
        assert_eq!(judge(&both), Verdict::Proceed);
        let since = header::IF_UNMODIFIED_SINCE;
        assert_eq!(judge(&[(since.clone(), EARLIER)]), Verdict::Failed);
        assert_eq!(judge(&[(since.clone(), MODIFIED)]), Verdict::Proceed);
        assert_eq!(judge(&[(since, EARLIER), (header::IF_MATCH, "*")]), Verdict::Proceed);
    }

    #[test]
    fn if_range_takes_only_the_exact_strong_validator() {
        let applies = |value: &'static str, now: SystemTime| {
            let field = (header::IF_RANGE, HeaderValue::from_static(value));
            validators().range_applies(&HeaderMap::from_iter([field]), now)
        };
        let modified: HttpDate = MODIFIED.parse().expect("a date");
        let after = |secs| SystemTime::from(modified) + Duration::from_secs(secs);
        assert!(validators().range_applies(&HeaderMap::new(), after(100)));
        assert!(applies("\"abc\"", after(100)));
        assert!(applies(MODIFIED, after(100)));
        assert!(!applies(MODIFIED, after(1)));
        for other in ["W/\"abc\"", "\"x\"", "*", EARLIER, LATER, ""] {
            assert!(!applies(other, after(100)), "{other}");
        }
    }

    #[test]
    fn times_that_http_cannot_tell_are_left_out() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1 << 40);
        let at = |secs| http_date(SystemTime::UNIX_EPOCH + Duration::from_secs(secs), now);
        assert!(at(0).is_some() && at(253_402_300_799).is_some());
        assert_eq!(at(253_402_300_800), None);
        assert_eq!(http_date(SystemTime::UNIX_EPOCH - Duration::from_secs(1), now), None);
        assert_eq!(http_date(now, SystemTime::UNIX_EPOCH), None);
    }
}
