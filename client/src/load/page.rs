//! What a load test found, as a page: the answer first, then curves, then what went wrong.

use maud::{Markup, html};

use super::{
    report::{IntervalReport, LoadReport, LookReport, RunReport},
    summary::{LATE_MS, mebibytes, number_of_clients, percent, remarks, time},
};
use crate::{
    engine::Policy,
    report::{Align, Cell, Mark, Page, Plot, Scale, Section, Series, Table, Tone},
};

/// The page.
#[must_use]
pub fn page(report: &LoadReport) -> Page {
    let mut sections = vec![answer(report), waits(report)];
    let policies = policies_with_many(report);
    if !policies.is_empty() {
        sections.push(growth(report, &policies));
    }
    if !report.ratios.is_empty() {
        sections.push(beside(report));
    }
    sections.extend(report.runs.iter().map(|run| over_time(run, report.runs.len() == 1)));
    if report.errors() > 0 || report.runs.iter().any(|run| !run.problems.is_empty()) {
        sections.push(errors(report));
    }
    let [width, height] = report.size_px;
    let jumps = report.path_jumps;
    Page {
        title: "Load test".into(),
        summary: summary(report),
        facts: vec![
            ("dataset".into(), report.sources.join(", ")),
            ("path".into(), format!("{} ({} s, {jumps} jumps)", report.path, report.path_seconds)),
            ("link".into(), report.link.clone().unwrap_or_else(|| "as fast as it comes".into())),
            (
                "picture".into(),
                format!("{width} x {height}, {} points", thousands(report.point_budget)),
            ),
            ("clients on".into(), report.machine.clone()),
            ("lodestream".into(), report.lodestream.clone()),
        ],
        command: report.command.clone(),
        tiles: tiles(report),
        sections,
    }
}

/// The run that is told first: of ours, where there is one, the knee's, or the one with most clients.
fn first_run(report: &LoadReport) -> Option<&RunReport> {
    let policy = report.runs.first()?.policy;
    let knee = report.knees.iter().find(|knee| knee.policy == policy).map(|knee| knee.clients);
    let of_policy = || report.runs.iter().filter(|run| run.policy == policy);
    let at_knee = of_policy().find(|run| Some(run.clients) == knee);
    at_knee.or_else(|| of_policy().max_by_key(|run| run.clients))
}

fn summary(report: &LoadReport) -> String {
    let Some(run) = first_run(report) else { return "No run was made.".into() };
    let wait = match run.nodes.p99_ms {
        Some(ms) => format!("99 % of nodes come within {} of when they are due", time(Some(ms))),
        None => "fewer than 99 % of nodes come at all".into(),
    };
    let errors = match report.errors() {
        0 => "No error.".into(),
        1 => "One error.".into(),
        errors => format!("{errors} errors."),
    };
    let knee = report.knees.iter().find(|knee| knee.policy == run.policy).map_or("", |knee| {
        if knee.is_reached {
            ", at the knee of the server's curve"
        } else {
            ", and there is no knee yet"
        }
    });
    format!("With {}{knee}, {wait}. {errors}", number_of_clients(run.clients))
}

fn tiles(report: &LoadReport) -> Vec<(String, String, Tone)> {
    let Some(run) = first_run(report) else { return Vec::new() };
    let mut tiles = vec![
        (time(run.nodes.p99_ms), "until 99 % of nodes are there (p99)".into(), Tone::Plain),
        (time(run.cold.first.p50_ms), "to the first picture (median)".into(), Tone::Plain),
        (time(run.cold.settled.p50_ms), "until all is there (median)".into(), Tone::Plain),
        (
            format!("{} MB/s", short(run.bytes.per_second / 1e6)),
            "received by all clients".into(),
            Tone::Plain,
        ),
    ];
    if let Some(server) = &run.server {
        let cores = format!("server memory at most; {:.2} cores busy", server.cores);
        tiles.push((mebibytes(server.memory_peak_bytes), cores, Tone::Plain));
    }
    let tone = if report.errors() == 0 { Tone::Good } else { Tone::Bad };
    tiles.push((report.errors().to_string(), "errors in all runs".into(), tone));
    tiles
}

fn answer(report: &LoadReport) -> Section {
    let mut table = Table::new(&[
        ("run", Align::Word),
        ("nodes/s", Align::Number),
        ("MB/s", Align::Number),
        ("req/s", Align::Number),
        ("p50", Align::Number),
        ("p90", Align::Number),
        ("p99", Align::Number),
        ("p99.9", Align::Number),
        ("not in time", Align::Number),
        ("first", Align::Number),
        ("settled", Align::Number),
        ("after jump", Align::Number),
        ("wasted", Align::Number),
        ("cache", Align::Number),
        ("cores", Align::Number),
        ("memory", Align::Number),
        ("errors", Align::Number),
    ]);
    for run in &report.runs {
        let is_knee =
            report.knees.iter().any(|k| k.policy == run.policy && k.clients == run.clients);
        let server = run.server.as_ref();
        let errors = if run.errors == 0 { Tone::Good } else { Tone::Bad };
        table.rows.push(vec![
            Cell::Markup(html! {
                (chip(run)) " " (number_of_clients(run.clients))
                @if is_knee { " " span.chip.warn { "knee" } }
            }),
            format!("{:.0}", run.nodes_per_second).into(),
            format!("{:.1}", run.bytes.per_second / 1e6).into(),
            format!("{:.0}", run.requests.per_second).into(),
            time(run.nodes.p50_ms).into(),
            time(run.nodes.p90_ms).into(),
            time(run.nodes.p99_ms).into(),
            time(run.nodes.p999_ms).into(),
            percent(run.nodes.given_up_share()).into(),
            time(run.cold.first.p50_ms).into(),
            time(run.cold.settled.p50_ms).into(),
            time(run.jumps.settled.p50_ms).into(),
            percent(run.bytes.wasted_share).into(),
            percent(run.cache_hit_share).into(),
            server.map_or("-".into(), |s| Cell::from(format!("{:.2}", s.cores))),
            server.map_or("-".into(), |s| Cell::from(mebibytes(s.memory_peak_bytes))),
            Cell::Toned(run.errors.to_string(), errors),
        ]);
    }
    let remarks: Vec<_> = remarks(report);
    Section {
        anchor: "answer".into(),
        title: "What each client waited for".into(),
        lead: "A node's wait begins when the camera's clock makes it due, whether or not anybody had got \
               round to asking for it: the figures are free of coordinated omission. “Not in time” is the \
               part that the camera had left behind, or the run had ended, before it came; the \
               quantiles take it into account (Kaplan-Meier). First picture, settled after a cold start \
               and settled after a jump are medians; cores and memory are the server's."
            .into(),
        body: html! {
            (table.markup())
            @if !remarks.is_empty() { ul.remarks { @for line in &remarks { li { (line) } } } }
        },
    }
}

fn chip(run: &RunReport) -> Markup {
    let class = if run.policy == Policy::Ours { "chip good" } else { "chip" };
    html! { span class=(class) { (run.policy.name()) } }
}

fn name(run: &RunReport) -> String {
    format!("{}, {}", run.policy.name(), number_of_clients(run.clients))
}

fn waits(report: &LoadReport) -> Section {
    let spectrum = Plot {
        title: "Nodes that are still waited for".into(),
        x: "milliseconds since the node was due".into(),
        y: "nines: 1 is 10 % left, 2 is 1 %, 3 is 0.1 %".into(),
        x_scale: Scale::Logarithmic,
        y_range: None,
        levels: vec![1.0, 2.0, 3.0],
        marks: Vec::new(),
        series: report
            .runs
            .iter()
            .enumerate()
            .map(|(index, run)| Series {
                name: name(run),
                color: index % 8 + 1,
                points: run
                    .curve
                    .iter()
                    .filter(|(ms, came)| *ms > 0.0 && *came < 1.0)
                    .map(|(ms, came)| (*ms, -(1.0 - came).log10()))
                    .collect(),
                mark: Mark::Steps,
            })
            .collect(),
    };
    let shares = Plot {
        title: "Nodes that have come".into(),
        x: "milliseconds since the node was due".into(),
        y: "part of all".into(),
        y_range: Some((0.0, 1.0)),
        levels: vec![0.5, 0.9, 0.99],
        series: report
            .runs
            .iter()
            .enumerate()
            .map(|(index, run)| Series {
                name: name(run),
                color: index % 8 + 1,
                points: run.curve.iter().copied().filter(|(ms, _)| *ms > 0.0).collect(),
                mark: Mark::Steps,
            })
            .collect(),
        ..spectrum.clone()
    };
    Section {
        anchor: "waits".into(),
        title: "Waits, all of them".into(),
        lead: "To the left is better. In the second drawing the slowest of a thousand nodes stand out."
            .into(),
        body: html! { div.plots { (shares.markup()) (spectrum.markup()) } },
    }
}

/// Policies that were run with several numbers of clients.
fn policies_with_many(report: &LoadReport) -> Vec<Policy> {
    let of = |policy: &Policy| report.runs.iter().filter(|run| run.policy == *policy).count();
    Policy::ALL.into_iter().filter(|policy| of(policy) > 1).collect()
}

/// What becomes of the figures as clients become more.
fn growth(report: &LoadReport, policies: &[Policy]) -> Section {
    let plot = |title: &str, y: &str, value: &dyn Fn(&RunReport) -> Option<f64>| Plot {
        title: title.into(),
        x: "clients".into(),
        y: y.into(),
        x_scale: Scale::Logarithmic,
        y_range: None,
        levels: Vec::new(),
        marks: report.knees.iter().take(1).map(|k| (k.clients as f64, "knee".into())).collect(),
        series: policies
            .iter()
            .map(|policy| Series {
                name: policy.name().into(),
                color: color(*policy),
                points: report
                    .runs
                    .iter()
                    .filter(|run| run.policy == *policy)
                    .filter_map(|run| Some((run.clients as f64, value(run)?)))
                    .collect(),
                mark: Mark::Line,
            })
            .collect(),
    };
    let plots = [
        plot("Throughput", "megabytes a second", &|run| Some(run.bytes.per_second / 1e6)),
        plot("Wait of a node, 99 %", "milliseconds", &|run| run.nodes.p99_ms),
        plot("Until all is there, median", "milliseconds", &|run| run.cold.settled.p50_ms),
        plot("Server memory", "MiB", &|run| {
            Some(run.server.as_ref()?.memory_peak_bytes as f64 / f64::from(1 << 20))
        }),
    ];
    let lead = "At the knee, throughput over median wait is greatest (Kleinrock 1979): with more clients each \
                waits for the others.";
    Section {
        anchor: "growth".into(),
        title: "More clients".into(),
        lead: lead.into(),
        body: html! {
            div.plots {
                @for plot in plots.iter().filter(|p| p.series.iter().any(|s| !s.points.is_empty())) {
                    (plot.markup())
                }
            }
        },
    }
}

fn beside(report: &LoadReport) -> Section {
    let mut table = Table::new(&[
        ("policy", Align::Word),
        ("clients", Align::Number),
        ("first picture", Align::Number),
        ("settled", Align::Number),
        ("bytes", Align::Number),
        ("requests", Align::Number),
        ("after jump: first picture", Align::Number),
        ("settled", Align::Number),
        ("bytes", Align::Number),
        ("requests", Align::Number),
        ("node p50", Align::Number),
        ("node p99", Align::Number),
    ]);
    for ratio in &report.ratios {
        let cell = |value: Option<f64>| {
            let tone = if value.is_none_or(|v| v >= 1.0) { Tone::Good } else { Tone::Warn };
            Cell::Toned(value.map_or("-".into(), |v| format!("{v:.2}x")), tone)
        };
        table.rows.push(vec![
            Cell::Chip(ratio.policy.name().into(), Tone::Plain),
            ratio.clients.to_string().into(),
            cell(ratio.cold_first),
            cell(ratio.cold_settled),
            cell(ratio.cold_bytes),
            cell(ratio.cold_requests),
            cell(ratio.jump_first),
            cell(ratio.jump_settled),
            cell(ratio.jump_bytes),
            cell(ratio.jump_requests),
            cell(ratio.node_p50),
            cell(ratio.node_p99),
        ]);
    }
    Section {
        anchor: "ratios".into(),
        title: "Other ways to fetch, against ours".into(),
        lead: "How many times as much as ours: above 1, ours is better. Medians; bytes and requests are means \
               until all was there. File, tree, budget and server are the same; which nodes are too small to \
               be wanted is each policy's own."
            .into(),
        body: table.markup(),
    }
}

fn over_time(run: &RunReport, is_only: bool) -> Section {
    // Each stretch of time is drawn to its end.
    let steps = |value: &dyn Fn(&IntervalReport) -> Option<f64>| {
        let known = run.intervals.iter().filter_map(|at| Some((at, value(at)?)));
        let ends = |(at, value): (&IntervalReport, f64)| {
            [(at.seconds, value), (at.seconds + at.length, value)]
        };
        known.flat_map(ends).collect::<Vec<_>>()
    };
    let rate = |value: fn(&IntervalReport) -> f64| {
        // A short one at the end tells no rate.
        steps(&|at| (at.length > 0.5).then(|| value(at) / at.length))
    };
    let wait = |value: fn(&IntervalReport) -> Option<f64>| steps(&value);
    let look = |value: &dyn Fn(&LookReport) -> Option<f64>| {
        run.looks.iter().filter_map(|at| Some((at.seconds, value(at)?))).collect::<Vec<_>>()
    };
    let series = |name: &str, color: usize, points: Vec<(f64, f64)>| Series {
        name: name.into(),
        color,
        points,
        mark: Mark::Steps,
    };
    let plot = |title: &str, y: &str, series: Vec<Series>| Plot {
        title: title.into(),
        x: "seconds".into(),
        y: y.into(),
        x_scale: Scale::Linear,
        y_range: None,
        levels: Vec::new(),
        marks: Vec::new(),
        series,
    };
    let mib = |bytes: Option<u64>| Some(bytes? as f64 / f64::from(1 << 20));
    let mut plots = vec![
        plot(
            "Bytes",
            "megabytes a second",
            vec![series("received", 1, rate(|at| at.bytes as f64 / 1e6))],
        ),
        plot("Requests", "a second", vec![series("sent", 1, rate(|at| at.requests as f64))]),
        plot(
            "Waits by when the nodes were due",
            "milliseconds",
            vec![
                series("p50", 1, wait(|at| at.nodes.p50_ms)),
                series("p90", 4, wait(|at| at.nodes.p90_ms)),
                series("p99", 2, wait(|at| at.nodes.p99_ms)),
            ],
        ),
        plot(
            "Processors",
            "cores busy",
            vec![
                series("server", 1, look(&|at| at.server_cores)),
                series("clients", 3, look(&|at| at.own_cores)),
            ],
        ),
        plot(
            "Memory",
            "MiB",
            vec![
                series("server", 1, look(&|at| mib(at.server_bytes))),
                series("clients", 3, look(&|at| mib(at.own_bytes))),
            ],
        ),
    ];
    if run.errors > 0 {
        plots.push(plot(
            "Errors",
            "a second",
            vec![series("failed", 2, rate(|at| at.errors as f64))],
        ));
    }
    for plot in &mut plots {
        plot.series.retain(|series| !series.points.is_empty());
        // From nothing up, so that drawings of several runs compare.
        let highest =
            plot.series.iter().flat_map(|s| s.points.iter().map(|p| p.1)).fold(0.0, f64::max);
        plot.y_range = Some((0.0, if highest > 0.0 { 1.05 * highest } else { 1.0 }));
    }
    plots.retain(|plot| !plot.series.is_empty());
    let title = if is_only { "Over time".to_owned() } else { format!("Over time: {}", name(run)) };
    Section {
        anchor: format!("time-{}-{}", run.policy.name(), run.clients),
        title,
        lead: format!(
            "{} visits in {:.1} s, {} of them to the path's end; {} requests, {} of them broken off; views were \
             set {} late at most, but for 1 %{}.",
            thousands(run.visits.begun),
            run.seconds,
            thousands(run.visits.complete),
            thousands(run.requests.sent),
            thousands(run.requests.broken_off),
            time(run.late.p99_ms),
            if run.late.p99_ms > Some(LATE_MS) { ": the clients' machine was busy" } else { "" },
        ),
        body: html! { div.plots { @for plot in &plots { (plot.markup()) } } },
    }
}

fn errors(report: &LoadReport) -> Section {
    let mut table =
        Table::new(&[("run", Align::Word), ("kind", Align::Word), ("count", Align::Number)]);
    for run in &report.runs {
        for (kind, count) in &run.errors_by_kind {
            let count = Cell::Toned(thousands(*count), Tone::Bad);
            table.rows.push(vec![name(run).into(), kind.as_str().into(), count]);
        }
    }
    let problems: Vec<_> = report.runs.iter().flat_map(|run| &run.problems).collect();
    Section {
        anchor: "errors".into(),
        title: "What went wrong".into(),
        lead: "Requests that failed, each try by itself, by kind; and the first few in words."
            .into(),
        body: html! {
            (table.markup())
            @if !problems.is_empty() { ul.remarks { @for problem in problems { li { (problem) } } } }
        },
    }
}

fn color(policy: Policy) -> usize {
    Policy::ALL.iter().position(|p| *p == policy).map_or(1, |index| index + 1)
}

fn thousands(number: u64) -> String {
    indicatif::HumanCount(number).to_string()
}

/// Three digits of it.
fn short(value: f64) -> String {
    let digits = if value < 10.0 { 2 } else { usize::from(value < 100.0) };
    format!("{value:.digits$}")
}
