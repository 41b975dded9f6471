//! What the head of a good answer says, besides the range.

use std::time::{Duration, SystemTime};

use reqwest::{Method, StatusCode, Version, header};

use super::{
    expiry::{expiry, is_signed},
    finding::Finding,
    probe::{Answer, ORIGIN, Probe},
};

/// Clocks that differ by less are right.
const CLOCK_SLACK: Duration = Duration::from_secs(60);

/// An address that expires within this time is told of.
const SOON: Duration = Duration::from_secs(3600);

/// The version of HTTP, and whether connections are kept.
pub fn http(answer: &Answer) -> Finding {
    const CHECK: &str = "http";
    let version = format!("{:?}", answer.version);
    let closes = answer.field(&header::CONNECTION).is_some_and(|c| c.eq_ignore_ascii_case("close"));
    match answer.version {
        Version::HTTP_10 | Version::HTTP_09 => Finding::warn(
            CHECK,
            format!("{version}: every request needs a connection of its own"),
            "have the host or proxy speak HTTP/1.1 (nginx: proxy_http_version 1.1)",
        ),
        _ if closes => Finding::warn(
            CHECK,
            format!("{version}, but the host closes the connection after each answer"),
            "let connections be kept alive: each new one costs a round trip, with TLS two or more",
        ),
        _ => Finding::ok(CHECK, format!("{version}, connections are kept")),
    }
}

/// The type of the content.
pub fn content_type(answer: &Answer) -> Finding {
    const CHECK: &str = "type";
    let remedy = "serve .lods as application/octet-stream";
    match answer.field(&header::CONTENT_TYPE) {
        None => Finding::ok(CHECK, "no Content-Type, which does no harm"),
        Some(kind)
            if kind.starts_with("text/") || kind.contains("html") || kind.contains("json") =>
        {
            let found = format!("Content-Type is {kind}: proxies may compress or alter text");
            Finding::warn(CHECK, found, remedy)
        }
        Some(kind) => Finding::ok(CHECK, format!("Content-Type is {kind}")),
    }
}

/// The entity tag, over several answers, and what conditions come to.
pub async fn etag(probe: &Probe, answers: &[&Answer]) -> Finding {
    const CHECK: &str = "etag";
    let tags: Vec<_> = answers.iter().map(|a| a.field(&header::ETAG)).collect();
    if tags.windows(2).any(|pair| pair[0] != pair[1]) {
        let found = format!(
            "the ETag changes from one answer to the next: {}",
            list(tags.iter().map(|tag| tag.unwrap_or("none")))
        );
        return Finding::fail(
            CHECK,
            found,
            "have all replicas derive it from the content; while the file is being replaced, ask again \
             later (clients stop when it changes)",
        );
    }
    let Some(tag) = tags.first().copied().flatten() else {
        return Finding::warn(
            CHECK,
            "no ETag: clients cannot tell whether the file was replaced",
            "have the host send a strong ETag (nginx: etag on)",
        );
    };
    if tag.starts_with("W/") {
        return Finding::warn(
            CHECK,
            format!("the ETag {tag} is weak: If-Range does not work with it"),
            "have the host send a strong one; a proxy that compresses makes them weak (nginx: gzip off \
             for .lods)",
        );
    }
    match probe.range_with(0, 64, &[(header::IF_NONE_MATCH, tag)]).await {
        Ok(answer) if answer.status == StatusCode::NOT_MODIFIED => {
            Finding::ok(CHECK, format!("{tag}, strong, the same in all answers"))
        }
        Ok(answer) => Finding::warn(
            CHECK,
            format!("{tag} is strong, but If-None-Match with it is answered {}", answer.status),
            "have the host answer 304: caches ask so whether what they have is still good",
        ),
        Err(why) => Finding::warn(CHECK, format!("If-None-Match: {why}"), "ask again"),
    }
}

/// Whether pages of other hosts may read it.
pub async fn cors(probe: &Probe, answer: &Answer) -> Finding {
    const CHECK: &str = "cors";
    let remedy = "send Access-Control-Allow-Origin: * and Access-Control-Expose-Headers: Content-Range, \
                  Content-Length, ETag, Accept-Ranges (native clients do without)";
    match answer.field(&header::ACCESS_CONTROL_ALLOW_ORIGIN) {
        None => {
            return Finding::warn(
                CHECK,
                "pages of other hosts may not read it in a browser",
                remedy,
            );
        }
        Some(origin) if origin != "*" && origin != ORIGIN => {
            return Finding::warn(CHECK, format!("only pages of {origin} may read it"), remedy);
        }
        Some(_) => {}
    }
    let exposed = answer.field(&header::ACCESS_CONTROL_EXPOSE_HEADERS).unwrap_or_default();
    let names: Vec<_> = exposed.split(',').map(|name| name.trim().to_ascii_lowercase()).collect();
    let is_exposed = |name: &str| names.iter().any(|n| n == name || n == "*");
    let hidden = ["content-range", "etag"].into_iter().filter(|name| !is_exposed(name));
    let hidden: Vec<_> = hidden.collect();
    if !hidden.is_empty() {
        let found = format!("pages may read it, but do not see {}", list(hidden.into_iter()));
        return Finding::warn(CHECK, found, remedy);
    }
    let asked = [
        (header::ORIGIN, ORIGIN),
        (header::ACCESS_CONTROL_REQUEST_METHOD, "GET"),
        (header::ACCESS_CONTROL_REQUEST_HEADERS, "range,if-range"),
    ];
    let allows = |answer: &Answer| {
        let headers = answer.field(&header::ACCESS_CONTROL_ALLOW_HEADERS).unwrap_or_default();
        let headers = headers.to_ascii_lowercase();
        let allows_range = headers.split(',').any(|name| ["range", "*"].contains(&name.trim()));
        answer.status.is_success() && allows_range
    };
    match probe.ask(Method::OPTIONS, &asked, 0).await {
        Ok(answer) if allows(&answer) => {
            Finding::ok(CHECK, "pages of all hosts may read it, and see what they need")
        }
        Ok(answer) => Finding::warn(
            CHECK,
            format!("browsers that ask before (OPTIONS) are refused: {}", answer.status),
            "answer OPTIONS with Access-Control-Allow-Headers: Range, If-Range",
        ),
        Err(why) => Finding::warn(CHECK, format!("OPTIONS: {why}"), remedy),
    }
}

/// What caches are told.
pub fn cache(answer: &Answer) -> Finding {
    const CHECK: &str = "cache";
    let remedy = "a dataset never changes: send Cache-Control: public, max-age=31536000, immutable where \
                  its address changes with it, a short max-age otherwise";
    let control = answer.field(&header::CACHE_CONTROL).map(str::to_ascii_lowercase);
    match control {
        Some(control) if control.contains("no-store") || control.contains("private") => {
            Finding::warn(
                CHECK,
                format!("Cache-Control: {control} keeps caches from helping"),
                remedy,
            )
        }
        Some(control) => Finding::ok(CHECK, format!("Cache-Control: {control}")),
        None => Finding::ok(CHECK, "no Cache-Control: caches guess how long it is good"),
    }
}

/// The host's clock, and when a signed address expires.
pub fn clock(probe: &Probe, answer: &Answer) -> Finding {
    const CHECK: &str = "clock";
    let now = SystemTime::now();
    let host = answer.field(&header::DATE).and_then(|date| httpdate::parse_http_date(date).ok());
    if let Some(host) = host {
        let apart = host.duration_since(now).unwrap_or_else(|e| e.duration());
        if apart > CLOCK_SLACK {
            let side = if host > now { "ahead of" } else { "behind" };
            let found = format!("the host's clock is {} {side} this machine's", span(apart));
            let remedy = "set the clock that is wrong (NTP): signed addresses and caches go by it";
            return if is_signed(probe.url()) {
                Finding::fail(CHECK, found, remedy)
            } else {
                Finding::warn(CHECK, found, remedy)
            };
        }
    }
    if let Some(left) =
        expiry(probe.url()).and_then(|at| at.duration_since(host.unwrap_or(now)).ok())
        && left < SOON
    {
        let found = format!("the address expires in {}", span(left));
        return Finding::warn(CHECK, found, "have a new one signed before then");
    }
    match host {
        Some(_) => Finding::ok(CHECK, "the host's clock and this machine's agree"),
        None => Finding::ok(CHECK, "the host does not tell its time"),
    }
}

/// Why the host says no: a link that has expired, or clocks that differ, are told apart from the rest.
pub fn access(probe: &Probe, answer: &Answer) -> Finding {
    const CHECK: &str = "access";
    let status = answer.status;
    let said = String::from_utf8_lossy(&answer.body);
    let said: String = said.chars().filter(|c| !c.is_control()).take(120).collect();
    let said = if said.is_empty() { String::new() } else { format!(" ({said})") };
    let host = answer.field(&header::DATE).and_then(|date| httpdate::parse_http_date(date).ok());
    let (now, expires) = (SystemTime::now(), expiry(probe.url()));
    if let Some(expires) = expires {
        let judge = host.unwrap_or(now);
        if let Ok(past) = judge.duration_since(expires) {
            let is_past_here = now.duration_since(expires).is_ok();
            if is_past_here {
                let found = format!("the address expired {} ago: {status}{said}", span(past));
                return Finding::fail(CHECK, found, "have a new address signed");
            }
            let found = format!(
                "by the host's clock the address expired {} ago, by this machine's it is good: \
                 {status}{said}",
                span(past)
            );
            return Finding::fail(
                CHECK,
                found,
                "set the clock that is wrong (NTP), or sign for longer",
            );
        }
    }
    let remedy = if is_signed(probe.url()) {
        "the signature does not hold: check that the address is complete, and that it is for this dataset"
    } else if status == StatusCode::UNAUTHORIZED {
        "the host wants to know who asks: use an address with a signature, or one that is public"
    } else {
        "let the host serve this file (permissions, bucket policy, rules of a firewall or CDN)"
    };
    Finding::fail(CHECK, format!("access denied: {status}{said}"), remedy)
}

/// `3 h 20 min`, `5 min`, `12 s`.
fn span(time: Duration) -> String {
    match time.as_secs() {
        seconds if seconds < 120 => format!("{seconds} s"),
        seconds if seconds < 7200 => format!("{} min", seconds / 60),
        seconds if seconds < 172_800 => format!("{} h", seconds / 3600),
        seconds => format!("{} days", seconds / 86_400),
    }
}

fn list<'a>(words: impl Iterator<Item = &'a str>) -> String {
    words.collect::<Vec<_>>().join(", ")
}
