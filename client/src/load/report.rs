//! What a load test found, for programs: JSON and tables of CSV. `docs/LOAD.md` specifies them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{
    crowd::Outcome,
    knee::{Knee, knees},
    ledger::Arrivals,
    process::ProcessReport,
    ratio::{Ratios, ratios},
    waits::{WaitReport, Waits, quantiles},
};
use crate::{engine::Policy, source::Fault};

/// What `format` says.
pub const FORMAT: &str = "lodestream-load";
/// What `version` says.
pub const VERSION: u32 = 1;

/// Most points of a curve.
const CURVE_POINTS: usize = 200;

/// A load test.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LoadReport {
    /// [`FORMAT`].
    pub format: String,
    /// [`VERSION`].
    pub version: u32,
    /// Version of the program.
    pub lodestream: String,
    /// Of the clients.
    pub machine: String,
    /// The command line that does the same.
    pub command: String,
    /// Addresses, without secrets.
    pub sources: Vec<String>,
    /// The path, as it was named.
    pub path: String,
    /// Seconds that it takes.
    pub path_seconds: f64,
    /// Jumps along it, besides its beginning.
    pub path_jumps: usize,
    /// Each client's link, where it has one.
    pub link: Option<String>,
    /// Most points of a picture.
    pub point_budget: u64,
    /// Width and height of the picture that nodes are chosen for.
    pub size_px: [u32; 2],
    /// While a camera moves.
    pub views_per_second: f64,
    /// Seconds over which the clients begin.
    pub ramp_seconds: f64,
    /// Whether clients keep what they have from one round to the next.
    pub keeps: bool,
    /// Whether ours asks for many parts with one request, where the host takes such.
    pub batches: bool,
    /// Run by run, as they were made.
    pub runs: Vec<RunReport>,
    /// Where more clients bring less, for each policy that was run with three numbers of them or more.
    pub knees: Vec<Knee>,
    /// Other policies against ours, for each number of clients.
    pub ratios: Vec<Ratios>,
}

/// A run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunReport {
    /// How it was fetched.
    pub policy: Policy,
    /// How many looked.
    pub clients: usize,
    /// How long it was.
    pub seconds: f64,
    /// Why it was over before its time: `interrupted`, or `requests` where they were spent.
    pub cut_short: Option<String>,
    /// Visits begun, complete, and broken down.
    pub visits: Visits,
    /// From when nodes were due to when they were there.
    pub nodes: WaitReport,
    /// Nodes a second.
    pub nodes_per_second: f64,
    /// After cold starts.
    pub cold: ArrivalReport,
    /// After jumps of the camera.
    pub jumps: ArrivalReport,
    /// Requests.
    pub requests: RequestReport,
    /// Bytes.
    pub bytes: ByteReport,
    /// Nodes that were still in the cache when they were wanted again.
    pub cache_hits: u64,
    /// Of all that were wanted and not being drawn, the part that was in the cache.
    pub cache_hit_share: f64,
    /// Nodes dropped from caches.
    pub evictions: u64,
    /// Failures of all kinds.
    pub errors: u64,
    /// By kind.
    pub errors_by_kind: BTreeMap<String, u64>,
    /// The first few, in words.
    pub problems: Vec<String>,
    /// How late the clients set their views: their own machine's doing.
    pub late: WaitReport,
    /// The server's processes, where they could be seen.
    pub server: Option<ProcessReport>,
    /// This program's.
    pub own: Option<ProcessReport>,
    /// Over time.
    pub intervals: Vec<IntervalReport>,
    /// Looks at the processes.
    pub looks: Vec<LookReport>,
    /// Nodes' waits: milliseconds, and the part that had come.
    pub curve: Vec<(f64, f64)>,
}

/// Visits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Visits {
    /// That began.
    pub begun: u64,
    /// That went on to the path's end.
    pub complete: u64,
    /// That broke down because a source could no longer be read.
    pub failed: u64,
}

/// How pictures came in.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ArrivalReport {
    /// Until anything was drawn.
    pub first: WaitReport,
    /// Until all was there.
    pub settled: WaitReport,
    /// Mean bytes until all was there, of those that got there.
    pub bytes: Option<f64>,
    /// Mean requests until then.
    pub requests: Option<f64>,
}

/// Requests.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct RequestReport {
    /// Sent.
    pub sent: u64,
    /// Answered to the end.
    pub complete: u64,
    /// Broken off by the client, because nothing wanted them any more or the visit was over.
    pub broken_off: u64,
    /// Sent a second.
    pub per_second: f64,
    /// From sending to the head of the answer.
    pub head: WaitReport,
    /// From sending to the last byte.
    pub whole: WaitReport,
}

/// Bytes of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ByteReport {
    /// Received.
    pub received: u64,
    /// That were of use.
    pub used: u64,
    /// The others, as a part of all.
    pub wasted_share: f64,
    /// Received a second.
    pub per_second: f64,
}

/// What happened in a stretch of time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IntervalReport {
    /// When it began, since the start.
    pub seconds: f64,
    /// How long it was.
    pub length: f64,
    /// Requests sent.
    pub requests: u64,
    /// Bytes received.
    pub bytes: u64,
    /// Failures.
    pub errors: u64,
    /// Waits of the nodes that were due in it.
    pub nodes: WaitReport,
}

/// What processes took at a moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LookReport {
    /// Since the start.
    pub seconds: f64,
    /// Processors that the server kept busy since the last look.
    pub server_cores: Option<f64>,
    /// The server's memory.
    pub server_bytes: Option<u64>,
    /// Processors that this program kept busy.
    pub own_cores: Option<f64>,
    /// This program's memory.
    pub own_bytes: Option<u64>,
}

impl LoadReport {
    /// Works out what the runs come to together.
    #[must_use]
    pub fn concluded(mut self) -> Self {
        self.knees = knees(&self.runs);
        self.ratios = ratios(&self.runs);
        self
    }

    /// Failures of all runs.
    #[must_use]
    pub fn errors(&self) -> u64 {
        self.runs.iter().map(|run| run.errors).sum()
    }

    /// The report as indented JSON.
    #[must_use]
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("made of numbers and strings") + "\n"
    }

    /// Tables of CSV by their file's names.
    #[must_use]
    pub fn tables(&self) -> Vec<(&'static str, String)> {
        vec![
            ("runs.csv", self.runs_csv()),
            ("intervals.csv", self.intervals_csv()),
            ("latency.csv", self.latency_csv()),
            ("errors.csv", self.errors_csv()),
        ]
    }

    fn runs_csv(&self) -> String {
        let waits =
            ["node", "first", "settled", "jump_first", "jump_settled", "head", "whole", "late"];
        let mut header: Vec<String> = "policy clients seconds visits complete failed nodes \
            nodes_given_up nodes_per_second requests requests_per_second broken_off bytes \
            bytes_per_second wasted_share cache_hits cache_hit_share errors cold_bytes \
            cold_requests server_cores server_memory_before server_memory_peak server_own_peak \
            own_cores own_memory_peak"
            .split_whitespace()
            .map(str::to_owned)
            .collect();
        for name in waits {
            header.extend(["p50", "p90", "p99", "p999"].map(|q| format!("{name}_{q}_ms")));
        }
        table(header, self.runs.iter().map(RunReport::cells))
    }

    fn intervals_csv(&self) -> String {
        let header = "policy clients seconds length requests bytes errors nodes nodes_given_up p50_ms \
                      p90_ms p99_ms";
        let lines = self.runs.iter().flat_map(|run| {
            run.intervals.iter().map(move |at| {
                vec![
                    run.policy.name().into(),
                    run.clients.to_string(),
                    at.seconds.to_string(),
                    at.length.to_string(),
                    at.requests.to_string(),
                    at.bytes.to_string(),
                    at.errors.to_string(),
                    at.nodes.came.to_string(),
                    at.nodes.given_up.to_string(),
                    optional(at.nodes.p50_ms),
                    optional(at.nodes.p90_ms),
                    optional(at.nodes.p99_ms),
                ]
            })
        });
        table(words(header), lines)
    }

    fn latency_csv(&self) -> String {
        let lines = self.runs.iter().flat_map(|run| {
            run.curve.iter().map(move |(ms, came)| {
                let (policy, clients) = (run.policy.name().into(), run.clients.to_string());
                vec![policy, clients, ms.to_string(), came.to_string()]
            })
        });
        table(words("policy clients ms came"), lines)
    }

    fn errors_csv(&self) -> String {
        let lines = self.runs.iter().flat_map(|run| {
            run.errors_by_kind.iter().map(move |(kind, count)| {
                let (policy, clients) = (run.policy.name().into(), run.clients.to_string());
                vec![policy, clients, kind.clone(), count.to_string()]
            })
        });
        table(words("policy clients kind count"), lines)
    }
}

impl RunReport {
    /// What came of a run.
    #[must_use]
    pub fn new(policy: Policy, clients: usize, outcome: &Outcome) -> Self {
        let (entries, counted) = (&outcome.entries, &outcome.counted);
        let seconds = outcome.elapsed.as_secs_f64().max(1e-3);
        let mut errors_by_kind: BTreeMap<String, u64> =
            counted.faults.iter().map(|(fault, count)| (fault.to_string(), *count)).collect();
        if entries.totals.damaged > 0 {
            errors_by_kind.insert(Fault::Damaged.to_string(), entries.totals.damaged);
        }
        let fetched = entries.nodes.count();
        let hits = entries.totals.cache_hits;
        let used = entries.used_bytes.min(outcome.bytes);
        let cut_short = match (outcome.is_interrupted, outcome.is_spent) {
            (true, _) => Some("interrupted".to_owned()),
            (false, true) => Some("requests".to_owned()),
            (false, false) => None,
        };
        Self {
            policy,
            clients,
            seconds,
            cut_short,
            visits: Visits {
                begun: entries.begun,
                complete: entries.complete,
                failed: entries.failed,
            },
            nodes: entries.nodes.report(),
            nodes_per_second: fetched as f64 / seconds,
            cold: ArrivalReport::new(&entries.cold),
            jumps: ArrivalReport::new(&entries.jumps),
            requests: RequestReport {
                sent: outcome.requests,
                complete: counted.complete,
                broken_off: counted.broken_off,
                per_second: outcome.requests as f64 / seconds,
                head: quantiles(&counted.head_us),
                whole: quantiles(&counted.whole_us),
            },
            bytes: ByteReport {
                received: outcome.bytes,
                used,
                wasted_share: share(outcome.bytes - used, outcome.bytes),
                per_second: outcome.bytes as f64 / seconds,
            },
            cache_hits: hits,
            cache_hit_share: share(hits, hits + fetched),
            evictions: entries.totals.evictions,
            errors: errors_by_kind.values().sum(),
            errors_by_kind,
            problems: entries.problems.clone(),
            late: quantiles(&entries.late_us),
            server: outcome.server.clone(),
            own: outcome.own.clone(),
            intervals: intervals(outcome),
            looks: looks(outcome),
            curve: thinned(&entries.nodes),
        }
    }

    fn cells(&self) -> Vec<String> {
        let (server, own) = (self.server.as_ref(), self.own.as_ref());
        let bytes = |bytes: Option<u64>| bytes.map_or_else(String::new, |b| b.to_string());
        let mut cells = vec![
            self.policy.name().to_owned(),
            self.clients.to_string(),
            self.seconds.to_string(),
            self.visits.begun.to_string(),
            self.visits.complete.to_string(),
            self.visits.failed.to_string(),
            self.nodes.came.to_string(),
            self.nodes.given_up.to_string(),
            self.nodes_per_second.to_string(),
            self.requests.sent.to_string(),
            self.requests.per_second.to_string(),
            self.requests.broken_off.to_string(),
            self.bytes.received.to_string(),
            self.bytes.per_second.to_string(),
            self.bytes.wasted_share.to_string(),
            self.cache_hits.to_string(),
            self.cache_hit_share.to_string(),
            self.errors.to_string(),
            optional(self.cold.bytes),
            optional(self.cold.requests),
            optional(server.map(|s| s.cores)),
            bytes(server.map(|s| s.memory_before_bytes)),
            bytes(server.map(|s| s.memory_peak_bytes)),
            bytes(server.map(|s| s.own_peak_bytes)),
            optional(own.map(|s| s.cores)),
            bytes(own.map(|s| s.memory_peak_bytes)),
        ];
        for waits in [
            self.nodes,
            self.cold.first,
            self.cold.settled,
            self.jumps.first,
            self.jumps.settled,
            self.requests.head,
            self.requests.whole,
            self.late,
        ] {
            cells.extend([waits.p50_ms, waits.p90_ms, waits.p99_ms, waits.p999_ms].map(optional));
        }
        cells
    }
}

impl ArrivalReport {
    fn new(arrivals: &Arrivals) -> Self {
        let count = arrivals.settled.count();
        let mean = |sum: u64| (count > 0).then(|| sum as f64 / count as f64);
        Self {
            first: arrivals.first.report(),
            settled: arrivals.settled.report(),
            bytes: mean(arrivals.bytes),
            requests: mean(arrivals.requests),
        }
    }
}

fn intervals(outcome: &Outcome) -> Vec<IntervalReport> {
    let step = outcome.interval.as_secs_f64();
    let length = outcome.elapsed.as_secs_f64();
    let (traffic, nodes) = (&outcome.counted.intervals, &outcome.entries.nodes_over_time);
    let count = ((length / step).ceil() as usize).clamp(1, nodes.len().max(1));
    let at = |index: usize| {
        let traffic = traffic.get(index).copied().unwrap_or_default();
        let seconds = index as f64 * step;
        IntervalReport {
            seconds,
            length: step.min(length - seconds).max(0.0),
            requests: traffic.requests,
            bytes: traffic.bytes,
            errors: traffic.faults,
            nodes: nodes.get(index).map(Waits::report).unwrap_or_default(),
        }
    };
    (0..count).map(at).collect()
}

/// Once a stretch of time.
fn looks(outcome: &Outcome) -> Vec<LookReport> {
    let mut reports = Vec::new();
    let Some(mut last) = outcome.looks.first() else { return reports };
    for look in &outcome.looks {
        let passed = look.at - last.at;
        if passed < outcome.interval {
            continue;
        }
        let cores = |now: Option<super::process::Usage>, before: Option<super::process::Usage>| {
            let spent = now?.cpu.saturating_sub(before?.cpu);
            Some(spent.as_secs_f64() / passed.as_secs_f64())
        };
        reports.push(LookReport {
            seconds: look.at.as_secs_f64(),
            server_cores: cores(look.server, last.server),
            server_bytes: look.server.map(|usage| usage.memory_bytes),
            own_cores: cores(look.own, last.own),
            own_bytes: look.own.map(|usage| usage.memory_bytes),
        });
        last = look;
    }
    reports
}

/// As few points as show the curve, in steps of what is still waited for.
fn thinned(waits: &Waits) -> Vec<(f64, f64)> {
    let curve = waits.curve();
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for (index, &(ms, came)) in curve.iter().enumerate() {
        let is_end = index == 0 || index + 1 == curve.len();
        // Even steps of the share that waits, and of its logarithm.
        let steps = CURVE_POINTS as f64 / 2.0;
        let step = |came: f64| {
            let left = (1.0 - came).max(1e-9);
            ((came * steps) as i64, (-left.log10() * steps / 9.0) as i64)
        };
        if is_end || kept.last().is_none_or(|last| step(last.1) != step(came)) {
            kept.push((ms, came));
        }
    }
    kept
}

fn share(part: u64, all: u64) -> f64 {
    if all == 0 { 0.0 } else { part as f64 / all as f64 }
}

fn words(text: &str) -> Vec<String> {
    text.split_whitespace().map(str::to_owned).collect()
}

fn optional(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

fn table(header: Vec<String>, lines: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in std::iter::once(header).chain(lines) {
        writer.write_record(line).expect("lines of text, as long as the header, go into memory");
    }
    let bytes = writer.into_inner().expect("memory can be written");
    String::from_utf8(bytes).expect("made of strings")
}
