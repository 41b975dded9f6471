//! What a scene and a view do without, and what that saves: measured by doing it after all.
//!
//! Every saving is switched off in turn while the others stay on. Times to load are simulated on the
//! link, times to decode and to draw are the machine's.

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use lodestream_protocol::Storage;
use serde::{Deserialize, Serialize};

use super::{
    stream::Stop,
    subject::{Subject, advance},
};
use crate::{
    engine::{EngineConfig, LeftOut, Policy, View},
    render::{CpuRenderer, RenderSettings, Scene, SplatSize},
    source::LinkSpec,
};

/// What a view cost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Bytes received.
    pub bytes: u64,
    /// Simulated milliseconds until all was there.
    pub load_ms: f64,
    /// Milliseconds of decoding, all of it.
    pub decode_ms: f64,
    /// Points drawn.
    pub points: u64,
    /// Least milliseconds of a frame.
    pub draw_ms: f64,
}

/// A saving, and what it is worth.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SavingRow {
    /// The view.
    pub view: String,
    /// What was left out.
    pub saving: String,
    /// Nodes that the reason kept from being loaded, without those below them.
    pub nodes: Option<u64>,
    /// Their points.
    pub points: Option<u64>,
    /// With all savings.
    pub with: Cost,
    /// Without this one.
    pub without: Cost,
}

/// What a dataset does not hold because it has no need to.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct NotStored {
    /// Attributes that every point has with the same value: in the manifest, once.
    pub constant_attributes: Vec<String>,
    /// Bytes that these would take, a value for every point, uncompressed.
    pub raw_bytes: u64,
    /// Attributes that views by colour do not need, and their bytes in the file.
    pub not_fetched: Vec<(String, u64)>,
    /// Bytes of WGSL that draw this dataset, and that would draw one with everything.
    pub shader_bytes: [u64; 2],
}

type Change = (&'static str, fn(&mut EngineConfig, &Subject), fn(&LeftOut) -> Option<[u64; 2]>);

/// Sizes with which occlusion is measured.
const BEHIND_SIZE: SplatSize = SplatSize::Level(1.6);

/// Between two pictures, as a window draws them.
const FRAME: Duration = Duration::from_millis(50);

/// Savings that can be switched off.
const SAVINGS: [Change; 5] = [
    (
        "outside the picture",
        |config, _| config.culls_outside = false,
        |left_out| Some([left_out.outside.nodes, left_out.outside.points]),
    ),
    (
        "finer than the pixels",
        |config, _| config.min_size_px = 0.0,
        |left_out| Some([left_out.small.nodes, left_out.small.points]),
    ),
    ("last bits of positions and colors", |config, _| config.cell_px = 0.0, |_| None),
    (
        "over the point budget",
        |config, _| config.point_budget = u64::MAX,
        |left_out| Some([left_out.over_budget.nodes, left_out.over_budget.points]),
    ),
    (
        "attributes that the view does not show",
        |config, subject| {
            let all = subject.manifest().attributes.iter();
            config.attributes = all.map(|attribute| attribute.name.clone()).collect();
        },
        |_| None,
    ),
];

/// Switches every saving off in turn, for every stop.
///
/// # Errors
/// Where the file cannot be read, a picture cannot be drawn, or `cancel` is set.
pub fn savings(
    subject: &Subject,
    settings: &RenderSettings,
    config: &EngineConfig,
    stops: &[Stop],
    link: LinkSpec,
    seed: u64,
    cancel: &AtomicBool,
) -> anyhow::Result<Vec<SavingRow>> {
    let mut rows = Vec::new();
    for stop in stops {
        let settings = RenderSettings { camera: stop.camera, ..*settings };
        rows.push(behind(subject, &settings, config, stop, link, seed, cancel)?);
        let (with, left_out) = cost(subject, &settings, config.clone(), link, seed, cancel)?;
        for (saving, switch_off, told) in SAVINGS {
            let mut changed = config.clone();
            switch_off(&mut changed, subject);
            let (without, _) = cost(subject, &settings, changed, link, seed, cancel)?;
            let told = told(&left_out);
            rows.push(SavingRow {
                view: stop.name.clone(),
                saving: saving.into(),
                nodes: told.map(|[nodes, _]| nodes),
                points: told.map(|[_, points]| points),
                with,
                without,
            });
        }
    }
    Ok(rows)
}

/// What lies behind what is drawn. With splats as large as their level's points are apart: those that
/// follow the finest detail leave holes, and behind a hole everything has to be drawn.
fn behind(
    subject: &Subject,
    settings: &RenderSettings,
    config: &EngineConfig,
    stop: &Stop,
    link: LinkSpec,
    seed: u64,
    cancel: &AtomicBool,
) -> anyhow::Result<SavingRow> {
    let settings = RenderSettings { splat_size: BEHIND_SIZE, ..*settings };
    let cost = |occlusion| {
        // Without a bound, or what is left out here makes room there.
        let config = EngineConfig { occlusion, point_budget: u64::MAX, ..config.clone() };
        cost(subject, &settings, config, link, seed, cancel)
    };
    let ((with, left_out), (without, _)) = (cost(true)?, cost(false)?);
    Ok(SavingRow {
        view: stop.name.clone(),
        saving: format!("behind what is drawn ({BEHIND_SIZE} splats, no budget)"),
        nodes: Some(left_out.hidden.nodes),
        points: Some(left_out.hidden.points),
        with,
        without,
    })
}

fn cost(
    subject: &Subject,
    settings: &RenderSettings,
    config: EngineConfig,
    link: LinkSpec,
    seed: u64,
    cancel: &AtomicBool,
) -> anyhow::Result<(Cost, LeftOut)> {
    let reach = settings.splat_reach().filter(|_| config.occlusion);
    // The plan whose depths were told last.
    let mut told = None;
    let mut engine = subject.engine(config, Policy::Ours, link, seed)?.engine;
    engine.set_view(View { camera: settings.camera, size_px: settings.size_px });
    let plan = loop {
        let plan = advance(&mut engine, FRAME, cancel)?;
        if plan.settled && (reach.is_none() || told == Some(plan.sequence)) {
            break plan;
        }
        if let Some(reach) = reach
            && told != Some(plan.sequence)
        {
            let scene = Scene { clouds: &subject.clouds, nodes: &plan.nodes };
            let picture = CpuRenderer.render(&scene, settings)?.picture;
            if let Some(depth) = picture.depth_pyramid() {
                engine.set_depth(&plan, depth, reach);
            }
            told = Some(plan.sequence);
        }
    };
    let scene = Scene { clouds: &subject.clouds, nodes: &plan.nodes };
    let mut draw_ms = f64::INFINITY;
    for _ in 0..3 {
        let start = Instant::now();
        CpuRenderer.render(&scene, settings)?;
        draw_ms = draw_ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    let phase = engine.stats().since_view;
    let cost = Cost {
        bytes: phase.totals.bytes,
        load_ms: phase.settled_ms.unwrap_or(f64::NAN),
        decode_ms: phase.totals.decode_ms,
        points: plan.points,
        draw_ms,
    };
    Ok((cost, plan.left_out))
}

/// What the dataset does without.
#[must_use]
pub fn not_stored(subject: &Subject, settings: &RenderSettings) -> NotStored {
    let manifest = subject.manifest();
    let constant =
        manifest.attributes.iter().filter(|a| matches!(a.storage, Storage::Constant { .. }));
    let constant: Vec<_> = constant.collect();
    let per_point: usize = constant.iter().map(|a| a.value_bytes()).sum();
    let shown = settings.groups(manifest);
    // The first has the positions, which are always fetched.
    let groups = manifest.groups.iter().enumerate().skip(1);
    let unused = groups.filter(|(index, _)| !shown.contains(index));
    NotStored {
        constant_attributes: constant.iter().map(|a| a.name.clone()).collect(),
        raw_bytes: manifest.points * per_point as u64,
        not_fetched: unused.map(|(_, g)| (g.name.clone(), g.columns.iter().sum())).collect(),
        shader_bytes: crate::render::shader_bytes(settings, manifest),
    }
}
