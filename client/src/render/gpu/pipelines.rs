//! Pipelines, made when they are first needed: nothing is compiled that no view asks for.

use std::collections::{HashMap, hash_map::Entry};

use lodestream_protocol::Manifest;
use lodestream_shaders::{
    Blending, ColorSource, Footprint, Mesh, Phong, Pixels, ShapeField, SizeSource, Splatting,
};

use super::plan::splatting;
use crate::render::{Coloring, RenderSettings, settings::phong};

/// Colours as they are coded, so that a byte in is the same byte out.
pub const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Reversed depth needs floats: they are dense around 0, where the far distances are.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

const LIGHT: Phong = Phong {
    ambient: phong::AMBIENT,
    diffuse: phong::DIFFUSE,
    specular: phong::SPECULAR,
    shininess: phong::SHININESS,
    to_light: phong::TO_LIGHT,
};

/// A render pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Drawing {
    /// Splats: the nearest are seen.
    Splats(Splatting),
    /// Splats, depth only: what blended ones are compared with.
    Nearest(Splatting),
    /// Splats, summed up where they are near enough.
    Sums(Splatting),
    /// Sums over their weights.
    Normalised,
    /// What the compute path found.
    Resolve(Splatting),
    /// Counts as a heat map.
    Density,
    /// Eye-dome lighting.
    EyeDome,
}

/// A compute pipeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Computing {
    /// The nearest point of every pixel.
    Nearest(Splatting),
    /// The points of every pixel, counted.
    Count(Splatting),
    /// The greatest count.
    Most,
}

/// All pipelines and what they are bound to.
pub struct Pipelines {
    /// Group 0: camera, nodes, chunks, ramps, visible tree.
    pub frame_layout: wgpu::BindGroupLayout,
    /// Group 1: a page of nodes.
    pub page_layout: wgpu::BindGroupLayout,
    /// Group 2: a run of chunks; pixels, written.
    pub offer_layout: wgpu::BindGroupLayout,
    /// Group 2: a run of chunks; pixels, read.
    pub found_layout: wgpu::BindGroupLayout,
    /// Group 0 of sums.
    pub sums_layout: wgpu::BindGroupLayout,
    /// Group 0 of eye-dome lighting: settings, colours, depths.
    pub eye_dome_layout: wgpu::BindGroupLayout,
    /// Group 1 of the heat map: size, depths, counts, the most.
    pub density_layout: wgpu::BindGroupLayout,
    /// The same for finding the most.
    pub most_layout: wgpu::BindGroupLayout,
    pixels: Pixels,
    sums_format: wgpu::TextureFormat,
    drawing: HashMap<Drawing, wgpu::RenderPipeline>,
    computing: HashMap<Computing, wgpu::ComputePipeline>,
    indices: HashMap<Footprint, Indices>,
}

/// Indices of the triangles of all splats of a chunk.
pub struct Indices {
    pub buffer: wgpu::Buffer,
    pub count: u32,
}

const ALL_STAGES: wgpu::ShaderStages =
    wgpu::ShaderStages::VERTEX_FRAGMENT.union(wgpu::ShaderStages::COMPUTE);

fn entry(
    binding: u32,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BindingType,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
}

fn buffer(ty: wgpu::BufferBindingType) -> wgpu::BindingType {
    wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None }
}

const UNIFORM: wgpu::BufferBindingType = wgpu::BufferBindingType::Uniform;
const READ: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: true };
const WRITE: wgpu::BufferBindingType = wgpu::BufferBindingType::Storage { read_only: false };

impl Pipelines {
    pub fn new(device: &wgpu::Device, pixels: Pixels, sums_format: wgpu::TextureFormat) -> Self {
        let layout = |label, entries: &[wgpu::BindGroupLayoutEntry]| {
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(label),
                entries,
            })
        };
        let (fragment, compute) = (wgpu::ShaderStages::FRAGMENT, wgpu::ShaderStages::COMPUTE);
        let run = wgpu::BindingType::Buffer {
            ty: UNIFORM,
            has_dynamic_offset: true,
            min_binding_size: None,
        };
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let colors = texture(wgpu::TextureSampleType::Float { filterable: false });
        let all = ALL_STAGES;
        Self {
            frame_layout: layout(
                "frame",
                &[
                    entry(0, all, buffer(UNIFORM)),
                    entry(1, all, buffer(READ)),
                    entry(2, all, buffer(READ)),
                    entry(3, all, buffer(READ)),
                    entry(4, all, buffer(READ)),
                ],
            ),
            page_layout: layout("page of nodes", &[entry(0, all, buffer(READ))]),
            offer_layout: layout(
                "pixels to find",
                &[
                    entry(0, compute, run),
                    entry(1, compute, buffer(WRITE)),
                    entry(2, compute, buffer(WRITE)),
                ],
            ),
            found_layout: layout(
                "pixels found",
                &[
                    entry(0, fragment, run),
                    entry(1, fragment, buffer(READ)),
                    entry(2, fragment, buffer(READ)),
                ],
            ),
            sums_layout: layout("sums", &[entry(0, fragment, colors)]),
            eye_dome_layout: layout(
                "eye dome",
                &[
                    entry(0, fragment, buffer(UNIFORM)),
                    entry(1, fragment, colors),
                    entry(2, fragment, texture(wgpu::TextureSampleType::Depth)),
                ],
            ),
            density_layout: layout(
                "density",
                &[
                    entry(0, fragment, buffer(UNIFORM)),
                    entry(1, fragment, buffer(READ)),
                    entry(2, fragment, buffer(READ)),
                    entry(3, fragment, buffer(READ)),
                ],
            ),
            most_layout: layout(
                "most",
                &[
                    entry(0, compute, buffer(UNIFORM)),
                    entry(2, compute, buffer(READ)),
                    entry(3, compute, buffer(WRITE)),
                ],
            ),
            pixels,
            sums_format,
            drawing: HashMap::new(),
            computing: HashMap::new(),
            indices: HashMap::new(),
        }
    }

    /// The pipeline, made if it is not there yet.
    pub fn drawing(&mut self, device: &wgpu::Device, key: Drawing) -> &wgpu::RenderPipeline {
        if !self.drawing.contains_key(&key) {
            let made = self.make_drawing(device, key);
            self.drawing.insert(key, made);
        }
        &self.drawing[&key]
    }

    /// The pipeline, made if it is not there yet.
    pub fn computing(&mut self, device: &wgpu::Device, key: Computing) -> &wgpu::ComputePipeline {
        if !self.computing.contains_key(&key) {
            let made = self.make_computing(device, key);
            self.computing.insert(key, made);
        }
        &self.computing[&key]
    }

    /// The indices of a footprint that is drawn with indices, made if they are not there yet.
    pub fn indices(&mut self, device: &wgpu::Device, footprint: Footprint) -> Option<&Indices> {
        match self.indices.entry(footprint) {
            Entry::Occupied(there) => Some(there.into_mut()),
            Entry::Vacant(none) => Some(none.insert(make_indices(device, footprint)?)),
        }
    }

    fn make_computing(&self, device: &wgpu::Device, key: Computing) -> wgpu::ComputePipeline {
        let (source, entry_point) = match key {
            Computing::Nearest(splatting) => (splatting.compute(self.pixels, &LIGHT), "rasterise"),
            Computing::Count(splatting) => (splatting.count(&LIGHT), "rasterise"),
            Computing::Most => (lodestream_shaders::most(), "find_most"),
        };
        let groups = match key {
            Computing::Most => vec![None, Some(&self.most_layout)],
            _ => {
                vec![Some(&self.frame_layout), Some(&self.page_layout), Some(&self.offer_layout)]
            }
        };
        let label = format!("{key:?}");
        device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(&label),
            layout: Some(&pipeline_layout(device, &label, &groups)),
            module: &module(device, &label, source),
            entry_point: Some(entry_point),
            compilation_options: Default::default(),
            cache: None,
        })
    }

    fn make_drawing(&self, device: &wgpu::Device, key: Drawing) -> wgpu::RenderPipeline {
        let label = format!("{key:?}");
        let source = match key {
            Drawing::Splats(splatting) | Drawing::Nearest(splatting) => {
                splatting.raster(Blending::Nearest, &LIGHT)
            }
            Drawing::Sums(splatting) => splatting.raster(Blending::Weighted, &LIGHT),
            Drawing::Resolve(splatting) => splatting.resolve(self.pixels, &LIGHT),
            Drawing::Normalised => lodestream_shaders::normalised(),
            Drawing::Density => lodestream_shaders::density(),
            Drawing::EyeDome => lodestream_shaders::eye_dome(),
        };
        let frame = Some(&self.frame_layout);
        let page = Some(&self.page_layout);
        let groups = match key {
            Drawing::Splats(_) | Drawing::Nearest(_) | Drawing::Sums(_) => vec![frame, page],
            Drawing::Resolve(_) => vec![frame, page, Some(&self.found_layout)],
            Drawing::Normalised => vec![Some(&self.sums_layout)],
            Drawing::Density => vec![frame, Some(&self.density_layout)],
            Drawing::EyeDome => vec![Some(&self.eye_dome_layout)],
        };
        let topology = match key {
            Drawing::Splats(s) if s.footprint == Footprint::Point => {
                wgpu::PrimitiveTopology::PointList
            }
            _ => wgpu::PrimitiveTopology::TriangleList,
        };
        let (targets, write, compare) = self.outputs(key);
        let vertex = match key {
            Drawing::Splats(_) | Drawing::Nearest(_) | Drawing::Sums(_) => "vertex",
            _ => "full",
        };
        let module = module(device, &label, source);
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(&label),
            layout: Some(&pipeline_layout(device, &label, &groups)),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(vertex),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState { topology, ..Default::default() },
            depth_stencil: compare.map(|compare| wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(write),
                depth_compare: Some(compare),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    /// Colour targets; whether depth is written; how it is compared, where it is.
    fn outputs(
        &self,
        key: Drawing,
    ) -> (Vec<Option<wgpu::ColorTargetState>>, bool, Option<wgpu::CompareFunction>) {
        let color = || vec![Some(COLOR_FORMAT.into())];
        // Reversed: nearer is greater. Not GreaterEqual: of equals, the first drawn stays.
        let nearer = Some(wgpu::CompareFunction::Greater);
        match key {
            Drawing::Splats(_) => (color(), true, nearer),
            Drawing::Nearest(_) => (Vec::new(), true, nearer),
            Drawing::Sums(_) => {
                let add = wgpu::BlendComponent {
                    src_factor: wgpu::BlendFactor::One,
                    dst_factor: wgpu::BlendFactor::One,
                    operation: wgpu::BlendOperation::Add,
                };
                let target = wgpu::ColorTargetState {
                    format: self.sums_format,
                    blend: Some(wgpu::BlendState { color: add, alpha: add }),
                    write_mask: wgpu::ColorWrites::ALL,
                };
                (vec![Some(target)], false, Some(wgpu::CompareFunction::GreaterEqual))
            }
            Drawing::Resolve(_) | Drawing::Density => {
                (color(), true, Some(wgpu::CompareFunction::Always))
            }
            Drawing::Normalised | Drawing::EyeDome => (color(), false, None),
        }
    }
}

fn module(device: &wgpu::Device, label: &str, source: String) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source.into()),
    })
}

fn pipeline_layout(
    device: &wgpu::Device,
    label: &str,
    groups: &[Option<&wgpu::BindGroupLayout>],
) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: groups,
        immediate_size: 0,
    })
}

/// Indices for all splats of a chunk; `None` where splats are drawn without.
fn make_indices(device: &wgpu::Device, footprint: Footprint) -> Option<Indices> {
    let (vertices, triangles) = match footprint {
        Footprint::Square | Footprint::Disc | Footprint::Ellipse => (4, vec![[0, 1, 2], [2, 1, 3]]),
        Footprint::Point | Footprint::Circle | Footprint::Cone | Footprint::Paraboloid => {
            return None;
        }
        _ => {
            let mesh = Mesh::of(footprint)?;
            (mesh.vertices.len(), mesh.triangles)
        }
    };
    let splats = (0..lodestream_shaders::CHUNK_POINTS).map(|splat| splat * vertices);
    let of_splat = |first: usize| triangles.iter().flatten().map(move |i| first + usize::from(*i));
    // A chunk of the largest mesh has 256 x 33 vertices.
    let indices: Vec<u16> = splats.flat_map(of_splat).map(|i| i as u16).collect();
    let bytes: &[u8] = bytemuck::cast_slice(&indices);
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("triangles of splats"),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::INDEX,
        mapped_at_creation: true,
    });
    if let Ok(mut mapped) = buffer.slice(..).get_mapped_range_mut() {
        mapped.copy_from_slice(bytes);
    }
    buffer.unmap();
    Some(Indices { buffer, count: indices.len() as u32 })
}

/// Bytes of WGSL that draw a cloud by the rasteriser, and that would draw one that has and shows
/// everything.
pub fn shader_bytes(settings: &RenderSettings, cloud: &Manifest) -> [u64; 2] {
    let color = match Coloring::of(settings.color, cloud) {
        Coloring::Rgb { .. } => ColorSource::Rgb,
        Coloring::Intensity { .. } => ColorSource::Intensity,
        Coloring::Classification { .. } => ColorSource::Class,
        Coloring::Normal => ColorSource::Normal,
        Coloring::Elevation => ColorSource::Elevation,
        Coloring::Level | Coloring::Density | Coloring::Constant(_) => ColorSource::Node,
    };
    let needed = splatting(settings, cloud, color);
    let everything = Splatting {
        color: ColorSource::Intensity,
        size: SizeSource::Adaptive,
        normals: true,
        shape: ShapeField::Axes,
        phong: true,
        ..needed
    };
    [needed, everything].map(|way| way.raster(Blending::Nearest, &LIGHT).len() as u64)
}
