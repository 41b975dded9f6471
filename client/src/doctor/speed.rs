//! How fast the host answers from here.

use std::time::Duration;

use reqwest::StatusCode;

use super::{finding::Finding, probe::Probe};

/// Small requests whose median counts.
const TRIES: usize = 5;

/// A slower answer is felt at every move of the camera.
const SLOW: Duration = Duration::from_millis(250);

/// Bytes that are fetched to tell the bandwidth, and the least that can tell it.
const BANDWIDTH_BYTES: u64 = 4 << 20;
const LEAST_BYTES: u64 = 256 << 10;

/// How long that may take; then what has come by then tells.
const LONGEST: Duration = Duration::from_secs(3);

/// A million points are some 5 MB: with less than this they take more than eight seconds.
const NARROW_MBIT: f64 = 5.0;

/// From a request to the head of its answer.
pub async fn latency(probe: &Probe) -> Finding {
    const CHECK: &str = "latency";
    let mut times = Vec::new();
    for _ in 0..TRIES {
        if let Ok(answer) = probe.range(0, 64).await {
            times.push(answer.head);
        }
    }
    times.sort_unstable();
    let Some(&median) = times.get(times.len() / 2) else {
        return Finding::warn(CHECK, "small requests are not answered", "look into the host's log");
    };
    let found =
        format!("{:.1} ms until a small request is answered (median)", milliseconds(median));
    if median > SLOW {
        let remedy = "host it nearer to its users, or put a CDN before it that caches ranges";
        return Finding::warn(CHECK, found, remedy);
    }
    Finding::ok(CHECK, found)
}

/// Bits a second of a long answer.
pub async fn bandwidth(probe: &Probe, total: u64) -> Finding {
    const CHECK: &str = "bandwidth";
    let end = total.min(BANDWIDTH_BYTES);
    if end < LEAST_BYTES {
        return Finding::ok(CHECK, format!("{end} bytes are too few to tell"));
    }
    match probe.range_within(0, end, LONGEST).await {
        Ok(answer) if answer.broken.is_none() && answer.status == StatusCode::PARTIAL_CONTENT => {
            let bytes = answer.body.len() as f64;
            // With the wait for the head: a host that sends all at once has sent it by then.
            let mbit = bytes * 8e-6 / answer.whole.as_secs_f64().max(1e-6);
            let found = format!("{mbit:.0} Mbit/s over {:.1} MB", bytes / 1e6);
            if mbit < NARROW_MBIT {
                let remedy = "look for limits of the host and of proxies (nginx: limit_rate), and for a narrow \
                              link on the way";
                return Finding::warn(CHECK, found, remedy);
            }
            Finding::ok(CHECK, found)
        }
        Ok(answer) => {
            let why = answer.broken.unwrap_or_else(|| answer.status.to_string());
            Finding::warn(CHECK, format!("{end} bytes at once: {why}"), "look into the host's log")
        }
        Err(why) => {
            Finding::warn(CHECK, format!("{end} bytes at once: {why}"), "look into the host's log")
        }
    }
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
