//! What a load test found, for a terminal.

use super::{
    report::{LoadReport, RunReport},
    waits::WaitReport,
};

/// Views set later than this (99 %) tell of the clients' machine, not of the server.
pub(super) const LATE_MS: f64 = 50.0;

/// The table and what it comes to.
#[must_use]
pub fn summary(report: &LoadReport) -> String {
    let header = [
        "policy",
        "clients",
        "nodes/s",
        "MB/s",
        "req/s",
        "node p50",
        "p90",
        "p99",
        "p99.9",
        "not in time",
        "first",
        "settled",
        "after jump",
        "wasted",
        "cache",
        "server",
        "memory",
        "errors",
    ];
    let mut rows = vec![header.map(str::to_owned).to_vec()];
    rows.extend(report.runs.iter().map(cells));
    let mut text = table(&rows);
    text += "waits from when nodes were due; first, settled: medians after a cold start; server: cores\n";
    for line in remarks(report) {
        text += &line;
        text.push('\n');
    }
    text
}

fn cells(run: &RunReport) -> Vec<String> {
    let WaitReport { p50_ms, p90_ms, p99_ms, p999_ms, .. } = run.nodes;
    let server = run.server.as_ref();
    vec![
        run.policy.name().into(),
        run.clients.to_string(),
        format!("{:.0}", run.nodes_per_second),
        format!("{:.1}", run.bytes.per_second / 1e6),
        format!("{:.0}", run.requests.per_second),
        time(p50_ms),
        time(p90_ms),
        time(p99_ms),
        time(p999_ms),
        percent(run.nodes.given_up_share()),
        time(run.cold.first.p50_ms),
        time(run.cold.settled.p50_ms),
        time(run.jumps.settled.p50_ms),
        percent(run.bytes.wasted_share),
        percent(run.cache_hit_share),
        server.map_or("-".into(), |s| format!("{:.2}", s.cores)),
        server.map_or("-".into(), |s| mebibytes(s.memory_peak_bytes)),
        run.errors.to_string(),
    ]
}

/// What is to be known of the figures.
#[must_use]
pub(super) fn remarks(report: &LoadReport) -> Vec<String> {
    let mut lines = Vec::new();
    for ratio in &report.ratios {
        let part = |name: &str, value: Option<f64>| Some(format!("{:.2}x the {name}", value?));
        let told =
            |parts: [Option<String>; 4]| parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
        let cold = told([
            part("time to settled", ratio.cold_settled),
            part("time to the first picture", ratio.cold_first),
            part("bytes", ratio.cold_bytes),
            part("requests", ratio.cold_requests),
        ]);
        let (policy, clients) = (ratio.policy.name(), number_of_clients(ratio.clients));
        if !cold.is_empty() {
            lines.push(format!("{policy} against ours, {clients}, cold: {cold}"));
        }
        let jump = told([
            part("time to settled", ratio.jump_settled),
            part("time to the first picture", ratio.jump_first),
            part("bytes", ratio.jump_bytes),
            part("requests", ratio.jump_requests),
        ]);
        if !jump.is_empty() {
            lines.push(format!("{policy} against ours, {clients}, after jumps: {jump}"));
        }
    }
    for knee in &report.knees {
        let beyond = if knee.is_reached { "" } else { " or beyond, where none were tried" };
        lines.push(format!(
            "{}: the knee is at {}{beyond} (most nodes a second for their wait)",
            knee.policy.name(),
            number_of_clients(knee.clients)
        ));
    }
    for run in &report.runs {
        let of = format!("{}, {}", run.policy.name(), number_of_clients(run.clients));
        if let Some(late) = run.late.p99_ms.filter(|&late| late > LATE_MS) {
            lines.push(format!(
                "note: {of}: this program was the bottleneck at times: 1 % of views were set more than \
                 {late:.0} ms late; use more machines or fewer clients"
            ));
        }
        if let Some(why) = &run.cut_short {
            lines.push(format!("note: {of}: cut short: {why}"));
        }
        if run.errors > 0 {
            let kinds = run.errors_by_kind.iter().map(|(kind, count)| format!("{count} {kind}"));
            lines.push(format!("errors: {of}: {}", kinds.collect::<Vec<_>>().join(", ")));
        }
        if let Some(problem) = run.problems.first() {
            lines.push(format!("first problem: {of}: {problem}"));
        }
    }
    lines
}

pub(super) fn number_of_clients(clients: usize) -> String {
    if clients == 1 { "1 client".into() } else { format!("{clients} clients") }
}

impl WaitReport {
    /// The part that was given up.
    #[must_use]
    pub fn given_up_share(&self) -> f64 {
        let all = self.came + self.given_up;
        if all == 0 { 0.0 } else { self.given_up as f64 / all as f64 }
    }
}

/// Milliseconds, or seconds where there are many.
pub(super) fn time(ms: Option<f64>) -> String {
    match ms {
        None => "-".into(),
        Some(ms) if ms < 10.0 => format!("{ms:.1} ms"),
        Some(ms) if ms < 1000.0 => format!("{ms:.0} ms"),
        Some(ms) => format!("{:.2} s", ms / 1e3),
    }
}

pub(super) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

pub(super) fn mebibytes(bytes: u64) -> String {
    format!("{:.0} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Columns two spaces apart, the first to the left and numbers to the right.
fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|row| row.get(column));
        cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<_> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let cells =
            row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| match column {
                0 => format!("{cell:<width$}"),
                _ => format!("{cell:>width$}"),
            });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_in_units_that_fit() {
        assert_eq!(
            [None, Some(3.21), Some(321.0), Some(3210.0)].map(time),
            ["-", "3.2 ms", "321 ms", "3.21 s"]
        );
    }

    #[test]
    fn numbers_stand_below_one_another() {
        let rows = [vec!["a", "1"], vec!["bcd", "1,000"]]
            .map(|row| row.into_iter().map(str::to_owned).collect());
        assert_eq!(table(&rows), "a        1\nbcd  1,000\n");
    }
}
