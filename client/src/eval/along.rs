//! Error along a camera path: what a visitor sees who does not wait.
//!
//! The camera moves in simulated time, a new view every step; at instants evenly spread over the path
//! what is there is compared with the truth from the same place.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::stream::Streaming;
use crate::{
    camera::Camera,
    engine::{Policy, View},
    interrupt::go_on,
    metrics::{PictureError, Popping},
    path::CameraPath,
    render::Picture,
    source::LinkSpec,
};

/// An instant of a path at which pictures are compared.
#[derive(Debug, Clone)]
pub struct Instant {
    /// Seconds since the path's start.
    pub seconds: f64,
    /// From where.
    pub camera: Camera,
    /// All points.
    pub truth: Picture,
}

/// What was there at an instant.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PathSample {
    /// Seconds since the path's start.
    pub seconds: f64,
    /// Similarity to the truth.
    pub ssim: f64,
    /// Points drawn.
    pub points: u64,
    /// Bytes received so far.
    pub bytes: u64,
}

/// How a path looked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PathRun {
    /// The path, as it was named.
    pub path: String,
    /// The link, as it is written.
    pub link: String,
    /// The policy.
    pub policy: Policy,
    /// Mean similarity.
    pub mean_ssim: f64,
    /// Least similarity.
    pub worst_ssim: f64,
    /// Mean over consecutive instants of the change beyond the truth's own, root mean square of 0 to
    /// 255. `None` of fewer than two instants.
    pub popping_rms: Option<f64>,
    /// Bytes received.
    pub bytes: u64,
    /// Requests sent.
    pub requests: u64,
    /// Requests broken off because the view had moved on.
    pub cancelled: u64,
    /// Instant by instant.
    pub samples: Vec<PathSample>,
}

/// The instants of a path at which pictures are compared, without their truths.
#[must_use]
pub fn instants(path: &CameraPath, count: u32) -> Vec<(f64, Camera)> {
    let (start, duration) = (path.start(), path.duration());
    // Not at the very start, when nothing can be there; at the end.
    let times = (1..=count).map(|i| duration * f64::from(i) / f64::from(count.max(1)));
    times.map(|seconds| (seconds, path.at(start + seconds))).collect()
}

impl Streaming<'_> {
    /// Follows a path from a cold start.
    ///
    /// # Errors
    /// Where the file cannot be read, a picture cannot be drawn, or `cancel` is set.
    pub fn follow(
        &self,
        name: &str,
        path: &CameraPath,
        instants: &[Instant],
        link: LinkSpec,
        policy: Policy,
    ) -> anyhow::Result<PathRun> {
        let mut visitor = self.subject.engine(self.config.clone(), policy, link, self.seed)?;
        let size_px = self.settings.size_px;
        let mut samples = Vec::new();
        let mut pictures: Vec<Picture> = Vec::new();
        for instant in instants {
            loop {
                go_on(self.cancel)?;
                // In whole nanoseconds: of a fraction of one, there is no end.
                let left = Duration::try_from_secs_f64(instant.seconds)
                    .unwrap_or_default()
                    .saturating_sub(visitor.engine.time());
                if left.is_zero() {
                    break;
                }
                let camera = path.at(path.start() + visitor.engine.time().as_secs_f64());
                visitor.engine.set_view(View { camera, size_px });
                visitor.engine.advance(self.step.min(left));
            }
            visitor.engine.set_view(View { camera: instant.camera, size_px });
            let plan = visitor.engine.advance(Duration::ZERO);
            let settings =
                crate::render::RenderSettings { camera: instant.camera, ..self.settings };
            let picture = self.picture(&plan, &settings)?;
            let error = PictureError::between(&picture, &instant.truth)?;
            samples.push(PathSample {
                seconds: instant.seconds,
                ssim: error.ssim.unwrap_or(f64::NAN),
                points: plan.points,
                bytes: visitor.bytes(),
            });
            pictures.push(picture);
        }
        let mut popping = Vec::new();
        for (pictures, truths) in pictures.windows(2).zip(instants.windows(2)) {
            let pictures = [&pictures[0], &pictures[1]];
            let truths = [&truths[0].truth, &truths[1].truth];
            popping.extend(Popping::between(pictures, truths)?.map(|popping| popping.rms));
        }
        let totals = visitor.engine.stats().since_start.totals;
        let count = samples.len().max(1) as f64;
        Ok(PathRun {
            path: name.into(),
            link: link.to_string(),
            policy,
            mean_ssim: samples.iter().map(|s| s.ssim).sum::<f64>() / count,
            worst_ssim: samples.iter().map(|s| s.ssim).fold(f64::INFINITY, f64::min),
            popping_rms: (!popping.is_empty())
                .then(|| popping.iter().sum::<f64>() / popping.len() as f64),
            bytes: visitor.bytes(),
            requests: totals.requests,
            cancelled: totals.cancelled,
            samples,
        })
    }
}
