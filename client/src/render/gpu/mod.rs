//! The GPU renderer: headless wgpu, any backend.
//!
//! Nodes lie bit-packed in a few large storage buffers ([`pool`]); a frame uploads what is new,
//! writes one small record per node (where it is in view space) and one per 256 points (where its
//! records start) ([`plan`]), and draws whole runs of nodes with one call each ([`passes`]). Shaders
//! take the integers apart, move them to view space relative to the lattice point nearest to the
//! eye, and find the pixels that splats cover: by the rasteriser or by compute, whichever is faster
//! ([`choice`]); both give the same picture.

mod choice;
mod config;
mod device;
mod layout;
mod pack;
mod passes;
mod pipelines;
mod plan;
mod pool;
mod ranges;
mod target;

use std::time::Instant;

use lodestream_shaders::Pixels;

use self::{
    choice::{Choice, Kind},
    device::Device,
    layout::{CameraUniform, packed_color},
    passes::Passes,
    pipelines::Pipelines,
    plan::Plan,
    pool::Pool,
    target::{Target, pixel_count},
};
pub use self::{
    config::{GpuConfig, GpuPath},
    pipelines::shader_bytes,
};
use crate::render::{
    CloudColors, ColorMode, Frame, FrameStatistics, Picture, PointsPerPixel, RenderError,
    RenderSettings, Scene, ramp::Ramp, scene::Surroundings, view::View,
};

/// Splats that may be larger are not tried by compute, unless asked for: one invocation draws all
/// pixels of a splat, and adapters are reset that work on one thing for too long.
const MOST_COMPUTED_PX: f64 = 64.0;

/// Draws with wgpu, into memory.
pub struct GpuRenderer {
    device: Device,
    pipelines: Pipelines,
    pool: Pool,
    ramps: wgpu::Buffer,
    target: Option<Target>,
    path: GpuPath,
    choice: Choice,
    /// What the picture in `target` is like.
    drawn: Option<Drawn>,
}

/// What the last picture is like.
#[derive(Clone, Copy)]
struct Drawn {
    /// Whether eye-dome lighting was the last pass.
    lit: bool,
    near: f32,
    depth_bias: f32,
}

/// A frame on its way.
struct Submitted {
    statistics: FrameStatistics,
    view: View,
    /// Whether eye-dome lighting was the last pass.
    lit: bool,
    /// What to measure it by, where there is a choice.
    kind: Option<Kind>,
    since: Instant,
}

impl GpuRenderer {
    /// Opens the best adapter.
    ///
    /// # Errors
    /// [`RenderError::NoGpu`] where there is no usable adapter: draw on the CPU.
    pub fn new(config: GpuConfig) -> Result<Self, RenderError> {
        Self::with(Device::open(config.least_adapter)?, config)
    }

    /// On an adapter that can also show pictures on a window. [`device`](Self::device) is then what shows
    /// them.
    ///
    /// # Errors
    /// [`RenderError::NoGpu`] where the adapter lacks what drawing needs.
    pub fn on(adapter: &wgpu::Adapter, config: GpuConfig) -> Result<Self, RenderError> {
        Self::with(Device::on(adapter, config.least_adapter)?, config)
    }

    fn with(device: Device, config: GpuConfig) -> Result<Self, RenderError> {
        let pipelines = Pipelines::new(&device.device, device.pixels, device.sums_format);
        let pool = Pool::new(&device, pipelines.page_layout.clone(), &config);
        let tables = Ramp::IN_SHADERS.iter().flat_map(|ramp| ramp.table());
        let ramps: Vec<u32> = tables.map(packed_color).collect();
        let storage = wgpu::BufferUsages::STORAGE;
        let ramps = device.filled("ramps", storage, bytemuck::cast_slice(&ramps));
        device.check()?;
        let (target, choice, drawn) = (None, Choice::default(), None);
        Ok(Self { device, pipelines, pool, ramps, target, path: config.path, choice, drawn })
    }

    /// Adapter, kind and backend, for a user.
    #[must_use]
    pub fn adapter(&self) -> &str {
        &self.device.name
    }

    /// Draws a scene and takes the picture.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn;
    /// [`RenderError::Gpu`] where the GPU fails: out of memory, or lost.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
    ) -> Result<Frame, RenderError> {
        let submitted = self.submit(scene, settings, CloudColors::default())?;
        let device = &self.device;
        let Some(target) = &mut self.target else {
            return Err(RenderError::Gpu("the picture is gone".into()));
        };
        let mut encoder = device.device.create_command_encoder(&Default::default());
        target.copy(device, &mut encoder, submitted.lit);
        let counts = (settings.color == ColorMode::Density).then(|| {
            let bytes = 4 * pixel_count(settings.size_px);
            let counts = device.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("counts"),
                size: bytes,
                usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
                mapped_at_creation: false,
            });
            let pixels = target.pixels(device, Pixels::Narrow);
            encoder.copy_buffer_to_buffer(&pixels.second, 0, &counts, 0, bytes);
            counts
        });
        device.queue.submit([encoder.finish()]);
        let (near, bias) = (submitted.view.near as f32, submitted.view.depth_bias as f32);
        let picture = target.read(device, |depth| near / depth - bias)?;
        let mut points_per_pixel = None;
        if let Some(counts) = counts {
            target::read(device, &counts, |bytes| {
                let counts: Vec<u32> = bytemuck::pod_collect_to_vec(bytes);
                points_per_pixel = Some(PointsPerPixel::of(&counts));
            })?;
        }
        self.took(&submitted);
        Ok(Frame { picture, statistics: submitted.statistics, points_per_pixel })
    }

    /// Draws a scene, waits until it is drawn, and leaves the picture where it is.
    ///
    /// # Errors
    /// As for [`render`](Self::render).
    pub fn draw(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
    ) -> Result<FrameStatistics, RenderError> {
        self.draw_colored(scene, settings, CloudColors::default())
    }

    /// The same, each cloud in colours of its own.
    ///
    /// # Errors
    /// As for [`render`](Self::render).
    pub fn draw_colored(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        colors: CloudColors,
    ) -> Result<FrameStatistics, RenderError> {
        let submitted = self.submit(scene, settings, colors)?;
        let wait = wgpu::PollType::wait_indefinitely();
        self.device.device.poll(wait).map_err(|e| RenderError::Gpu(e.to_string()))?;
        self.device.check()?;
        self.took(&submitted);
        Ok(submitted.statistics)
    }

    /// The device and its queue.
    #[must_use]
    pub const fn device(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device.device, &self.device.queue)
    }

    /// What went wrong since the last look, on this device and by whomever.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] says what did.
    pub fn check(&self) -> Result<(), RenderError> {
        self.device.check()
    }

    /// The colours of the last picture, where they were left; for shaders to read.
    #[must_use]
    pub fn picture_view(&self) -> Option<&wgpu::TextureView> {
        Some(self.target.as_ref()?.shown(self.drawn?.lit))
    }

    /// Takes the last picture that was left where it is.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] where the GPU fails, or where nothing was drawn yet.
    pub fn take_picture(&mut self) -> Result<Picture, RenderError> {
        let (Some(target), Some(drawn)) = (&mut self.target, self.drawn) else {
            return Err(RenderError::Gpu("nothing was drawn yet".into()));
        };
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        target.copy(&self.device, &mut encoder, drawn.lit);
        self.device.queue.submit([encoder.finish()]);
        target.read(&self.device, |depth| drawn.near / depth - drawn.depth_bias)
    }

    /// Takes the device away, as a reset or an unplugged adapter does.
    #[cfg(test)]
    pub(crate) fn lose(&self) {
        self.device.device.destroy();
    }

    fn took(&mut self, frame: &Submitted) {
        // A frame that sends nodes to the GPU takes longer for it, however it is drawn.
        if let Some(kind) = frame.kind
            && frame.statistics.uploaded_bytes == 0
        {
            let by_compute = frame.statistics.path == Some(GpuPath::Compute);
            self.choice.took(kind, by_compute, frame.since.elapsed());
        }
    }

    /// Sends a frame on its way.
    fn submit(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        colors: CloudColors,
    ) -> Result<Submitted, RenderError> {
        settings.check()?;
        let size_px = settings.size_px;
        let largest = self.device.largest_side_px();
        if size_px.iter().any(|side| *side > largest) {
            return Err(RenderError::Settings(format!(
                "a picture of {}x{} pixels: {} draws at most {largest} a side",
                size_px[0], size_px[1], self.device.name
            )));
        }
        let nodes = scene.ordered()?;
        let since = Instant::now();
        let around = Surroundings::of(scene.clouds, |cloud| colors.mode(cloud, settings));
        let view = View::new(settings, 1, around.farthest(settings.camera.eye));
        let tree = scene.tree();
        let frame =
            plan::Frame { colors, scene, settings, around: &around, tree: &tree, view: &view };
        self.pool.begin_frame();
        let mut plan = Plan::default();
        for node in &nodes {
            plan.add(&self.device, &mut self.pool, &frame, node);
        }
        self.pool.end_frame();

        let pixels = pixel_count(size_px);
        let fits = 8 * pixels <= self.device.largest_binding();
        let counted = settings.color == ColorMode::Density;
        if counted && !fits {
            return Err(RenderError::Settings(format!(
                "{} cannot count the points of {pixels} pixels: ask for a smaller picture",
                self.device.name
            )));
        }
        let footprint = settings.splat.footprint();
        let computable = fits && !settings.splat.is_blended() && !footprint.is_mesh();
        let sensible = computable && plan.largest_px <= MOST_COMPUTED_PX;
        let kind = (sensible && !counted && self.path == GpuPath::Auto)
            .then(|| Kind::new(footprint, plan.points, pixels));
        let by_compute = counted
            || match (kind, self.path) {
                (Some(kind), _) => self.choice.by_compute(kind),
                (None, path) => computable && path == GpuPath::Compute,
            };

        let target = self.target.take().filter(|target| target.size_px == size_px);
        let mut target = target.unwrap_or_else(|| Target::new(&self.device.device, size_px));
        let mut encoder = self.device.device.create_command_encoder(&Default::default());
        let camera = CameraUniform::new(&view, frame.size_factor());
        let mut passes = Passes::new(
            &self.device,
            &mut self.pipelines,
            &self.pool,
            &plan,
            &mut target,
            &mut encoder,
            &self.ramps,
            &camera,
            &tree,
            settings.background,
        );
        if counted {
            passes.density();
        } else if settings.splat.is_blended() {
            passes.blended();
        } else if by_compute {
            passes.compute();
        } else {
            passes.raster();
        }
        let dome = settings.shading.eye_dome.filter(|_| !counted);
        if let Some(dome) = &dome {
            passes.eye_dome(&view, dome);
        }
        self.device.queue.submit([encoder.finish()]);
        self.target = Some(target);
        let (near, depth_bias) = (view.near as f32, view.depth_bias as f32);
        self.drawn = Some(Drawn { lit: dome.is_some(), near, depth_bias });
        let (resident_bytes, uploaded_bytes) = self.pool.bytes();
        let statistics = FrameStatistics {
            nodes: plan.nodes.len() as u64,
            points: plan.points,
            draw_calls: plan.runs.len() as u64,
            uploaded_bytes,
            resident_bytes,
            waiting_nodes: plan.waiting_nodes,
            path: Some(if by_compute { GpuPath::Compute } else { GpuPath::Raster }),
        };
        Ok(Submitted { statistics, view, lit: dome.is_some(), kind, since })
    }
}
