//! Two reports side by side: what has become worse, beyond noise.
//!
//! Errors, bytes and simulated times are the same to the last digit in every run, so that any loss
//! of theirs beyond a small allowance counts. Times of the machine count beyond the spread that both
//! reports tell of themselves, and only where both are of one machine.

use super::{
    curve::area,
    report::{Report, SubjectReport},
    stream::StreamRun,
};

/// Similarity that may be lost: what rounding on another processor may move.
const SSIM_ALLOWANCE: f64 = 1e-4;

/// Part by which bytes and simulated times may grow.
const GROWTH_ALLOWANCE: f64 = 0.01;

/// Part by which times of the machine may grow beyond their own spread.
const TIME_ALLOWANCE: f64 = 0.25;

/// A figure in both reports.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Which: dataset, view, way, figure.
    pub what: String,
    /// In the earlier report.
    pub before: f64,
    /// In the later one.
    pub after: f64,
    /// Whether it is worse beyond noise.
    pub is_regression: bool,
}

/// What differs; and what the earlier has and the later lacks, by name. Both have to be of pictures
/// of one size with the same samples.
#[must_use]
pub fn compare(before: &Report, after: &Report) -> (Vec<Difference>, Vec<String>) {
    let (mut differences, mut missing) = (Vec::new(), Vec::new());
    let is_one_machine = before.machine == after.machine;
    for old in &before.subjects {
        match after.subjects.iter().find(|new| new.name == old.name) {
            Some(new) => subject(old, new, is_one_machine, &mut differences, &mut missing),
            None => missing.push(old.name.clone()),
        }
    }
    (differences, missing)
}

fn subject(
    old: &SubjectReport,
    new: &SubjectReport,
    is_one_machine: bool,
    differences: &mut Vec<Difference>,
    missing: &mut Vec<String>,
) {
    let mut note = |what: String, before: f64, after: f64, is_worse: bool| {
        if before != after {
            differences.push(Difference { what, before, after, is_regression: is_worse });
        }
    };
    let grown = |before: f64, after: f64, allowance: f64| after > before * (1.0 + allowance);
    for a in &old.frames {
        let name = format!("{} {} {} {} {}", old.name, a.view, a.splat, a.size, a.budget);
        let same = |b: &&super::frame::FrameRow| {
            (&b.view, &b.splat, &b.size, b.budget) == (&a.view, &a.splat, &a.size, a.budget)
        };
        let Some(b) = new.frames.iter().find(same) else {
            missing.push(name);
            continue;
        };
        match (a.error.ssim, b.error.ssim) {
            (Some(x), Some(y)) => note(format!("{name} ssim"), x, y, y < x - SSIM_ALLOWANCE),
            (Some(_), None) => missing.push(format!("{name} ssim")),
            (None, _) => {}
        }
        let spread = a.ms_spread.max(b.ms_spread) - 1.0;
        let is_slower = is_one_machine && grown(a.ms, b.ms, spread + TIME_ALLOWANCE);
        note(format!("{name} ms"), a.ms, b.ms, is_slower);
    }
    let (races, others) = (old.races(), new.races());
    for race in &races {
        let twin = others.iter().find(|other| {
            (other.view, other.from, other.link) == (race.view, race.from, race.link)
        });
        for a in &race.runs {
            let policy = a.run.policy;
            let name = format!(
                "{} {} from {} by {} {}",
                old.name,
                race.view,
                race.from,
                race.link,
                policy.name()
            );
            let b = twin.and_then(|twin| twin.runs.iter().find(|b| b.run.policy == policy));
            let Some(b) = b else {
                missing.push(name);
                continue;
            };
            note(
                format!("{name} ssim"),
                a.run.ssim,
                b.run.ssim,
                b.run.ssim < a.run.ssim - SSIM_ALLOWANCE,
            );
            // To the same end: that of the race hangs on the slowest rival.
            let end = |run: &StreamRun| run.samples.last().map_or(0.0, |sample| sample.ms);
            let horizon = end(a.run).max(end(b.run));
            let [x, y] = [a.run, b.run].map(|run| area(&run.samples, horizon));
            note(format!("{name} area"), x, y, grown(x, y, GROWTH_ALLOWANCE));
            let bytes = [a.run.bytes as f64, b.run.bytes as f64];
            note(
                format!("{name} bytes"),
                bytes[0],
                bytes[1],
                grown(bytes[0], bytes[1], GROWTH_ALLOWANCE),
            );
            match (a.run.settled_ms, b.run.settled_ms) {
                (Some(x), Some(y)) => {
                    note(format!("{name} settled_ms"), x, y, grown(x, y, GROWTH_ALLOWANCE));
                }
                (Some(_), None) => missing.push(format!("{name} settled_ms")),
                (None, _) => {}
            }
        }
    }
}
