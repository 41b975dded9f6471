//! Two reports side by side: what has become worse, beyond noise.
//!
//! Errors, bytes and simulated times are the same to the last digit in every run, so that any loss
//! of theirs beyond a small allowance counts. Times of the machine count beyond the spread that both
//! reports tell of themselves, and only where both are of one machine.

use super::{
    along::PathRun,
    curve::area,
    frame::FrameRow,
    left_out::SavingRow,
    report::{BuildRow, Report, SubjectReport},
    stream::StreamRun,
};

/// Similarity that may be lost: what rounding on another processor may move.
const SSIM_ALLOWANCE: f64 = 1e-4;

/// Part by which bytes and simulated times may grow.
const GROWTH_ALLOWANCE: f64 = 0.01;

/// Part by which times of the machine may grow beyond their own spread.
const TIME_ALLOWANCE: f64 = 0.25;

/// The same of builds, which are run once, and whose memory hangs on how threads fall.
const BUILD_ALLOWANCE: f64 = 0.5;

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
    let is_one_machine = before.machine == after.machine;
    let mut notes = Notes { differences: Vec::new(), missing: Vec::new(), is_one_machine };
    for old in &before.subjects {
        let Some(new) = after.subjects.iter().find(|new| new.name == old.name) else {
            notes.gone(old.name.clone());
            continue;
        };
        builds(old, new, &mut notes);
        frames(old, new, &mut notes);
        streams(old, new, &mut notes);
        paths(old, new, &mut notes);
        savings(old, new, &mut notes);
    }
    (notes.differences, notes.missing)
}

/// What is found.
struct Notes {
    differences: Vec<Difference>,
    missing: Vec<String>,
    is_one_machine: bool,
}

impl Notes {
    fn note(&mut self, what: String, before: f64, after: f64, is_regression: bool) {
        if before != after {
            self.differences.push(Difference { what, before, after, is_regression });
        }
    }

    /// What is the same in every run and should be small: bytes, points, simulated times.
    fn small(&mut self, what: String, before: f64, after: f64) {
        self.note(what, before, after, grown(before, after, GROWTH_ALLOWANCE));
    }

    /// Similarities.
    fn similar(&mut self, what: String, before: f64, after: f64) {
        self.note(what, before, after, after < before - SSIM_ALLOWANCE);
    }

    /// What hangs on the machine: it counts beyond `allowance`, and where both reports are of one machine.
    fn machine(&mut self, what: String, before: f64, after: f64, allowance: f64) {
        let is_worse = self.is_one_machine && grown(before, after, allowance);
        self.note(what, before, after, is_worse);
    }

    fn gone(&mut self, what: String) {
        self.missing.push(what);
    }
}

fn grown(before: f64, after: f64, allowance: f64) -> bool {
    after > before * (1.0 + allowance)
}

fn builds(old: &SubjectReport, new: &SubjectReport, notes: &mut Notes) {
    let name = format!("{} build", old.name);
    notes.small(format!("{} file bytes", old.name), old.bytes as f64, new.bytes as f64);
    let (a, b) = match (&old.build, &new.build) {
        (Some(a), Some(b)) if a.method == b.method => (a, b),
        (Some(a), _) => return notes.gone(format!("{name} by {}", a.method)),
        (None, _) => return,
    };
    // Points that are lost are worse, be it one.
    let lost = |row: &BuildRow| row.points_in.saturating_sub(row.points_out) as f64;
    notes.note(format!("{name} points lost"), lost(a), lost(b), lost(b) > lost(a));
    notes.machine(format!("{name} seconds"), a.seconds, b.seconds, BUILD_ALLOWANCE);
    if let (Some(x), Some(y)) = (a.peak_bytes, b.peak_bytes) {
        notes.machine(format!("{name} peak_bytes"), x as f64, y as f64, BUILD_ALLOWANCE);
    }
}

fn frames(old: &SubjectReport, new: &SubjectReport, notes: &mut Notes) {
    for a in &old.frames {
        let name = format!("{} {} {} {} {}", old.name, a.view, a.splat, a.size, a.budget);
        let same = |b: &&FrameRow| {
            (&b.view, &b.splat, &b.size, b.budget) == (&a.view, &a.splat, &a.size, a.budget)
        };
        let Some(b) = new.frames.iter().find(same) else {
            notes.gone(name);
            continue;
        };
        match (a.error.ssim, b.error.ssim) {
            (Some(x), Some(y)) => notes.similar(format!("{name} ssim"), x, y),
            (Some(_), None) => notes.gone(format!("{name} ssim")),
            (None, _) => {}
        }
        let spread = a.ms_spread.max(b.ms_spread) - 1.0;
        notes.machine(format!("{name} ms"), a.ms, b.ms, spread + TIME_ALLOWANCE);
    }
}

fn streams(old: &SubjectReport, new: &SubjectReport, notes: &mut Notes) {
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
                notes.gone(name);
                continue;
            };
            notes.similar(format!("{name} ssim"), a.run.ssim, b.run.ssim);
            // To the same end: that of the race hangs on the slowest rival.
            let end = |run: &StreamRun| run.samples.last().map_or(0.0, |sample| sample.ms);
            let horizon = end(a.run).max(end(b.run));
            let [x, y] = [a.run, b.run].map(|run| area(&run.samples, horizon));
            notes.small(format!("{name} area"), x, y);
            notes.small(format!("{name} bytes"), a.run.bytes as f64, b.run.bytes as f64);
            match (a.run.settled_ms, b.run.settled_ms) {
                (Some(x), Some(y)) => notes.small(format!("{name} settled_ms"), x, y),
                (Some(_), None) => notes.gone(format!("{name} settled_ms")),
                (None, _) => {}
            }
        }
    }
}

fn paths(old: &SubjectReport, new: &SubjectReport, notes: &mut Notes) {
    for a in &old.paths {
        let name = format!("{} {} by {} {}", old.name, a.path, a.link, a.policy.name());
        let same = |b: &&PathRun| (&b.path, &b.link, b.policy) == (&a.path, &a.link, a.policy);
        let Some(b) = new.paths.iter().find(same) else {
            notes.gone(name);
            continue;
        };
        notes.similar(format!("{name} mean_ssim"), a.mean_ssim, b.mean_ssim);
        notes.similar(format!("{name} worst_ssim"), a.worst_ssim, b.worst_ssim);
        if let (Some(x), Some(y)) = (a.popping_rms, b.popping_rms) {
            notes.small(format!("{name} popping_rms"), x, y);
        }
        notes.small(format!("{name} bytes"), a.bytes as f64, b.bytes as f64);
    }
}

/// A saving is worse where the view costs more with it; what it would cost without is beside the point.
fn savings(old: &SubjectReport, new: &SubjectReport, notes: &mut Notes) {
    for a in &old.left_out {
        let name = format!("{} {} without {}", old.name, a.view, a.saving);
        let same = |b: &&SavingRow| (&b.view, &b.saving) == (&a.view, &a.saving);
        let Some(b) = new.left_out.iter().find(same) else {
            notes.gone(name);
            continue;
        };
        notes.small(format!("{name} bytes"), a.with.bytes as f64, b.with.bytes as f64);
        notes.small(format!("{name} load_ms"), a.with.load_ms, b.with.load_ms);
        notes.small(format!("{name} points"), a.with.points as f64, b.with.points as f64);
    }
    for attribute in &old.not_stored.constant_attributes {
        if !new.not_stored.constant_attributes.contains(attribute) {
            notes.gone(format!("{} without a column of {attribute}", old.name));
        }
    }
    let [x, y] = [old, new].map(|subject| subject.not_stored.shader_bytes[0] as f64);
    notes.small(format!("{} shader bytes", old.name), x, y);
}
