//! Milliseconds per frame and error, per budget, splat and view.

use std::{
    collections::HashMap,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use serde::{Deserialize, Serialize};

use super::{
    curve::pareto,
    stream::Stop,
    subject::{Subject, advance},
};
use crate::{
    engine::{EngineConfig, FramePlan, Policy, View},
    metrics::PictureError,
    render::{CpuRenderer, Picture, RenderSettings, Scene, Splat, SplatSize},
    source::LinkSpec,
};

/// A way to draw a view.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrameRow {
    /// The view.
    pub view: String,
    /// The splat.
    pub splat: String,
    /// Its size, as it is written.
    pub size: String,
    /// Most points.
    pub budget: u64,
    /// Points drawn.
    pub points: u64,
    /// Nodes drawn.
    pub nodes: u64,
    /// Least milliseconds of a frame.
    pub ms: f64,
    /// Most milliseconds over the least: how far times are to be trusted.
    pub ms_spread: f64,
    /// Against the truth of the view.
    pub error: PictureError,
    /// Whether no other way is faster and better for this view.
    pub on_front: bool,
}

/// A link on which nothing is waited for.
const AT_ONCE: LinkSpec =
    LinkSpec { bits_per_second: f64::INFINITY, round_trip: Duration::ZERO, loss: 0.0 };

/// What a view shows once all of it is loaded.
fn settled(
    subject: &Subject,
    config: EngineConfig,
    view: View,
    cancel: &AtomicBool,
) -> anyhow::Result<Arc<FramePlan>> {
    let mut engine = subject.engine(config, Policy::Ours, AT_ONCE, 0)?.engine;
    engine.set_view(view);
    loop {
        let plan = advance(&mut engine, Duration::from_millis(100), cancel)?;
        if plan.settled {
            return Ok(plan);
        }
    }
}

/// Draws every stop within every budget in every way, `runs` times.
///
/// # Errors
/// Where the file cannot be read, a picture cannot be drawn, or `cancel` is set.
#[expect(clippy::too_many_arguments, reason = "each is one thing of the table")]
pub fn frames(
    subject: &Subject,
    settings: &RenderSettings,
    stops: &[Stop],
    truths: &HashMap<String, Picture>,
    budgets: &[u64],
    splats: &[(Splat, SplatSize)],
    runs: u32,
    cancel: &AtomicBool,
    mut best: impl FnMut(&FrameRow, &Picture, &Picture),
) -> anyhow::Result<Vec<FrameRow>> {
    let mut rows = Vec::new();
    for stop in stops {
        let Some(truth) = truths.get(&stop.name) else { continue };
        let first = rows.len();
        for &budget in budgets {
            let attributes = settings.attribute_names(subject.manifest());
            let config =
                EngineConfig { point_budget: budget, attributes, ..EngineConfig::default() };
            let view = View { camera: stop.camera, size_px: settings.size_px };
            let plan = settled(subject, config, view, cancel)?;
            let scene = Scene { clouds: &subject.clouds, nodes: &plan.nodes };
            for &(splat, splat_size) in splats {
                let settings =
                    RenderSettings { splat, splat_size, camera: stop.camera, ..*settings };
                let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
                let mut picture = None;
                for _ in 0..runs.max(1) {
                    let start = Instant::now();
                    picture = Some(CpuRenderer.render(&scene, &settings)?.picture);
                    let ms = start.elapsed().as_secs_f64() * 1e3;
                    (least, most) = (least.min(ms), most.max(ms));
                }
                let Some(picture) = picture else { continue };
                let row = FrameRow {
                    view: stop.name.clone(),
                    splat: splat.name().into(),
                    size: splat_size.to_string(),
                    budget,
                    points: plan.points,
                    nodes: plan.nodes.len() as u64,
                    ms: least,
                    ms_spread: most / least,
                    error: PictureError::between(&picture, truth)?,
                    on_front: false,
                };
                best(&row, &picture, truth);
                rows.push(row);
            }
        }
        let of_view = &mut rows[first..];
        let costs: Vec<_> =
            of_view.iter().map(|row| (row.ms, row.error.ssim.unwrap_or(f64::NAN))).collect();
        for (row, front) in of_view.iter_mut().zip(pareto(&costs)) {
            row.on_front = front;
        }
    }
    Ok(rows)
}
