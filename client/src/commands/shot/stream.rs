//! Drawing by the streaming engine: what a viewer would show.

use std::{
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use lodestream_protocol::Manifest;

use super::{RendererName, Shot, ShotArgs, ShotReport, patience};
use crate::{
    camera::Camera,
    engine::{Engine, EngineConfig, EngineError, FramePlan, View},
    render::{
        Coloring, CpuRenderer, Frame, GpuConfig, RenderError, RenderSettings, Renderer, Scene,
    },
    source::Source,
};

/// How often a failed source is looked for while waiting for the first plan.
const LOOK_INTERVAL: Duration = Duration::from_millis(50);

/// One engine and one renderer for all pictures: what is loaded and uploaded for one is there for
/// the next.
pub(super) struct Stream {
    pub engine: Engine,
    pub clouds: Vec<Arc<Manifest>>,
    /// How each cloud is coloured.
    pub colorings: Vec<Coloring>,
    /// What the GPU failed of, if it did.
    fallback: Option<String>,
    renderer: Renderer,
}

impl Stream {
    /// Opens the sources and the renderer.
    ///
    /// # Errors
    /// Where a source cannot be read in time; where `cancel` is set.
    pub fn open(args: &ShotArgs, cancel: &AtomicBool) -> anyhow::Result<Self> {
        let start = Instant::now();
        let sources = args.sources.iter().map(|text| Source::parse(text));
        let sources = sources.collect::<Result<Vec<_>, _>>()?;
        let config = EngineConfig {
            point_budget: args.budget,
            // Most views need colours: they come with the first bytes.
            attributes: args.appearance.color.attribute().map(str::to_owned).into_iter().collect(),
            ..EngineConfig::default()
        };
        let engine = Engine::start(sources, config)?;
        // While the first bytes are on their way.
        let mut fallback = None;
        let renderer = match args.renderer {
            RendererName::Gpu => {
                let path = args.appearance.gpu_path;
                let config = GpuConfig { path, ..GpuConfig::default() };
                Renderer::open(config, &mut |e| tell(e, &mut fallback))
            }
            RendererName::Cpu | RendererName::Truth => Renderer::Cpu(CpuRenderer),
        };
        let left = args.timeout.saturating_sub(start.elapsed());
        let boots = patience::wait(cancel, left, |turn| engine.wait_open(turn))?;
        let clouds: Vec<_> = boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
        let colorings = args.colorings(&clouds);
        Ok(Self { engine, clouds, colorings, fallback, renderer })
    }

    /// Asks for the attributes that pictures of such settings need, whatever their cameras.
    pub fn set_attributes(&self, settings: &RenderSettings) {
        let needed = self.clouds.iter().flat_map(|cloud| settings.attribute_names(cloud));
        self.engine.set_attributes(needed.collect());
    }

    /// Looks through the settings' camera; returns the view's number.
    pub fn set_view(&self, settings: &RenderSettings) -> u64 {
        self.engine.set_view(View { camera: settings.camera, size_px: settings.size_px })
    }

    /// Draws what there is.
    ///
    /// # Errors
    /// Where the view cannot be drawn.
    pub fn draw(
        &mut self,
        plan: &FramePlan,
        settings: &RenderSettings,
    ) -> Result<Frame, RenderError> {
        let scene = Scene { clouds: &plan.clouds, nodes: &plan.nodes };
        self.renderer.render(&scene, settings, &mut |e| tell(e, &mut self.fallback))
    }

    /// What draws: `gpu: ADAPTER` or `cpu`.
    pub fn renderer_name(&self) -> String {
        self.renderer.name()
    }

    /// Why the GPU does not draw, where it was asked to.
    pub fn fallback(&self) -> Option<String> {
        // A GPU that was opened anew draws again.
        let on_cpu = matches!(self.renderer, Renderer::Cpu(_));
        self.fallback.clone().filter(|_| on_cpu)
    }

    /// As a report names the colours.
    pub fn color_names(&self) -> Vec<&'static str> {
        self.colorings.iter().map(Coloring::name).collect()
    }
}

fn tell(e: &RenderError, fallback: &mut Option<String>) {
    let then = match e {
        RenderError::Gpu(_) => "opening it anew, or drawing on the CPU",
        _ => "drawing on the CPU",
    };
    eprintln!("note: {e}; {then}");
    *fallback = Some(e.to_string());
}

/// Streams what the view needs within the budget, and draws it.
///
/// # Errors
/// Where a source cannot be read in time or the view cannot be drawn.
pub(super) fn draw(args: &ShotArgs, camera: Option<Camera>) -> anyhow::Result<Shot> {
    let start = Instant::now();
    let left = || args.timeout.saturating_sub(start.elapsed());
    // Nothing is lost where an interrupt simply ends the program.
    let mut stream = Stream::open(args, &AtomicBool::new(false))?;
    let settings = args.settings(camera, &stream.clouds)?;
    stream.set_attributes(&settings);
    stream.set_view(&settings);

    let mut plan = wait_first(&stream.engine, left())?;
    let mut frame = stream.draw(&plan, &settings)?;
    let first_picture = start.elapsed();
    if !plan.settled {
        plan = stream.engine.wait_settled(left())?;
        frame = stream.draw(&plan, &settings)?;
    }
    let settled_picture = start.elapsed();

    let stats = stream.engine.stats();
    let milliseconds = |time: Duration| time.as_secs_f64() * 1e3;
    let report = ShotReport {
        sources: args.sources.clone(),
        picture: args.output.clone(),
        size_px: args.size,
        camera: serde_json::from_str(&settings.camera.to_json())?,
        renderer: stream.renderer_name(),
        fallback: stream.fallback(),
        colors: stream.color_names(),
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
        points_per_pixel: frame.points_per_pixel,
    };
    Ok(Shot { picture: frame.picture, report })
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
