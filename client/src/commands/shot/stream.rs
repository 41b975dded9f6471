//! A shot by the streaming engine: what a viewer would show once it has settled.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use lodestream_protocol::Manifest;

use super::{RendererName, Shot, ShotArgs, ShotReport};
use crate::{
    camera::Camera,
    engine::{Engine, EngineConfig, EngineError, FramePlan, View},
    render::{CpuRenderer, Frame, RenderError, RenderSettings, Renderer, Scene},
    source::Source,
};

/// Nodes that stay on the GPU from the first picture to the last.
const RESIDENT_BYTES: u64 = 1 << 30;

/// How often a failed source is looked for while waiting for the first plan.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// Streams what the view needs within the budget, and draws it.
///
/// # Errors
/// Where a source cannot be read in time or the view cannot be drawn.
pub(super) fn draw(args: &ShotArgs, camera: Option<Camera>) -> anyhow::Result<Shot> {
    let start = Instant::now();
    let left = || args.timeout.saturating_sub(start.elapsed());
    let sources = args.sources.iter().map(|text| Source::parse(text));
    let sources = sources.collect::<Result<Vec<_>, _>>()?;
    let config = EngineConfig {
        point_budget: args.budget,
        attributes: args.color.attribute().map(str::to_owned).into_iter().collect(),
        ..EngineConfig::default()
    };
    let engine = Engine::start(sources, config)?;

    // While the first bytes are on their way.
    let mut fallback = None;
    let mut told = |e: &RenderError| {
        eprintln!("note: {e}; drawing on the CPU");
        fallback = Some(e.to_string());
    };
    let mut renderer = match args.renderer {
        RendererName::Gpu => Renderer::open(RESIDENT_BYTES, &mut told),
        RendererName::Cpu | RendererName::Truth => Renderer::Cpu(CpuRenderer),
    };

    let boots = engine.wait_open(left())?;
    let clouds: Vec<_> = boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
    let settings = args.settings(camera, &clouds)?;
    let colorings = args.colorings(&clouds);
    let needed = clouds.iter().flat_map(|cloud| {
        let name = |a: usize| cloud.attributes[a].name.clone();
        settings.attributes(cloud).into_iter().map(name).collect::<Vec<_>>()
    });
    engine.set_attributes(needed.collect());
    engine.set_view(View { camera: settings.camera, size_px: settings.size_px });

    let mut drawn =
        |plan: &FramePlan| draw_plan(&mut renderer, plan, &clouds, &settings, &mut told);
    let mut plan = wait_first(&engine, left())?;
    let mut frame = drawn(&plan)?;
    let first_picture = start.elapsed();
    if !plan.settled {
        plan = engine.wait_settled(left())?;
        frame = drawn(&plan)?;
    }
    let settled_picture = start.elapsed();

    let stats = engine.stats();
    let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
    let report = ShotReport {
        sources: args.sources.clone(),
        picture: args.output.clone(),
        size_px: args.size,
        camera: serde_json::from_str(&settings.camera.to_json())?,
        renderer: renderer.name(),
        fallback,
        colors: colorings.iter().map(|coloring| coloring.name()).collect(),
        points: frame.statistics.points,
        nodes: frame.statistics.nodes,
        requests: stats.since_start.totals.requests,
        bytes: stats.since_start.totals.bytes,
        first_picture_ms: milliseconds(first_picture),
        settled_picture_ms: milliseconds(settled_picture),
        coverage: frame.picture.coverage(),
        left_out: plan.left_out,
        problems: stats.problems.clone(),
        engine: Some(stats),
        frame: frame.statistics,
        ssim: None,
    };
    Ok(Shot { picture: frame.picture, report })
}

fn draw_plan(
    renderer: &mut Renderer,
    plan: &FramePlan,
    clouds: &[Arc<Manifest>],
    settings: &RenderSettings,
    told: &mut dyn FnMut(&RenderError),
) -> Result<Frame, RenderError> {
    renderer.render(&Scene { clouds, nodes: &plan.nodes }, settings, told)
}

/// The first plan that has points, or the complete one where it has none.
fn wait_first(engine: &Engine, timeout: Duration) -> Result<Arc<FramePlan>, EngineError> {
    let start = Instant::now();
    let mut sequence = 0;
    loop {
        let left = timeout.saturating_sub(start.elapsed());
        match engine.wait_plan(sequence, left.min(LOOK_INTERVAL)) {
            Some(plan) if plan.points > 0 => return Ok(plan),
            // Says why there is none, or waits for the end of a plan without points.
            Some(plan) if plan.settled => return engine.wait_settled(left),
            Some(plan) => sequence = plan.sequence,
            None if left.is_zero() || engine.clouds().iter().any(|c| c.failure.is_some()) => {
                return engine.wait_settled(Duration::ZERO);
            }
            None => {}
        }
    }
}
