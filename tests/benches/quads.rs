//! Squares by what a point costs in memory: four vertices a point, one instanced corner set, packed
//!
//! `./dev bench quads [INPUT] [--runs N]`. INPUT as for `frames`. Squares of 2 pixels can be had from
//! four stored vertices a point, as engines without a geometry stage do (Fraiss 2017, 3.3.2); from
//! one stored vertex, drawn as an instance of four corners; or from packed records that the vertex
//! stage takes apart, as lodestream's rasteriser does. Prints the median milliseconds of a frame of
//! 1280 x 720 pixels and the bytes a point takes for each, over the same points and one device kind.

use std::{borrow::Cow, error::Error, sync::Arc, time::Instant};

use glam::{DMat3, DVec3};
use lodestream_client::{
    camera::{Camera, Projection},
    engine::FramePlan,
    render::{GpuConfig, GpuPath, GpuRenderer, RenderSettings, Scene, Splat, SplatSize},
};
use lodestream_protocol::Manifest;
use lodestream_tests::{Options, median};
use wgpu::util::DeviceExt;

#[path = "support/overview.rs"]
mod overview;

use overview::{SIZE_PX, camera, dataset, load};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const BUDGETS: [u64; 4] = [500_000, 1_000_000, 2_500_000, 5_000_000];

const SPLAT_PX: f32 = 2.0;

/// Quads that indices of 16 bits reach.
const QUADS_PER_DRAW: usize = 1 << 14;

/// Corner by corner: a view-space place and a colour.
const SHADER: &str = "
struct View { px_per_unit: vec2<f32>, half_splat: vec2<f32>, near: f32 }
@group(0) @binding(0) var<uniform> view: View;
struct Out { @builtin(position) clip: vec4<f32>, @location(0) color: vec4<f32> }

@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) place: vec3<f32>, @location(1) color: vec4<f32>) -> Out {
    let corner = vec2(f32(index & 1u), f32(index >> 1u & 1u)) * 2.0 - 1.0;
    let center = place.xy * view.px_per_unit;
    return Out(vec4(center + corner * view.half_splat * place.z, view.near, place.z), color);
}

@fragment
fn fragment(in: Out) -> @location(0) vec4<f32> {
    return in.color;
}
";

#[repr(C)]
#[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Vertex {
    place: [f32; 3],
    rgba: [u8; 4],
}

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse("sim:courtyard?points=12M&seed=1")?;
    let dataset = dataset(&input, "bench_quads.lods")?;
    let open = || GpuRenderer::new(GpuConfig { path: GpuPath::Raster, ..GpuConfig::default() });
    let plain = Plain::open()?;
    println!("{}; {}x{} pixels; {runs} runs", open()?.adapter(), SIZE_PX[0], SIZE_PX[1]);
    println!("\n| points | way | ms | bytes/point | ms against packed |");
    println!("| --- | --- | --- | --- | --- |");
    for budget in BUDGETS {
        let (clouds, plan) = load(&dataset, budget)?;
        let camera = camera(&clouds);
        let scene = Scene { clouds: &clouds, nodes: &plan.nodes };
        let settings = RenderSettings {
            splat: Splat::Square,
            splat_size: SplatSize::Pixels(SPLAT_PX),
            ..RenderSettings::new(SIZE_PX, camera)
        };
        // Of its own, so that what is resident is what this budget needs.
        let mut ours = open()?;
        let resident = ours.draw(&scene, &settings)?.resident_bytes;
        let points = vertices(&clouds, &plan, &camera);
        let mut ways = plain.ways(&points);
        let [mut packed_ms, mut stored_ms, mut instanced_ms] = [const { Vec::new() }; 3];
        for _ in 0..=runs {
            for (way, times) in ways.iter_mut().zip([&mut stored_ms, &mut instanced_ms]) {
                let start = Instant::now();
                plain.draw(way, &camera)?;
                times.push(start.elapsed().as_secs_f64() * 1e3);
            }
            let start = Instant::now();
            ours.draw(&scene, &settings)?;
            packed_ms.push(start.elapsed().as_secs_f64() * 1e3);
        }
        let count = points.len().max(1) as f64;
        let packed = median(&mut packed_ms);
        let vertex = size_of::<Vertex>() as f64;
        for (name, ms, bytes) in [
            ("packed records", packed, resident as f64 / count),
            ("four vertices a point", median(&mut stored_ms), 4.0 * vertex),
            ("one vertex, four instanced corners", median(&mut instanced_ms), vertex),
        ] {
            println!("| {count} | {name} | {ms:.1} | {bytes:.2} | {:.2} |", ms / packed);
        }
    }
    Ok(())
}

/// All points in view space: right, up, ahead.
fn vertices(clouds: &[Arc<Manifest>], plan: &FramePlan, camera: &Camera) -> Vec<Vertex> {
    let basis = camera.basis();
    let to_view = DMat3::from_cols(basis.right, basis.up, basis.forward).transpose();
    let mut vertices = Vec::new();
    for node in &plan.nodes {
        let cloud = &clouds[node.cloud];
        let corner = cloud.lattice.node_min(node.key);
        let color = cloud.attributes.iter().position(|a| a.name == "color" && a.components == 3);
        let column = node.points.columns.iter().find(|c| Some(c.attribute) == color);
        let width = column.map_or(1, |c| c.bytes.len() / node.points.positions.len().max(1) / 3);
        for (index, q) in node.points.positions.iter().enumerate() {
            let world = cloud.lattice.world(std::array::from_fn(|a| corner[a] + q[a]));
            let view = to_view * (DVec3::from(world) - camera.eye);
            let rgb = |c: usize| column.map_or(200, |col| col.bytes[(3 * index + c) * width]);
            vertices.push(Vertex {
                place: view.as_vec3().to_array(),
                rgba: [rgb(0), rgb(1), rgb(2), 255],
            });
        }
    }
    vertices
}

/// Nothing but what is compared.
struct Plain {
    device: wgpu::Device,
    queue: wgpu::Queue,
    by_vertex: wgpu::RenderPipeline,
    by_instance: wgpu::RenderPipeline,
    color: wgpu::TextureView,
    depth: wgpu::TextureView,
}

/// A way to hold the points.
struct Way {
    points: usize,
    vertices: wgpu::Buffer,
    /// `None`: an instance a point.
    indices: Option<wgpu::Buffer>,
}

impl Plain {
    fn open() -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))?;
        let descriptor =
            wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))?;
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(SHADER)),
        });
        let pipeline = |step_mode| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: None,
                layout: None,
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex"),
                    compilation_options: Default::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride: size_of::<Vertex>() as u64,
                        step_mode,
                        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Unorm8x4],
                    })],
                },
                primitive: wgpu::PrimitiveState {
                    topology: match step_mode {
                        wgpu::VertexStepMode::Vertex => wgpu::PrimitiveTopology::TriangleList,
                        wgpu::VertexStepMode::Instance => wgpu::PrimitiveTopology::TriangleStrip,
                    },
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: wgpu::TextureFormat::Depth32Float,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: Default::default(),
                    bias: Default::default(),
                }),
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment"),
                    compilation_options: Default::default(),
                    targets: &[Some(wgpu::TextureFormat::Rgba8Unorm.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let target = |format| {
            let texture = device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d {
                    width: SIZE_PX[0],
                    height: SIZE_PX[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                view_formats: &[],
            });
            texture.create_view(&Default::default())
        };
        Ok(Self {
            by_vertex: pipeline(wgpu::VertexStepMode::Vertex),
            by_instance: pipeline(wgpu::VertexStepMode::Instance),
            color: target(wgpu::TextureFormat::Rgba8Unorm),
            depth: target(wgpu::TextureFormat::Depth32Float),
            device,
            queue,
        })
    }

    fn buffer(&self, bytes: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let descriptor = wgpu::util::BufferInitDescriptor { label: None, contents: bytes, usage };
        self.device.create_buffer_init(&descriptor)
    }

    fn ways(&self, points: &[Vertex]) -> [Way; 2] {
        let four: Vec<Vertex> = points.iter().flat_map(|point| [*point; 4]).collect();
        let indices: Vec<u16> = (0..QUADS_PER_DRAW)
            .flat_map(|quad| [0, 1, 2, 2, 1, 3].map(|corner| (4 * quad + corner) as u16))
            .collect();
        let vertex = wgpu::BufferUsages::VERTEX;
        let indices = self.buffer(bytemuck::cast_slice(&indices), wgpu::BufferUsages::INDEX);
        let points_len = points.len();
        let stored = self.buffer(bytemuck::cast_slice(&four), vertex);
        let single = self.buffer(bytemuck::cast_slice(points), vertex);
        [
            Way { points: points_len, vertices: stored, indices: Some(indices) },
            Way { points: points_len, vertices: single, indices: None },
        ]
    }

    /// Draws and waits until it is drawn.
    fn draw(&self, way: &Way, camera: &Camera) -> Result<()> {
        let Projection::Perspective { fov_y } = camera.projection else {
            return Err("the overview is a perspective view".into());
        };
        let [width, height] = SIZE_PX.map(|side| side as f32);
        let per_unit = 1.0 / (0.5 * fov_y).tan() as f32;
        let view: [f32; 6] =
            [per_unit * height / width, per_unit, SPLAT_PX / width, SPLAT_PX / height, 1e-3, 0.0];
        let uniform = self.buffer(bytemuck::cast_slice(&view), wgpu::BufferUsages::UNIFORM);
        let pipeline = match way.indices {
            Some(_) => &self.by_vertex,
            None => &self.by_instance,
        };
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform.as_entire_binding() }],
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: None,
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &self.color,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                    view: &self.depth,
                    depth_ops: Some(wgpu::Operations {
                        load: wgpu::LoadOp::Clear(0.0),
                        store: wgpu::StoreOp::Store,
                    }),
                    stencil_ops: None,
                }),
                ..Default::default()
            });
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.set_vertex_buffer(0, way.vertices.slice(..));
            match &way.indices {
                None => pass.draw(0..4, 0..way.points as u32),
                Some(indices) => {
                    pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint16);
                    for first in (0..way.points).step_by(QUADS_PER_DRAW) {
                        let quads = QUADS_PER_DRAW.min(way.points - first);
                        pass.draw_indexed(0..6 * quads as u32, 4 * first as i32, 0..1);
                    }
                }
            }
        }
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(())
    }
}
