//! The list of datasets for people: a page without scripts, for any width, light and dark.

use std::{sync::Arc, time::SystemTime};

use axum::{
    Extension,
    extract::State,
    http::{HeaderMap, Uri, header},
    response::{Html, IntoResponse},
};
use indicatif::{DecimalBytes, HumanCount};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{Refusal, Site};
use crate::{
    access::Rights,
    index::{BoundsEntry, DatasetEntry, DatasetIndex, UnreadableEntry},
    peer::Peer,
};

const STYLE: &str = include_str!("page.css");
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src 'self'; \
                      base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

/// `GET /`: the list as a page.
pub(super) async fn page(
    State(site): State<Arc<Site>>,
    Extension(rights): Extension<Rights>,
    Extension(peer): Extension<Peer>,
    uri: Uri,
    headers: HeaderMap,
) -> Result<impl IntoResponse, Refusal> {
    let index = site.read_index(&rights).await?;
    // HTTP/2 has the host in the address, HTTP/1.1 in a field.
    let named = headers.get(header::HOST).and_then(|host| host.to_str().ok());
    let host = uri.authority().map(|a| a.as_str()).or(named).unwrap_or_default();
    let origin = peer.origin(&headers, host, &site.trusted_proxies);
    let fields = [
        (header::CACHE_CONTROL, "no-cache"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
    ];
    let page = render(&index, &origin, SystemTime::now(), &rights);
    Ok((fields, Html(page.into_string())))
}

fn render(index: &DatasetIndex, origin: &str, now: SystemTime, rights: &Rights) -> Markup {
    let count = index.datasets.len();
    let points = index.datasets.iter().map(|d| d.points).sum();
    let bytes = index.datasets.iter().map(|d| d.bytes).sum();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { "lodestream" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { "lodestream" }
                    @if count > 0 {
                        p {
                            (count) @if count == 1 { " dataset · " } @else { " datasets · " }
                            (short(points)) " points · " (DecimalBytes(bytes))
                        }
                    }
                }
                main {
                    @for dataset in &index.datasets { (card(dataset, origin, now)) }
                    @for file in &index.unreadable { (bad_card(file)) }
                    @if count == 0 && index.unreadable.is_empty() {
                        p.none { "No datasets here yet." }
                    }
                }
                footer {
                    "A click on an address selects it; open it with "
                    code { "lodestream shot ADDRESS -o picture.png" } ". For programs: "
                    a href=(rights.address("datasets")) { "the list as JSON" } ", "
                    a href="openapi.json" { "described as OpenAPI" } "."
                }
            }
        }
    }
}

fn card(dataset: &DatasetEntry, origin: &str, now: SystemTime) -> Markup {
    // Where an address is too long for its line, it is best broken before the name.
    let (folder, file) = dataset.url.split_at(dataset.url.find('/').map_or(0, |slash| slash + 1));
    html! {
        article {
            div.sky {
                @match &dataset.preview {
                    Some(url) => img src=(url) alt={ "Preview of " (dataset.name) } width="640"
                                     height="400" loading="lazy" decoding="async";,
                    None => span { "no preview" },
                }
            }
            div.body {
                h2 { a href=(dataset.url) { (dataset.name) } }
                dl {
                    dt { "Points" } dd { (HumanCount(dataset.points)) }
                    dt { "Size" }
                    dd { (DecimalBytes(dataset.bytes)) ", " (dataset.levels) " levels" }
                    @if let Some(bounds) = &dataset.bounds {
                        dt { "Extent" } dd { (extent(bounds)) }
                    }
                    @if let Some(modified) = &dataset.modified {
                        dt { "Changed" } dd { time datetime=(modified) title=(modified) { (age(modified, now)) } }
                    }
                }
                ul aria-label="Attributes" {
                    // What is the same everywhere tells nobody anything.
                    @for attribute in dataset.attributes.iter().filter(|a| !a.constant) {
                        li { (attribute.name) }
                    }
                }
                code.address { (origin) "/" (folder) wbr; (file) }
            }
        }
    }
}

fn bad_card(file: &UnreadableEntry) -> Markup {
    html! {
        article.bad { h2 { (file.file) } p { "Not served: " (file.reason) } }
    }
}

/// A number in three digits: `10.7 million`.
fn short(number: u64) -> String {
    let value = number as f64;
    for (unit, name) in [(1e12, "trillion"), (1e9, "billion"), (1e6, "million")] {
        if value >= unit {
            return format!("{} {name}", digits(value / unit));
        }
    }
    HumanCount(number).to_string()
}

/// Three significant digits, more before the point where there are more.
fn digits(value: f64) -> String {
    let decimals = match value.abs() {
        v if v >= 100.0 => 0,
        v if v >= 10.0 => 1,
        v if v >= 1.0 || v == 0.0 => 2,
        v => (2.0 - v.log10().floor()) as usize,
    };
    let text = format!("{value:.decimals$}");
    match value.abs() < 1e15 && decimals == 0 {
        true => HumanCount(value.abs().round() as u64).to_string(),
        false if text.contains('.') => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Width, depth and height.
fn extent(bounds: &BoundsEntry) -> String {
    let sides: Vec<_> = (0..3).map(|axis| digits(bounds.max[axis] - bounds.min[axis])).collect();
    sides.join(" × ")
}

/// How long ago that was, in one unit.
fn age(modified: &str, now: SystemTime) -> String {
    let then = humantime::parse_rfc3339(modified).unwrap_or(now);
    let seconds = now.duration_since(then).unwrap_or_default().as_secs();
    for (unit, name) in [
        (365 * 86_400, "year"),
        (30 * 86_400, "month"),
        (86_400, "day"),
        (3600, "hour"),
        (60, "minute"),
    ] {
        match seconds / unit {
            0 => {}
            1 => return format!("1 {name} ago"),
            many => return format!("{many} {name}s ago"),
        }
    }
    "just now".to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::Access;
    use std::time::Duration;

    fn rights() -> Rights {
        Rights::of(&Access::Open, &HeaderMap::new(), "", SystemTime::now()).expect("no rules")
    }

    #[test]
    fn names_reasons_and_hosts_cannot_bring_markup_in() {
        let file = "<script>&\"'.lods".to_owned();
        let unreadable = vec![UnreadableEntry { reason: file.clone(), file }];
        let index = DatasetIndex { datasets: Vec::new(), unreadable };
        let page = render(&index, "http://<script>", SystemTime::now(), &rights()).into_string();
        assert!(!page.contains("<script>"), "{page}");
        assert!(page.contains("&lt;script&gt;&amp;&quot;'.lods"), "{page}");
    }

    #[test]
    fn numbers_are_told_in_a_few_digits() {
        assert_eq!(short(999), "999");
        assert_eq!(short(10_653_336), "10.7 million");
        assert_eq!(short(2_000_000_000), "2 billion");
        let bounds = BoundsEntry { min: [0.0; 3], max: [4121.4, 12.0, 0.001_234_5] };
        assert_eq!(extent(&bounds), "4,121 × 12 × 0.00123");
        assert_eq!(extent(&BoundsEntry { max: [0.0; 3], ..bounds }), "0 × 0 × 0");
    }

    #[test]
    fn ages_are_told_in_one_unit() {
        let now = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
        let at = |ago| {
            let then = now - Duration::from_secs(ago);
            age(&humantime::format_rfc3339_seconds(then).to_string(), now)
        };
        assert_eq!(at(5), "just now");
        assert_eq!(at(60), "1 minute ago");
        assert_eq!(at(3 * 86_400), "3 days ago");
        assert_eq!(at(800 * 86_400), "2 years ago");
        assert_eq!(age("tomorrow", now), "just now");
    }
}
