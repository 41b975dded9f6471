//! Error over time while a view streams in: from a cold start and after jumps, per link and policy.
//!
//! The engine is the product's own in simulated time on a made-up link: the errors of a run are the
//! same to the last digit each time, and its times are those of the network alone.

use std::{
    collections::HashMap,
    sync::{Arc, atomic::AtomicBool},
    time::Duration,
};

use serde::{Deserialize, Serialize};

use super::{
    curve::{self, Reached, Sample},
    subject::{Subject, Visitor},
};
use crate::{
    camera::Camera,
    engine::{EngineConfig, FramePlan, Policy, View},
    interrupt::go_on,
    metrics::PictureError,
    render::{Picture, RenderSettings, TruthRenderer, VisibleTree},
    source::LinkSpec,
};

/// Levels of similarity whose times are told.
pub const LEVELS: [f64; 3] = [0.9, 0.95, 0.98];

/// Of the simulated clock.
const TIMER_STEP: Duration = Duration::from_millis(1);

/// A view that is looked at until it is complete.
#[derive(Debug, Clone)]
pub struct Stop {
    /// As reports name it.
    pub name: String,
    /// From where.
    pub camera: Camera,
}

/// How a view came in.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StreamRun {
    /// The view.
    pub view: String,
    /// What was there before: `cold`, or the view that was jumped from.
    pub from: String,
    /// The link, as it is written.
    pub link: String,
    /// The policy.
    pub policy: Policy,
    /// Simulated milliseconds until nothing more was to come; `None` where that did not happen in
    /// time.
    pub settled_ms: Option<f64>,
    /// Bytes received, those that came in vain after the picture was complete too.
    pub bytes: u64,
    /// Requests sent.
    pub requests: u64,
    /// Points of the complete picture.
    pub points: u64,
    /// Similarity of the complete picture.
    pub ssim: f64,
    /// When each of [`LEVELS`] was reached, for good.
    pub reached: Vec<Option<Reached>>,
    /// Least milliseconds for the bytes that had come when the picture was complete: their transmission and two
    /// round trips; one after a jump, when the connection stands; 0 where nothing had to come.
    pub bound_ms: f64,
    /// At the steps at which the picture changed.
    pub samples: Vec<Sample>,
}

/// How views are streamed in.
pub struct Streaming<'a> {
    /// The dataset.
    pub subject: &'a Subject,
    /// Of the pictures; cameras are put in.
    pub settings: RenderSettings,
    /// For [`Policy::Ours`]; what the others need is changed.
    pub config: EngineConfig,
    /// Between two looks.
    pub step: Duration,
    /// Simulated time after which a run is given up.
    pub patience: Duration,
    /// Of the link's losses, and of where the samples of pixels lie.
    pub seed: u64,
    /// Along each side of a pixel, as of the truths.
    pub samples: u32,
    /// Asked for between two steps.
    pub cancel: &'a AtomicBool,
}

/// Whether two plans draw the same nodes with the same columns, in the same order.
fn draws_the_same(a: &FramePlan, b: &FramePlan) -> bool {
    a.nodes.len() == b.nodes.len()
        && a.nodes
            .iter()
            .zip(&b.nodes)
            .all(|(a, b)| (a.cloud, a.key) == (b.cloud, b.key) && Arc::ptr_eq(&a.points, &b.points))
}

impl Streaming<'_> {
    /// Streams the stops in, one after the other, from a cold start.
    ///
    /// # Errors
    /// Where the file cannot be read, a picture cannot be drawn, or `cancel` is set.
    pub fn run(
        &self,
        stops: &[Stop],
        truths: &HashMap<String, Picture>,
        link: LinkSpec,
        policy: Policy,
    ) -> anyhow::Result<Vec<StreamRun>> {
        let mut visitor = self.subject.engine(self.config.clone(), policy, link, self.seed)?;
        let mut from = "cold".to_owned();
        let mut runs = Vec::new();
        for stop in stops {
            let truth = truths
                .get(&stop.name)
                .ok_or_else(|| anyhow::anyhow!("no truth was drawn of the view {}", stop.name))?;
            let mut run = self.stop(&mut visitor, stop, truth, link, runs.is_empty())?;
            run.link = link.to_string();
            run.policy = policy;
            run.from = std::mem::replace(&mut from, stop.name.clone());
            runs.push(run);
        }
        Ok(runs)
    }

    fn stop(
        &self,
        visitor: &mut Visitor,
        stop: &Stop,
        truth: &Picture,
        link: LinkSpec,
        is_cold: bool,
    ) -> anyhow::Result<StreamRun> {
        let settings = RenderSettings { camera: stop.camera, ..self.settings };
        visitor.engine.set_view(View { camera: stop.camera, size_px: settings.size_px });
        let (start, bytes_before) = (visitor.engine.time(), visitor.bytes());
        let mut samples: Vec<Sample> = Vec::new();
        let mut seen: Option<Arc<FramePlan>> = None;
        let mut plan: Arc<FramePlan>;
        // At time 0 too: what is there from before counts.
        let mut step = Duration::ZERO;
        loop {
            go_on(self.cancel)?;
            // To the timer's step, so that what comes after the end is told apart.
            let engine = &mut visitor.engine;
            let due = engine.time() + step;
            plan = engine.advance(Duration::ZERO);
            while engine.time() < due && !plan.settled {
                plan = engine.advance(TIMER_STEP.min(due - engine.time()));
            }
            step = self.step;
            if let Some(problem) = engine.stats().problems.first() {
                anyhow::bail!("{problem}");
            }
            let (now, requests) = (engine.time(), engine.stats().since_view.totals.requests);
            if seen.is_none_or(|seen| !draws_the_same(&seen, &plan)) {
                let error = self.error(&plan, &settings, truth)?;
                samples.push(Sample {
                    ms: (now - start).as_secs_f64() * 1e3,
                    bytes: visitor.bytes() - bytes_before,
                    requests,
                    points: plan.points,
                    ssim: error.ssim.unwrap_or(f64::NAN),
                    mse: error.mse.unwrap_or(f64::NAN),
                    holes: error.coverage.holes.of_covered.unwrap_or(0.0),
                });
            }
            seen = Some(Arc::clone(&plan));
            if plan.settled || now - start >= self.patience {
                break;
            }
        }
        let needed_bytes = visitor.bytes() - bytes_before;
        // What was asked for in vain comes too, before the next view.
        let rest = TIMER_STEP.max(2 * link.round_trip) + Duration::from_secs(1);
        let mut bytes = None;
        while bytes.replace(visitor.bytes()) != Some(visitor.bytes()) {
            visitor.engine.advance(rest);
        }
        let phase = visitor.engine.stats().since_view;
        let bound = match needed_bytes {
            _ if is_cold => link.bound(needed_bytes),
            0 => Duration::ZERO,
            // The connection stands.
            _ => link.bound(needed_bytes).saturating_sub(link.round_trip),
        };
        Ok(StreamRun {
            view: stop.name.clone(),
            from: String::new(),
            link: String::new(),
            policy: Policy::Ours,
            settled_ms: phase.settled_ms,
            bytes: visitor.bytes() - bytes_before,
            requests: phase.totals.requests,
            points: plan.points,
            ssim: samples.last().map_or(f64::NAN, |sample| sample.ssim),
            reached: LEVELS.map(|level| curve::reached(&samples, level)).into(),
            bound_ms: bound.as_secs_f64() * 1e3,
            samples,
        })
    }

    fn error(
        &self,
        plan: &FramePlan,
        settings: &RenderSettings,
        truth: &Picture,
    ) -> anyhow::Result<PictureError> {
        Ok(PictureError::between(&self.picture(plan, settings)?, truth)?)
    }

    /// What a plan draws, as finely as the truth: what is left is the error of what is drawn, not of
    /// the pixels.
    pub(super) fn picture(
        &self,
        plan: &FramePlan,
        settings: &RenderSettings,
    ) -> anyhow::Result<Picture> {
        let tree = VisibleTree::of(plan.nodes.iter().map(|n| (n.cloud, n.key, n.spacing)));
        let clouds = &self.subject.clouds;
        let renderer = TruthRenderer::new(settings, clouds, tree, self.samples)?;
        let mut renderer = renderer.jittered(self.seed);
        for pass in 0..renderer.passes() {
            if pass > 0 {
                renderer.next_pass()?;
            }
            for node in &plan.nodes {
                renderer.add_node(node.clone())?;
            }
        }
        Ok(renderer.finish()?.picture)
    }
}
