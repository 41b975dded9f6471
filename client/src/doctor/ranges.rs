//! Whether the host answers ranges as they were asked for.

use reqwest::{Method, StatusCode, header};

use super::{
    finding::Finding,
    probe::{Answer, ORIGIN, Probe},
};

/// Bytes of a range that is large enough to be compressed on its way.
const COMPRESSIBLE_BYTES: u64 = 16 << 10;

/// Requests at a time, as browsers and our client send them.
const AT_ONCE: usize = 6;

/// What there is to say about an answer to a request for `start` to `end` (which lies in the file).
pub fn range(answer: &Answer, start: u64, end: u64) -> Option<Finding> {
    const CHECK: &str = "ranges";
    if answer.status == StatusCode::OK {
        return Some(Finding::fail(
            CHECK,
            "a range is answered with the whole file (200 instead of 206)",
            "switch ranges on in the host or the proxy before it (nginx: do not set max_ranges 0; a proxy \
             that buffers must pass Range on), or use `lodestream serve`",
        ));
    }
    if answer.status != StatusCode::PARTIAL_CONTENT {
        return Some(Finding::fail(
            CHECK,
            format!("a range is answered {}", answer.status),
            "look into the host's log",
        ));
    }
    let Some((first, last, total)) = answer.content_range() else {
        let told = answer.field(&header::CONTENT_RANGE).unwrap_or("nothing");
        return Some(Finding::fail(
            CHECK,
            format!("status 206, but Content-Range says {told}"),
            "the host, or a proxy before it, is broken: it must say `bytes FIRST-LAST/TOTAL`",
        ));
    };
    let ends_early = total.is_some_and(|total| last == total && last < end);
    if first != start || (last != end && !ends_early) {
        return Some(Finding::fail(
            CHECK,
            format!("asked for bytes {start} to {end}, the answer is of {first} to {last}"),
            "a cache before the host mixes ranges up: have it pass them through or cache whole slices \
             (nginx: slice and proxy_cache_key with $slice_range)",
        ));
    }
    None
}

/// What there is to say about the length of a good answer's body.
pub fn length(answer: &Answer, start: u64) -> Option<Finding> {
    const CHECK: &str = "length";
    let (_, last, _) = answer.content_range()?;
    let (expected, found) = (last - start, answer.body.len() as u64);
    let announced = answer.field(&header::CONTENT_LENGTH).and_then(|n| n.parse::<u64>().ok());
    if let Some(announced) = announced.filter(|&n| n != expected) {
        return Some(Finding::fail(
            CHECK,
            format!("Content-Length says {announced}, Content-Range {expected} bytes"),
            "the host, or a proxy before it, changes bodies: switch compression and rewriting off for \
             .lods",
        ));
    }
    if let Some(why) = &answer.broken {
        return Some(Finding::fail(
            CHECK,
            format!("the answer broke off after {found} of {expected} bytes: {why}"),
            "look for time limits and buffer sizes of the host and of proxies (nginx: \
             proxy_read_timeout, proxy_max_temp_file_size), and for a full disk",
        ));
    }
    (found != expected).then(|| {
        let remedy =
            "the host, or a proxy before it, cuts bodies or pads them: go round it to find which";
        Finding::fail(CHECK, format!("{found} bytes came instead of {expected}"), remedy)
    })
}

/// Ranges elsewhere in the file, several at once, and beyond its end.
pub async fn elsewhere(probe: &Probe, total: u64) -> Finding {
    const CHECK: &str = "ranges";
    let (middle, end) = (total / 2, total);
    for (start, end) in [(middle, (middle + 100).min(total)), (end.saturating_sub(10), end)] {
        if start >= end {
            continue;
        }
        match probe.range(start, end).await {
            Ok(answer) => {
                let wrong = range(&answer, start, end).or_else(|| length(&answer, start));
                if let Some(finding) = wrong {
                    return finding;
                }
            }
            Err(why) => {
                let found = format!("bytes {start} to {end}: {why}");
                return Finding::fail(CHECK, found, "look into the host's log");
            }
        }
    }
    match probe.range(total, total + 10).await {
        Ok(answer) if answer.status == StatusCode::RANGE_NOT_SATISFIABLE => Finding::ok(
            CHECK,
            "answered as asked: at the start, in the middle, at the end; 416 beyond it",
        ),
        Ok(answer) => Finding::warn(
            CHECK,
            format!("a range beyond the end is answered {} instead of 416", answer.status),
            "harmless here, but not what RFC 9110 (14.2) says: look into the host",
        ),
        Err(why) => {
            Finding::warn(CHECK, format!("beyond the end: {why}"), "look into the host's log")
        }
    }
}

/// Whether a range comes as it is to someone who takes compressed answers.
pub async fn encoding(probe: &Probe, total: u64) -> Result<(Finding, Answer), Finding> {
    const CHECK: &str = "encoding";
    let end = total.min(COMPRESSIBLE_BYTES);
    let fields = [(header::ACCEPT_ENCODING, "gzip, deflate, br, zstd"), (header::ORIGIN, ORIGIN)];
    let answer = probe.range_with(0, end, &fields).await.map_err(|why| {
        Finding::fail(CHECK, format!("with Accept-Encoding: {why}"), "look into the host's log")
    })?;
    let coding = answer.field(&header::CONTENT_ENCODING).filter(|coding| *coding != "identity");
    let finding = match coding {
        Some(coding) => Finding::fail(
            CHECK,
            format!("ranges come compressed ({coding}) to browsers, which read other bytes then"),
            "switch compression off for .lods (nginx: gzip off; Cloudflare: Cache-Control: no-transform): \
             datasets are compressed already",
        ),
        None => match range(&answer, 0, end).or_else(|| length(&answer, 0)) {
            Some(finding) => finding,
            None => Finding::ok(CHECK, "nothing is compressed on its way"),
        },
    };
    Ok((finding, answer))
}

/// Several requests at a time.
pub async fn at_once(probe: &Probe, total: u64) -> Finding {
    const CHECK: &str = "parallel";
    let ask = |index: usize| {
        let start = total / AT_ONCE as u64 * index as u64;
        async move { (start, probe.range(start, (start + 64).min(total)).await) }
    };
    let [a, b, c, d, e, f] = std::array::from_fn(ask);
    let answers = tokio::join!(a, b, c, d, e, f);
    for (start, answer) in [answers.0, answers.1, answers.2, answers.3, answers.4, answers.5] {
        let wrong = match answer {
            Ok(answer) if answer.is_range(start, (start + 64).min(total)) => continue,
            Ok(answer) => answer.status.to_string(),
            Err(why) => why,
        };
        return Finding::warn(
            CHECK,
            format!("of {AT_ONCE} requests at a time not all are answered: {wrong}"),
            "raise the host's limits on connections and requests per client (nginx: limit_conn, limit_req)",
        );
    }
    Finding::ok(CHECK, format!("{AT_ONCE} requests at a time are answered"))
}

/// Whether `HEAD` tells what `GET` would.
pub async fn head(probe: &Probe, total: u64) -> Finding {
    const CHECK: &str = "head";
    match probe.ask(Method::HEAD, &[], 0).await {
        Ok(answer) => {
            let length = answer.field(&header::CONTENT_LENGTH).and_then(|n| n.parse::<u64>().ok());
            if answer.status == StatusCode::OK && length == Some(total) {
                return Finding::ok(CHECK, "HEAD tells the length");
            }
            let told = length.map_or("no length".to_owned(), |n| format!("{n} bytes"));
            Finding::warn(
                CHECK,
                format!("HEAD is answered {} with {told} instead of {total}", answer.status),
                "tools and CDNs ask so: have HEAD answered as GET is",
            )
        }
        Err(why) => Finding::warn(CHECK, format!("HEAD: {why}"), "have HEAD answered as GET is"),
    }
}
