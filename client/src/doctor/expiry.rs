//! When a signed address expires, as far as its query tells.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use reqwest::Url;

/// When the address expires: by our own servers' and CDNs' `expires`, S3's and Google's date and
/// duration, or Azure's `se`.
pub fn expiry(url: &Url) -> Option<SystemTime> {
    let value = |name: &str| {
        let mut pairs = url.query_pairs();
        pairs.find(|(key, _)| key.eq_ignore_ascii_case(name)).map(|(_, value)| value.into_owned())
    };
    let at = |seconds: u64| UNIX_EPOCH.checked_add(Duration::from_secs(seconds));
    let unix = ["expires", "expiry", "exp"].into_iter().find_map(|name| value(name)?.parse().ok());
    if let Some(seconds) = unix {
        return at(seconds);
    }
    for vendor in ["x-amz", "x-goog"] {
        let date = value(&format!("{vendor}-date")).and_then(|date| compact_time(&date));
        let lasts = value(&format!("{vendor}-expires")).and_then(|seconds| seconds.parse().ok());
        if let (Some(date), Some(lasts)) = (date, lasts) {
            return at(date.checked_add(lasts)?);
        }
    }
    at(compact_time(&value("se")?)?)
}

/// Whether an address is signed at all.
pub fn is_signed(url: &Url) -> bool {
    url.query_pairs().any(|(key, _)| {
        let key = key.to_ascii_lowercase();
        ["signature", "x-amz-signature", "x-goog-signature", "sig", "token"].contains(&key.as_str())
    })
}

/// Seconds since 1970 of `20260102T030405Z` or `2026-01-02T03:04:05Z`.
fn compact_time(text: &str) -> Option<u64> {
    let digits: String = text.chars().filter(char::is_ascii_digit).collect();
    let is_time = text.ends_with('Z') && text.contains('T') && digits.len() == 14;
    let part = |range: std::ops::Range<usize>| digits.get(range)?.parse::<u64>().ok();
    let (year, month, day) = (part(0..4)?, part(4..6)?, part(6..8)?);
    let (hour, minute, second) = (part(8..10)?, part(10..12)?, part(12..14)?);
    let is_date = is_time && year >= 1970 && (1..=12).contains(&month) && (1..=31).contains(&day);
    // Days of the years and months before, counted from March, so that a leap day comes last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1;
    const DAYS_TO_1970: u64 = 719_468;
    is_date.then(|| (days - DAYS_TO_1970) * 86_400 + hour * 3600 + minute * 60 + second)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(query: &str) -> Option<u64> {
        let url = Url::parse(&format!("https://a.example/b.lods?{query}")).expect("a URL");
        expiry(&url).map(|at| at.duration_since(UNIX_EPOCH).expect("after 1970").as_secs())
    }

    #[test]
    fn addresses_tell_when_they_expire() {
        // `date -u -d 2026-01-02T03:04:05Z +%s`
        let at = 1_767_323_045;
        assert_eq!(seconds("datasets=a&expires=1767323045&signature=x"), Some(at));
        assert_eq!(seconds("X-Amz-Date=20260102T030405Z&X-Amz-Expires=900"), Some(at + 900));
        assert_eq!(seconds("X-Goog-Expires=60&X-Goog-Date=20260102T030405Z"), Some(at + 60));
        assert_eq!(seconds("se=2026-01-02T03%3A04%3A05Z&sig=x"), Some(at));
        assert_eq!(seconds("se=2024-02-29T00:00:00Z"), Some(1_709_164_800), "a leap day");
        for none in ["", "se=tomorrow", "expires=soon", "X-Amz-Date=20260102T030405Z", "se=1"] {
            assert_eq!(seconds(none), None, "{none}");
        }
    }
}
