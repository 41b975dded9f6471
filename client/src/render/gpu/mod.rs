//! The GPU renderer: headless wgpu, any backend.
//!
//! Nodes lie bit-packed in a few large storage buffers ([`pool`]); a frame uploads what is new,
//! writes one small record per node (where it is in view space) and one per 256 points (where its
//! records start), and draws whole runs of nodes with one call each. The vertex stage takes the
//! integers apart, moves them to view space relative to the lattice point nearest to the eye, and
//! expands splats.

mod device;
mod layout;
mod pack;
mod pipelines;
mod pool;
mod ranges;
mod target;

use lodestream_shaders::{ColorSource, Footprint};

use self::{
    device::Device,
    layout::{CHUNK_POINTS, CameraUniform, ChunkEntry, NodeUniform, packed_color},
    pack::RecordLayout,
    pipelines::Pipelines,
    pool::Pool,
    target::Target,
};
use crate::{
    engine::DrawNode,
    render::{
        Frame, FrameStatistics, RenderError, RenderSettings, Scene, color::NodeColor, ramp::Ramp,
        scene::Surroundings, view::View,
    },
};

/// Draws with wgpu, into memory.
pub struct GpuRenderer {
    device: Device,
    pipelines: Pipelines,
    pool: Pool,
    ramps: wgpu::Buffer,
    quad_indices: wgpu::Buffer,
    target: Option<Target>,
}

/// Consecutive chunks of a frame that one call draws.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Run {
    color: ColorSource,
    page: usize,
    chunks: std::ops::Range<u32>,
}

/// What a frame draws, in drawing order.
#[derive(Default)]
struct Plan {
    nodes: Vec<NodeUniform>,
    chunks: Vec<ChunkEntry>,
    runs: Vec<Run>,
}

impl GpuRenderer {
    /// Opens the best adapter and keeps up to `resident_bytes` of nodes on it between frames.
    ///
    /// # Errors
    /// [`RenderError::NoGpu`] where there is no usable adapter: draw on the CPU.
    pub fn new(resident_bytes: u64) -> Result<Self, RenderError> {
        let device = Device::open()?;
        let pipelines = Pipelines::new(&device.device);
        let pool = Pool::new(&device, pipelines.page_layout.clone(), resident_bytes);
        let tables = Ramp::IN_SHADERS.iter().flat_map(|ramp| ramp.table());
        let ramps: Vec<u32> = tables.map(packed_color).collect();
        let storage = wgpu::BufferUsages::STORAGE;
        let ramps = filled(&device, "ramps", storage, bytemuck::cast_slice(&ramps));
        let indices = pipelines::quad_indices();
        let index = wgpu::BufferUsages::INDEX;
        let quad_indices = filled(&device, "quads", index, bytemuck::cast_slice(&indices));
        device.check()?;
        Ok(Self { device, pipelines, pool, ramps, quad_indices, target: None })
    }

    /// Adapter, kind and backend, for a user.
    #[must_use]
    pub fn adapter(&self) -> &str {
        &self.device.name
    }

    /// Draws a scene.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn;
    /// [`RenderError::Gpu`] where the GPU fails: out of memory, or lost.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
    ) -> Result<Frame, RenderError> {
        settings.check()?;
        let largest = self.device.largest_side_px();
        if settings.size_px.iter().any(|side| *side > largest) {
            return Err(RenderError::Settings(format!(
                "a picture of {}x{} pixels: {} draws at most {largest} a side",
                settings.size_px[0], settings.size_px[1], self.device.name
            )));
        }
        let nodes = scene.ordered()?;
        let around = Surroundings::of(scene.clouds, settings.color);
        let view = View::new(settings, 1, around.farthest(settings.camera.eye));
        self.pool.begin_frame();
        let mut plan = Plan::default();
        for node in &nodes {
            self.plan_node(&mut plan, scene, &around, &view, node);
        }
        self.pool.end_frame();
        let footprint = settings.splat.footprint();
        for run in &plan.runs {
            self.pipelines.make(&self.device.device, (footprint, run.color));
        }
        let device = &self.device.device;
        let target = self.target.take().filter(|target| target.size_px == settings.size_px);
        let target = target.unwrap_or_else(|| Target::new(device, settings.size_px));
        let mut encoder = device.create_command_encoder(&Default::default());
        self.encode(&mut encoder, &target, &view, footprint, settings.background, &plan);
        target.copy(&mut encoder);
        self.device.queue.submit([encoder.finish()]);
        let (near, bias) = (view.near as f32, view.depth_bias as f32);
        let picture = target.read(&self.device, |depth| near / depth - bias)?;
        self.target = Some(target);
        let (resident_bytes, uploaded_bytes) = self.pool.bytes();
        let draw_calls = plan.runs.len() as u64;
        let statistics = FrameStatistics {
            draw_calls,
            uploaded_bytes,
            resident_bytes,
            ..FrameStatistics::of(&nodes)
        };
        Ok(Frame { picture, statistics })
    }

    /// Uploads a node where needed and appends it to the plan.
    fn plan_node(
        &mut self,
        plan: &mut Plan,
        scene: &Scene,
        around: &Surroundings,
        view: &View,
        node: &DrawNode,
    ) {
        let points = node.points.as_ref();
        if points.positions.is_empty() {
            return;
        }
        let lattice = &scene.clouds[node.cloud].lattice;
        let colors = NodeColor::of(around, node.cloud, lattice, points, &Default::default());
        let source = match colors {
            NodeColor::Rgb { .. } => ColorSource::Rgb,
            NodeColor::Intensity { .. } => ColorSource::Intensity,
            NodeColor::Elevation { .. } => ColorSource::Elevation,
            _ => ColorSource::Node,
        };
        let cloud = &scene.clouds[node.cloud];
        let resident = self.pool.node(&self.device, cloud, points, source, &colors);

        let RecordLayout { min, max, .. } = resident.layout;
        // The lattice point of the node's box nearest to the eye.
        let eye = view.eye_in_node(lattice, points.key);
        let nearest = |axis: usize| {
            let eye = eye[axis].round().clamp(f64::from(min[axis]), f64::from(max[axis]));
            eye as u32
        };
        let anchor: [u32; 3] = std::array::from_fn(nearest);
        let node_view = view.node(lattice, points.key, anchor);
        let relative = std::array::from_fn(|axis| anchor[axis] - min[axis]);
        let mut uniform = NodeUniform::new(&node_view, relative, resident.layout.record_bits());
        match colors {
            NodeColor::Constant(color) => uniform.color = packed_color(color),
            NodeColor::Elevation { at_corner, per_unit } => {
                uniform.elevation = (at_corner + per_unit * f64::from(min[2])) as f32;
                uniform.elevation_step = per_unit as f32;
            }
            _ => {}
        }
        // The plan of a frame is far below 2^32 nodes and chunks: points are counted in memory.
        let index = plan.nodes.len() as u32;
        plan.nodes.push(uniform);
        let chunk_words = resident.layout.chunk_words() as u32;
        for piece in &resident.pieces {
            let first = plan.chunks.len() as u32;
            let starts = (0..piece.points).step_by(CHUNK_POINTS);
            plan.chunks.extend(starts.zip(0..).map(|(start, chunk)| ChunkEntry {
                node: index,
                first_word: piece.first_word + chunk * chunk_words,
                points: (piece.points - start).min(CHUNK_POINTS as u32),
            }));
            let end = plan.chunks.len() as u32;
            match plan.runs.last_mut() {
                Some(run) if run.color == source && run.page == piece.page => run.chunks.end = end,
                _ => plan.runs.push(Run { color: source, page: piece.page, chunks: first..end }),
            }
        }
    }

    /// Records the pass that draws a plan.
    fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        target: &Target,
        view: &View,
        footprint: Footprint,
        background: [u8; 3],
        plan: &Plan,
    ) {
        let [r, g, b] = background.map(|component| f64::from(component) / 255.0);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("splats"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target.color_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a: 1.0 }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &target.depth_view,
                depth_ops: Some(wgpu::Operations {
                    // Reversed depth: infinitely far away.
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        if plan.runs.is_empty() {
            return;
        }
        let storage = wgpu::BufferUsages::STORAGE;
        let camera = CameraUniform::new(view);
        let uniform = wgpu::BufferUsages::UNIFORM;
        let camera = filled(&self.device, "camera", uniform, bytemuck::bytes_of(&camera));
        let nodes = filled(&self.device, "nodes", storage, bytemuck::cast_slice(&plan.nodes));
        let chunks = filled(&self.device, "chunks", storage, bytemuck::cast_slice(&plan.chunks));
        let buffers = [&camera, &nodes, &chunks, &self.ramps];
        let entries: Vec<_> = buffers
            .iter()
            .zip(0..)
            .map(|(b, binding)| wgpu::BindGroupEntry { binding, resource: b.as_entire_binding() })
            .collect();
        let frame = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &self.pipelines.frame_layout,
            entries: &entries,
        });
        pass.set_bind_group(0, &frame, &[]);
        pass.set_index_buffer(self.quad_indices.slice(..), wgpu::IndexFormat::Uint16);
        for run in &plan.runs {
            let pipeline = self.pipelines.get((footprint, run.color));
            let (Some(pipeline), Some(page)) = (pipeline, self.pool.bind_group(run.page)) else {
                continue;
            };
            pass.set_pipeline(pipeline);
            pass.set_bind_group(1, page, &[]);
            let points = CHUNK_POINTS as u32;
            match footprint {
                Footprint::Point => pass.draw(0..points, run.chunks.clone()),
                Footprint::Square => pass.draw_indexed(0..6 * points, 0, run.chunks.clone()),
                _ => pass.draw(0..3 * points, run.chunks.clone()),
            }
        }
    }
}

/// A buffer that holds `bytes` (not empty, a multiple of four).
fn filled(device: &Device, label: &str, usage: wgpu::BufferUsages, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage: usage | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    device.queue.write_buffer(&buffer, 0, bytes);
    buffer
}
