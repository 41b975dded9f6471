//! Render pipelines, one per footprint and source of colour, made when they are first needed.

use std::collections::HashMap;

use lodestream_shaders::{ColorSource, Footprint};

use super::layout::CHUNK_POINTS;

/// Colours as they are coded, so that a byte in is the same byte out.
pub const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Reversed depth needs floats: they are dense around 0, where the far distances are.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// What the shaders of a frame are bound to.
pub struct Pipelines {
    /// Group 0: camera, nodes, chunks, ramps.
    pub frame_layout: wgpu::BindGroupLayout,
    /// Group 1: a page of nodes.
    pub page_layout: wgpu::BindGroupLayout,
    layout: wgpu::PipelineLayout,
    made: HashMap<(Footprint, ColorSource), wgpu::RenderPipeline>,
}

impl Pipelines {
    pub fn new(device: &wgpu::Device) -> Self {
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::VERTEX,
            ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
            count: None,
        };
        let storage = wgpu::BufferBindingType::Storage { read_only: true };
        let frame_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("frame"),
            entries: &[
                entry(0, wgpu::BufferBindingType::Uniform),
                entry(1, storage),
                entry(2, storage),
                entry(3, storage),
            ],
        });
        let page_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("page of nodes"),
            entries: &[entry(0, storage)],
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("splats"),
            bind_group_layouts: &[Some(&frame_layout), Some(&page_layout)],
            immediate_size: 0,
        });
        Self { frame_layout, page_layout, layout, made: HashMap::new() }
    }

    /// The pipeline, made if it is not there yet.
    pub fn make(&mut self, device: &wgpu::Device, key: (Footprint, ColorSource)) {
        let layout = &self.layout;
        self.made.entry(key).or_insert_with(|| make(device, layout, key));
    }

    /// The pipeline, where it was made.
    pub fn get(&self, key: (Footprint, ColorSource)) -> Option<&wgpu::RenderPipeline> {
        self.made.get(&key)
    }
}

fn make(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    (footprint, color): (Footprint, ColorSource),
) -> wgpu::RenderPipeline {
    let label = format!("{footprint:?} splats coloured by {color:?}");
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(&label),
        source: wgpu::ShaderSource::Wgsl(lodestream_shaders::splat(footprint, color).into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(&label),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: match footprint {
                Footprint::Point => wgpu::PrimitiveTopology::PointList,
                _ => wgpu::PrimitiveTopology::TriangleList,
            },
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            // Reversed: nearer is greater. Not GreaterEqual: of equals, the first drawn stays.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: Default::default(),
            targets: &[Some(COLOR_FORMAT.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// Indices of the two triangles of every quad of a chunk: vertex `4 * point + corner`.
pub fn quad_indices() -> Vec<u16> {
    const { assert!(CHUNK_POINTS * 4 <= 1 << 16) };
    let quads = (0..CHUNK_POINTS).map(|point| 4 * point as u16);
    quads.flat_map(|first| [0, 1, 2, 2, 1, 3].map(|corner| first + corner)).collect()
}
