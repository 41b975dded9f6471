//! The examination, from the first request on. What makes further questions pointless ends it.

use reqwest::{StatusCode, Url, header};

use super::{
    content, fields,
    finding::{Diagnosis, Finding, Verdict},
    probe::{Answer, ORIGIN, Probe},
    ranges, speed,
};
use crate::source::is_local;

/// Bytes of the first request: a header.
const FIRST_BYTES: u64 = 64;

/// Looks at everything between here and the dataset at `url`.
///
/// # Errors
/// Where the system gives no HTTP client.
pub async fn examine(url: Url) -> anyhow::Result<Diagnosis> {
    let probe = Probe::new(url)?;
    let mut findings = Vec::new();
    look(&probe, &mut findings).await;
    let (requests, bytes) = probe.spent();
    let verdict = findings.iter().map(|f| f.verdict).max().unwrap_or(Verdict::Ok);
    Ok(Diagnosis { url: shown(probe.url()), verdict, findings, requests, bytes })
}

async fn look(probe: &Probe, findings: &mut Vec<Finding>) {
    let first = match probe.range_with(0, FIRST_BYTES, &[(header::ORIGIN, ORIGIN)]).await {
        Ok(answer) => answer,
        Err(why) => {
            let remedy = "check the address, that the host is up, and firewalls on the way";
            findings.push(Finding::fail("connection", why, remedy));
            return;
        }
    };
    findings.push(connection(probe, &first));
    findings.push(fields::http(&first));
    if let Some(finding) = refusal(probe, &first) {
        findings.push(finding);
        return;
    }
    findings.push(fields::clock(probe, &first));
    findings.push(fields::content_type(&first));
    let wrong = ranges::range(&first, 0, FIRST_BYTES).or_else(|| ranges::length(&first, 0));
    if let Some(finding) = wrong {
        // Without ranges there is nothing more to be had, but what stands in the way may be told.
        let knows_ranges = first.status == StatusCode::PARTIAL_CONTENT;
        findings.push(finding);
        if !knows_ranges {
            findings.push(fields::cors(probe, &first).await);
        }
        return;
    }
    let total = first.content_range().and_then(|(_, _, total)| total);
    let mut answers = vec![first];
    if let Some(total) = total {
        match ranges::encoding(probe, total).await {
            Ok((finding, answer)) => {
                let goes_on = finding.verdict != Verdict::Fail;
                findings.push(finding);
                answers.push(answer);
                if !goes_on {
                    findings.push(fields::cors(probe, &answers[0]).await);
                    return;
                }
            }
            Err(finding) => findings.push(finding),
        }
        findings.push(ranges::elsewhere(probe, total).await);
        findings.push(ranges::head(probe, total).await);
        findings.push(ranges::at_once(probe, total).await);
    } else {
        findings.push(Finding::warn(
            "ranges",
            "the host does not tell the file's length (Content-Range: bytes …/*)",
            "have it told: clients cannot see that a file is cut short",
        ));
    }
    for _ in 0..2 {
        if let Ok(answer) = probe.range(0, FIRST_BYTES).await {
            answers.push(answer);
        }
    }
    findings.push(fields::etag(probe, &answers.iter().collect::<Vec<_>>()).await);
    findings.push(fields::cache(&answers[0]));
    findings.push(fields::cors(probe, &answers[0]).await);
    let content = content::content(probe, total).await;
    let is_dataset = content.boot.is_some();
    findings.extend(content.findings);
    findings.push(speed::latency(probe).await);
    if let Some(total) = total.filter(|_| is_dataset) {
        findings.push(speed::bandwidth(probe, total).await);
    }
}

/// How the host was reached.
fn connection(probe: &Probe, answer: &Answer) -> Finding {
    const CHECK: &str = "connection";
    let ms = answer.head.as_secs_f64() * 1e3;
    if answer.url != *probe.url() {
        return Finding::warn(
            CHECK,
            format!("every request is sent on to {}", shown(&answer.url)),
            "give users that address: a redirection costs a round trip for each request",
        );
    }
    if probe.url().scheme() == "http" && !is_local(probe.url()) {
        return Finding::warn(
            CHECK,
            format!("answered after {ms:.0} ms, not encrypted"),
            "offer https: pages on https may not read from http, and proxies on the way meddle with it",
        );
    }
    Finding::ok(CHECK, format!("answered after {ms:.0} ms, handshake included"))
}

/// Why there is nothing to look at.
fn refusal(probe: &Probe, answer: &Answer) -> Option<Finding> {
    let status = answer.status;
    Some(match status {
        StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN => fields::access(probe, answer),
        StatusCode::NOT_FOUND | StatusCode::GONE => Finding::fail(
            "access",
            format!("not found: {status}"),
            "check the address; hosts also say so of what one may not read",
        ),
        StatusCode::RANGE_NOT_SATISFIABLE => Finding::fail(
            "size",
            "the file is empty (416 for its first bytes)",
            "copy it to the host again",
        ),
        StatusCode::TOO_MANY_REQUESTS | StatusCode::SERVICE_UNAVAILABLE => Finding::fail(
            "access",
            format!("the host is busy: {status}"),
            "ask again later; raise its limits if this happens often",
        ),
        _ if status.is_success() => {
            let kind = answer.field(&header::CONTENT_TYPE).unwrap_or_default();
            let is_page = kind.contains("html") && status == StatusCode::OK;
            if !is_page {
                return None;
            }
            Finding::fail(
                "type",
                "a web page comes instead of the dataset",
                "check the address; hosts of web applications send their page for whatever they do not know",
            )
        }
        _ => Finding::fail("access", format!("the host answers {status}"), "look into its log"),
    })
}

/// Without what may be secret.
fn shown(url: &Url) -> String {
    let mut shown = url.clone();
    shown.set_query(None);
    // Neither can fail for http URLs; if it did, the URL holds no credentials.
    let _ = shown.set_password(None);
    let _ = shown.set_username("");
    shown.to_string()
}
