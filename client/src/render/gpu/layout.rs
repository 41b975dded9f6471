//! What the shaders read, byte for byte. WGSL twins: `Camera` in `shaders/camera.wgsl`, `Node` and
//! `Chunk` in `shaders/node.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use lodestream_shaders::CHUNK_POINTS;

use crate::render::{
    EyeDome,
    view::{NodeView, View},
};

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CameraUniform {
    half_size_px: [f32; 2],
    px_per_world: f32,
    perspective: f32,
    near: f32,
    depth_bias: f32,
    size_px: f32,
    smallest_size_px: f32,
    largest_size_px: f32,
    size_factor: f32,
    padding: [f32; 2],
    rotation: [[f32; 4]; 3],
}

impl CameraUniform {
    /// `size_factor`: times the spacing, for sizes that adapt to it.
    pub fn new(view: &View, size_factor: f64) -> Self {
        let rotated = |axis| view.direction(axis).as_vec3().extend(0.0).to_array();
        Self {
            half_size_px: view.half_size_px.as_vec2().to_array(),
            px_per_world: view.px_per_world as f32,
            perspective: if view.perspective { 1.0 } else { 0.0 },
            near: view.near as f32,
            depth_bias: view.depth_bias as f32,
            size_px: view.size_px as f32,
            smallest_size_px: view.smallest_size_px as f32,
            largest_size_px: view.largest_size_px as f32,
            size_factor: size_factor as f32,
            padding: [0.0; 2],
            rotation: [DVec3::X, DVec3::Y, DVec3::Z].map(rotated),
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NodeUniform {
    pub anchor_view: [f32; 3],
    pub position_bits: u32,
    pub step_x: [f32; 3],
    pub color: u32,
    pub step_y: [f32; 3],
    pub elevation: f32,
    pub step_z: [f32; 3],
    pub elevation_step: f32,
    pub anchor: [u32; 3],
    pub size_world: f32,
    pub corner: [u32; 3],
    pub side_bits: u32,
    pub tree_place: u32,
    pub shape_unit: f32,
    pub padding: [u32; 2],
}

impl NodeUniform {
    /// The place of a node whose lattice, relative to the anchor, is `node`.
    pub fn new(node: &NodeView, anchor: [u32; 3], position_bits: u32) -> Self {
        let vector = |v: DVec3| -> [f32; 3] { Vec3::to_array(&v.as_vec3()) };
        Self {
            anchor_view: vector(node.origin),
            position_bits,
            step_x: vector(node.step.x_axis),
            step_y: vector(node.step.y_axis),
            step_z: vector(node.step.z_axis),
            anchor,
            ..Self::zeroed()
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct ChunkEntry {
    pub node: u32,
    pub first_word: u32,
    pub points: u32,
}

/// A run of chunks, for the compute path. WGSL twin: `Run` in `shaders/compute.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct RunUniform {
    pub first: u32,
    pub end: u32,
    pub row: u32,
    pub pass_index: u32,
}

/// WGSL twin: `EyeDome` in `shaders/eye_dome.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct EyeDomeUniform {
    near: f32,
    px_per_world: f32,
    perspective: f32,
    shade: f32,
    steepest: f32,
    padding: f32,
    size_px: [i32; 2],
    neighbours: [[i32; 2]; 8],
}

impl EyeDomeUniform {
    pub fn new(view: &View, size_px: [u32; 2], dome: &EyeDome) -> Self {
        Self {
            near: view.near as f32,
            px_per_world: view.px_per_world as f32,
            perspective: if view.perspective { 1.0 } else { 0.0 },
            shade: (-dome.strength / 8.0 / dome.radius_px) as f32,
            steepest: (EyeDome::STEEPEST * dome.radius_px) as f32,
            padding: 0.0,
            // Pictures are far smaller than 2^31 pixels a side.
            size_px: size_px.map(|side| side as i32),
            neighbours: dome.neighbours(1),
        }
    }
}

const _: () = assert!(size_of::<CameraUniform>() == 96);
const _: () = assert!(size_of::<NodeUniform>() == 112);
const _: () = assert!(size_of::<ChunkEntry>() == 12);
const _: () = assert!(size_of::<EyeDomeUniform>() == 96);
const _: () = assert!(CHUNK_POINTS.is_multiple_of(32));

/// Colour as the shaders unpack it: red in the lowest byte.
pub fn packed_color([r, g, b]: [u8; 3]) -> u32 {
    u32::from_le_bytes([r, g, b, 255])
}
