//! What a shot drew, and what it took.

use std::{fmt::Write, path::PathBuf};

use serde::Serialize;

use crate::{
    engine::{EngineStats, LeftOut},
    render::{FrameStatistics, PointsPerPixel},
};

/// The `--report` of `shot`.
#[derive(Debug, Clone, Serialize)]
pub struct ShotReport {
    /// As named on the command line.
    pub sources: Vec<String>,
    /// The picture.
    pub picture: PathBuf,
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// The camera, as a camera file holds it.
    pub camera: serde_json::Value,
    /// What drew: `gpu: ADAPTER`, `cpu` or `truth`.
    pub renderer: String,
    /// Why the GPU did not draw, where it was asked to.
    pub fallback: Option<String>,
    /// By what each source is coloured.
    pub colors: Vec<&'static str>,
    /// Points drawn.
    pub points: u64,
    /// Nodes drawn.
    pub nodes: u64,
    /// Requests sent (reads, where the source is a file).
    pub requests: u64,
    /// Bytes received.
    pub bytes: u64,
    /// Milliseconds from the start of the command until the first picture with points was drawn.
    pub first_picture_ms: f64,
    /// Milliseconds from the start of the command until the complete picture was drawn.
    pub settled_picture_ms: f64,
    /// Share of pixels on which something was drawn.
    pub coverage: f64,
    /// What the view did not need or the budget did not allow; nothing for the truth.
    pub left_out: LeftOut,
    /// Figures of the streaming engine; none for the truth, which does without.
    pub engine: Option<EngineStats>,
    /// What drawing the complete picture took.
    pub frame: FrameStatistics,
    /// Structural similarity to the picture of `--against`.
    pub ssim: Option<f64>,
    /// How many points fall on the pixels, for `--color density`.
    pub points_per_pixel: Option<PointsPerPixel>,
    /// What failed for good: the picture lacks it.
    pub problems: Vec<String>,
}

impl ShotReport {
    /// One line for a user.
    pub(super) fn summary(&self) -> String {
        let [width, height] = self.size_px;
        let mut line = format!(
            "{}: {width}x{height}, {} points in {} nodes, {} requests, {:.2} MB, first picture after \
             {:.0} ms, complete after {:.0} ms ({})",
            self.picture.display(),
            self.points,
            self.nodes,
            self.requests,
            self.bytes as f64 / 1e6,
            self.first_picture_ms,
            self.settled_picture_ms,
            self.renderer,
        );
        if let Some(ssim) = self.ssim {
            // A write to a string does not fail.
            let _ = write!(line, ", SSIM {ssim:.4}");
        }
        if let Some(PointsPerPixel { most_frequent, mean, largest, .. }) = self.points_per_pixel {
            let _ = write!(
                line,
                ", points per pixel: most often {most_frequent}, {mean:.1} on average, at most {largest}"
            );
        }
        line + "\n"
    }
}
