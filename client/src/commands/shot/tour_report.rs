//! What a tour drew, and what it took.

use std::{fmt::Write, path::PathBuf};

use serde::Serialize;

use crate::{
    engine::{EngineStats, FramePlan, LeftOut},
    path::CameraPath,
    render::FrameStatistics,
};

/// The `--report` of `shot --path`.
#[derive(Debug, Clone, Serialize)]
pub struct TourReport {
    /// As named on the command line.
    pub sources: Vec<String>,
    /// Where the pictures are.
    pub folder: PathBuf,
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// The path.
    pub path: PathReport,
    /// Seconds of real time from picture to picture; none where each was waited for.
    pub time_step_seconds: Option<f64>,
    /// What drew: `gpu: ADAPTER`, `cpu` or `truth`.
    pub renderer: String,
    /// Why the GPU did not draw (all of it), where it was asked to.
    pub fallback: Option<String>,
    /// By what each source is coloured.
    pub colors: Vec<&'static str>,
    /// Requests sent (reads, where the source is a file), those of opening included.
    pub requests: u64,
    /// Bytes received, those of opening included.
    pub bytes: u64,
    /// Milliseconds from the start of the command until the sources and the renderer were open.
    pub opened_ms: f64,
    /// Milliseconds from the start of the command until the last picture was written.
    pub total_ms: f64,
    /// Figures of the streaming engine; none for the truth, which does without.
    pub engine: Option<EngineStats>,
    /// What failed for good: the pictures lack it.
    pub problems: Vec<String>,
    /// The pictures, by time.
    pub frames: Vec<FrameReport>,
}

/// The path of a tour.
#[derive(Debug, Clone, Serialize)]
pub struct PathReport {
    /// Its name, if it has one.
    pub name: Option<String>,
    /// Time of its first key, in seconds.
    pub start: f64,
    /// Seconds from its first key to its last.
    pub duration: f64,
    /// Whether it begins anew where it ends.
    #[serde(rename = "loop")]
    pub is_loop: bool,
    /// How many keys it has.
    pub keys: usize,
}

/// One picture of a tour.
#[derive(Debug, Clone, Serialize)]
pub struct FrameReport {
    /// Name of the file in the folder.
    pub picture: String,
    /// On the path, in seconds.
    pub time: f64,
    /// The camera, as a camera file holds it.
    pub camera: serde_json::Value,
    /// Points drawn.
    pub points: u64,
    /// Nodes drawn.
    pub nodes: u64,
    /// What had come for it.
    #[serde(flatten)]
    pub arrival: Arrival,
    /// Milliseconds that drawing took (for the truth, reading included).
    pub draw_ms: f64,
    /// Share of pixels on which something was drawn.
    pub coverage: f64,
    /// What drawing it took.
    pub frame: FrameStatistics,
}

/// What had come for a picture when it was drawn.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Arrival {
    /// Requests sent since the picture before was drawn (for the first one: since all was open).
    pub requests: u64,
    /// Bytes received in that time.
    pub bytes: u64,
    /// Nodes that came into view in that time and were still in the cache.
    pub cache_hits: u64,
    /// Milliseconds after the camera had come to its place until there were points to draw; none
    /// where there were none yet, and for the truth.
    pub first_ms: Option<f64>,
    /// Likewise until all was there.
    pub settled_ms: Option<f64>,
    /// Whether the picture is complete.
    #[serde(rename = "settled")]
    pub is_settled: bool,
    /// Whether its nodes were chosen for this camera; if not, for an earlier one.
    #[serde(rename = "current")]
    pub is_current: bool,
    /// With a time step: by how much it was drawn later than it should have been.
    pub late_ms: Option<f64>,
    /// What the view did not need, the budget did not allow, or had not come yet; nothing for the
    /// truth.
    pub left_out: LeftOut,
}

impl Arrival {
    /// What came between two looks at the engine, of which `plan` is now drawn for `view`.
    pub(super) fn between(
        before: &EngineStats,
        now: &EngineStats,
        plan: &FramePlan,
        view: u64,
    ) -> Self {
        let (start, end) = (before.since_start.totals, now.since_start.totals);
        let is_current = plan.view_generation >= view;
        Self {
            requests: end.requests - start.requests,
            bytes: end.bytes - start.bytes,
            cache_hits: end.cache_hits - start.cache_hits,
            first_ms: now.since_view.first_points_ms,
            settled_ms: now.since_view.settled_ms,
            is_settled: plan.settled && is_current,
            is_current,
            late_ms: None,
            left_out: plan.left_out,
        }
    }
}

impl PathReport {
    pub(super) fn of(path: &CameraPath) -> Self {
        Self {
            name: path.name().map(str::to_owned),
            start: path.start(),
            duration: path.duration(),
            is_loop: path.is_loop(),
            keys: path.keys().len(),
        }
    }
}

impl TourReport {
    /// One line for a user.
    pub(super) fn summary(&self) -> String {
        let [width, height] = self.size_px;
        let count = self.frames.len();
        let pictures = if count == 1 { "picture" } else { "pictures" };
        let mut line = format!(
            "{}: {count} {pictures} of {width}x{height} along {}, {} requests, {:.2} MB",
            self.folder.display(),
            self.path.name.as_deref().unwrap_or("the path"),
            self.requests,
            self.bytes as f64 / 1e6,
        );
        let settled: Vec<f64> = self.frames.iter().filter_map(|f| f.arrival.settled_ms).collect();
        let complete = self.frames.iter().filter(|frame| frame.arrival.is_settled).count();
        // Writes to a string do not fail.
        if complete < count {
            let _ = write!(line, ", {complete} complete");
        }
        if let Some((median, most)) = middle_and_most(settled) {
            let _ = write!(line, ", complete after {median:.0} ms (at most {most:.0} ms)");
        }
        let drawn = self.frames.iter().map(|frame| frame.draw_ms).collect();
        if let Some((median, most)) = middle_and_most(drawn) {
            let _ = write!(line, ", drawn in {median:.0} ms (at most {most:.0} ms)");
        }
        line + &format!(" ({})\n", self.renderer)
    }
}

/// The median, and the largest.
fn middle_and_most(mut numbers: Vec<f64>) -> Option<(f64, f64)> {
    numbers.sort_by(f64::total_cmp);
    Some((*numbers.get(numbers.len() / 2)?, *numbers.last()?))
}
