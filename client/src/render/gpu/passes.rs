//! The passes that a frame is made of: splats by the rasteriser, blended or not; splats by compute;
//! the heat map; eye-dome lighting.

use lodestream_shaders::{CHUNK_POINTS, Footprint, Pixels};

use super::{
    device::Device,
    layout::{CameraUniform, EyeDomeUniform, RunUniform},
    pipelines::{Computing, Drawing, Pipelines},
    plan::{Plan, Run},
    pool::Pool,
    target::{PixelBuffers, Target, pixel_count},
};
use crate::render::{EyeDome, VisibleTree, view::View};

/// Workgroups in one dimension of a dispatch: what every adapter allows.
const MOST_WORKGROUPS: u32 = 65_535;

/// What the passes of a frame share.
pub struct Passes<'a> {
    pub device: &'a Device,
    pub pipelines: &'a mut Pipelines,
    pub pool: &'a Pool,
    pub plan: &'a Plan,
    pub target: &'a mut Target,
    pub encoder: &'a mut wgpu::CommandEncoder,
    pub background: wgpu::Color,
    /// Group 0; `None` where nothing is drawn.
    frame: Option<wgpu::BindGroup>,
}

impl<'a> Passes<'a> {
    /// Passes of a plan seen by `camera`, with sizes looked up in `tree`.
    #[expect(clippy::too_many_arguments, reason = "each is one thing of the frame")]
    pub fn new(
        device: &'a Device,
        pipelines: &'a mut Pipelines,
        pool: &'a Pool,
        plan: &'a Plan,
        target: &'a mut Target,
        encoder: &'a mut wgpu::CommandEncoder,
        ramps: &wgpu::Buffer,
        camera: &CameraUniform,
        tree: &VisibleTree,
        background: [u8; 3],
    ) -> Self {
        let frame = (!plan.runs.is_empty()).then(|| {
            let storage = wgpu::BufferUsages::STORAGE;
            let uniform = wgpu::BufferUsages::UNIFORM;
            let camera = device.filled("camera", uniform, bytemuck::bytes_of(camera));
            let nodes = device.filled("nodes", storage, bytemuck::cast_slice(&plan.nodes));
            let chunks = device.filled("chunks", storage, bytemuck::cast_slice(&plan.chunks));
            let mut entries: Vec<[u32; 2]> = tree
                .nodes()
                .iter()
                .map(|n| [n.first_child << 8 | u32::from(n.children), n.spacing.to_bits()])
                .collect();
            // A binding must not be empty.
            entries.resize(entries.len().max(1), [0; 2]);
            let tree = device.filled("visible tree", storage, bytemuck::cast_slice(&entries));
            bind(
                device,
                &pipelines.frame_layout,
                &[(0, &camera), (1, &nodes), (2, &chunks), (3, ramps), (4, &tree)],
            )
        });
        let [r, g, b] = background.map(|component| f64::from(component) / 255.0);
        let background = wgpu::Color { r, g, b, a: 1.0 };
        Self { device, pipelines, pool, plan, target, encoder, background, frame }
    }

    /// Splats by the rasteriser, the nearest seen.
    pub fn raster(&mut self) {
        let color_view = self.target.color_view.clone();
        let clear = wgpu::LoadOp::Clear(self.background);
        let color = attachment(&color_view, clear);
        self.splats(&[Some(color)], wgpu::LoadOp::Clear(0.0), Drawing::Splats);
    }

    /// Splats by the rasteriser, blended. (Botsch et al. 2005)
    pub fn blended(&mut self) {
        self.splats(&[], wgpu::LoadOp::Clear(0.0), Drawing::Nearest);
        let sums = self.target.sums(self.device);
        let clear = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
        self.splats(&[Some(attachment(&sums, clear))], wgpu::LoadOp::Load, Drawing::Sums);
        let layout = &self.pipelines.sums_layout;
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("sums"),
            layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: wgpu::BindingResource::TextureView(&sums),
            }],
        });
        let pipeline = self.pipelines.drawing(&self.device.device, Drawing::Normalised);
        let clear = wgpu::LoadOp::Clear(self.background);
        let color = attachment(&self.target.color_view, clear);
        let mut pass = begin(self.encoder, &[Some(color)], None);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }

    fn splats(
        &mut self,
        colors: &[Option<wgpu::RenderPassColorAttachment>],
        depth: wgpu::LoadOp<f32>,
        kind: impl Fn(lodestream_shaders::Splatting) -> Drawing,
    ) {
        let mut pass = begin(self.encoder, colors, Some((&self.target.depth_view, depth)));
        let Some(frame) = &self.frame else { return };
        pass.set_bind_group(0, frame, &[]);
        for run in &self.plan.runs {
            let Some(page) = self.pool.bind_group(run.page) else { continue };
            let device = &self.device.device;
            pass.set_pipeline(self.pipelines.drawing(device, kind(run.splatting)));
            pass.set_bind_group(1, page, &[]);
            let footprint = run.splatting.footprint;
            if let Some(indices) = self.pipelines.indices(device, footprint) {
                pass.set_index_buffer(indices.buffer.slice(..), wgpu::IndexFormat::Uint16);
                pass.draw_indexed(0..indices.count, 0, run.chunks.clone());
            } else {
                let corners = if footprint == Footprint::Point { 1 } else { 3 };
                pass.draw(0..corners * CHUNK_POINTS as u32, run.chunks.clone());
            }
        }
    }

    /// Splats by compute.
    pub fn compute(&mut self) {
        let pixels = self.device.pixels;
        let passes = if pixels == Pixels::Narrow { 2 } else { 1 };
        self.offer(pixels, passes, Computing::Nearest);
        let runs = Runs::new(self.device, &self.plan.runs, 1);
        let buffers = self.target.pixels(self.device, pixels);
        let found = bind_run(self.device, &self.pipelines.found_layout, &runs, buffers);
        let colors = attachment(&self.target.color_view, wgpu::LoadOp::Clear(self.background));
        let depth = Some((&self.target.depth_view, wgpu::LoadOp::Clear(0.0)));
        let mut pass = begin(self.encoder, &[Some(colors)], depth);
        let Some(frame) = &self.frame else { return };
        pass.set_bind_group(0, frame, &[]);
        for (index, run) in self.plan.runs.iter().enumerate() {
            let Some(page) = self.pool.bind_group(run.page) else { continue };
            let resolve = Drawing::Resolve(run.splatting);
            pass.set_pipeline(self.pipelines.drawing(&self.device.device, resolve));
            pass.set_bind_group(1, page, &[]);
            pass.set_bind_group(2, &found, &[runs.offset(index, 0)]);
            pass.draw(0..3, 0..1);
        }
    }

    /// Counts points; draws the counts. The counts are in the second of the pixels' buffers.
    pub fn density(&mut self) {
        self.offer(Pixels::Narrow, 1, Computing::Count);
        let count = pixel_count(self.target.size_px);
        // Pictures have fewer than 2^32 pixels.
        let size = [self.target.size_px[0], count as u32];
        let uniform = wgpu::BufferUsages::UNIFORM;
        let size = self.device.filled("size", uniform, bytemuck::cast_slice(&size));
        let most = self.device.filled("most", wgpu::BufferUsages::STORAGE, &[0; 4]);
        let pixels = self.target.pixels(self.device, Pixels::Narrow);
        let (layout, device) = (&self.pipelines.most_layout, &self.device.device);
        let group = bind(self.device, layout, &[(0, &size), (2, &pixels.second), (3, &most)]);
        {
            let pipeline = self.pipelines.computing(device, Computing::Most);
            let mut pass = self.encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(1, &group, &[]);
            let groups = count.div_ceil(256) as u32;
            pass.dispatch_workgroups(
                groups.min(MOST_WORKGROUPS),
                groups.div_ceil(MOST_WORKGROUPS),
                1,
            );
        }
        let layout = &self.pipelines.density_layout;
        let group = bind(
            self.device,
            layout,
            &[(0, &size), (1, &pixels.first), (2, &pixels.second), (3, &most)],
        );
        let colors = attachment(&self.target.color_view, wgpu::LoadOp::Clear(self.background));
        let depth = Some((&self.target.depth_view, wgpu::LoadOp::Clear(0.0)));
        let mut pass = begin(self.encoder, &[Some(colors)], depth);
        let Some(frame) = &self.frame else { return };
        pass.set_pipeline(self.pipelines.drawing(device, Drawing::Density));
        pass.set_bind_group(0, frame, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.draw(0..3, 0..1);
    }

    /// Offers every point to the pixels that it covers, in so many passes.
    fn offer(
        &mut self,
        pixels: Pixels,
        passes: u32,
        kind: impl Fn(lodestream_shaders::Splatting) -> Computing,
    ) {
        let buffers = self.target.pixels(self.device, pixels);
        self.encoder.clear_buffer(&buffers.first, 0, None);
        self.encoder.clear_buffer(&buffers.second, 0, None);
        let Some(frame) = &self.frame else { return };
        let runs = Runs::new(self.device, &self.plan.runs, passes);
        let group = bind_run(self.device, &self.pipelines.offer_layout, &runs, buffers);
        for pass_index in 0..passes {
            let mut pass = self.encoder.begin_compute_pass(&Default::default());
            pass.set_bind_group(0, frame, &[]);
            for (index, run) in self.plan.runs.iter().enumerate() {
                let Some(page) = self.pool.bind_group(run.page) else { continue };
                let kind = kind(run.splatting);
                pass.set_pipeline(self.pipelines.computing(&self.device.device, kind));
                pass.set_bind_group(1, page, &[]);
                pass.set_bind_group(2, &group, &[runs.offset(index, pass_index)]);
                let chunks = run.chunks.len() as u32;
                let row = row(chunks);
                pass.dispatch_workgroups(row, chunks.div_ceil(row), 1);
            }
        }
    }

    /// Eye-dome lighting.
    pub fn eye_dome(&mut self, view: &View, dome: &EyeDome) {
        let lit = self.target.lit(&self.device.device);
        let uniform = EyeDomeUniform::new(view, self.target.size_px, dome);
        let usage = wgpu::BufferUsages::UNIFORM;
        let uniform = self.device.filled("eye dome", usage, bytemuck::bytes_of(&uniform));
        let texture = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let group = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("eye dome"),
            layout: &self.pipelines.eye_dome_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() },
                texture(1, &self.target.color_view),
                texture(2, &self.target.depth_view),
            ],
        });
        let pipeline = self.pipelines.drawing(&self.device.device, Drawing::EyeDome);
        let color = attachment(&lit, wgpu::LoadOp::Clear(self.background));
        let mut pass = begin(self.encoder, &[Some(color)], None);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Uniforms of all runs and passes, in one buffer.
struct Runs {
    buffer: wgpu::Buffer,
    stride: u32,
    passes: u32,
}

impl Runs {
    fn new(device: &Device, runs: &[Run], passes: u32) -> Self {
        let size = size_of::<RunUniform>();
        let stride = device.device.limits().min_uniform_buffer_offset_alignment;
        let stride = stride.max(size as u32);
        let mut bytes = vec![0; (runs.len() * passes as usize).max(1) * stride as usize];
        let slots = bytes.chunks_exact_mut(stride as usize);
        let each = runs.iter().flat_map(|run| (0..passes).map(move |pass| (run, pass)));
        for (slot, (run, pass_index)) in slots.zip(each) {
            let (first, end) = (run.chunks.start, run.chunks.end);
            let uniform = RunUniform { first, end, row: row(end - first), pass_index };
            slot[..size].copy_from_slice(bytemuck::bytes_of(&uniform));
        }
        let buffer = device.filled("runs", wgpu::BufferUsages::UNIFORM, &bytes);
        Self { buffer, stride, passes }
    }

    const fn offset(&self, run: usize, pass: u32) -> u32 {
        (run as u32 * self.passes + pass) * self.stride
    }
}

/// Workgroups in a row of a dispatch of `chunks` workgroups.
fn row(chunks: u32) -> u32 {
    chunks.clamp(1, MOST_WORKGROUPS)
}

fn bind(
    device: &Device,
    layout: &wgpu::BindGroupLayout,
    buffers: &[(u32, &wgpu::Buffer)],
) -> wgpu::BindGroup {
    let entries: Vec<_> = buffers
        .iter()
        .map(|&(binding, buffer)| wgpu::BindGroupEntry {
            binding,
            resource: buffer.as_entire_binding(),
        })
        .collect();
    let descriptor = wgpu::BindGroupDescriptor { label: None, layout, entries: &entries };
    device.device.create_bind_group(&descriptor)
}

fn bind_run(
    device: &Device,
    layout: &wgpu::BindGroupLayout,
    runs: &Runs,
    pixels: &PixelBuffers,
) -> wgpu::BindGroup {
    let size = wgpu::BufferSize::new(size_of::<RunUniform>() as u64);
    let run = wgpu::BufferBinding { buffer: &runs.buffer, offset: 0, size };
    let entry = |binding, resource| wgpu::BindGroupEntry { binding, resource };
    device.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("pixels"),
        layout,
        entries: &[
            entry(0, wgpu::BindingResource::Buffer(run)),
            entry(1, pixels.first.as_entire_binding()),
            entry(2, pixels.second.as_entire_binding()),
        ],
    })
}

fn attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
    }
}

fn begin<'e>(
    encoder: &'e mut wgpu::CommandEncoder,
    colors: &[Option<wgpu::RenderPassColorAttachment>],
    depth: Option<(&wgpu::TextureView, wgpu::LoadOp<f32>)>,
) -> wgpu::RenderPass<'e> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: None,
        color_attachments: colors,
        depth_stencil_attachment: depth.map(|(view, load)| {
            wgpu::RenderPassDepthStencilAttachment {
                view,
                depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }
        }),
        ..Default::default()
    })
}
