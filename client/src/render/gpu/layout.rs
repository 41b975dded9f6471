//! What the shaders read, byte for byte. WGSL twins: `Camera` in `shaders/camera.wgsl`, `Node` and
//! `Chunk` in `shaders/node.wgsl`.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use crate::render::view::{NodeView, View};

/// Points of a chunk, which is one instance of a draw call. Large enough that few instances are
/// drawn, small enough that the unused rest of a node's last chunk (on average half of one) costs
/// little beside a node's thousands of points; a multiple of 32, so that every chunk of records
/// starts at a word whatever the bits of a record.
pub const CHUNK_POINTS: usize = 256;

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct CameraUniform {
    half_size_px: [f32; 2],
    px_per_world: f32,
    perspective: f32,
    near: f32,
    depth_bias: f32,
    size_px: f32,
    size_world_px: f32,
    smallest_size_px: f32,
    largest_size_px: f32,
    padding: [f32; 2],
}

impl CameraUniform {
    pub fn new(view: &View) -> Self {
        Self {
            half_size_px: view.half_size_px.as_vec2().to_array(),
            px_per_world: view.px_per_world as f32,
            perspective: if view.perspective { 1.0 } else { 0.0 },
            near: view.near as f32,
            depth_bias: view.depth_bias as f32,
            size_px: view.size_px as f32,
            size_world_px: 0.0,
            smallest_size_px: view.smallest_size_px as f32,
            largest_size_px: view.largest_size_px as f32,
            padding: [0.0; 2],
        }
    }
}

#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct NodeUniform {
    pub anchor_view: [f32; 3],
    pub record_bits: u32,
    pub step_x: [f32; 3],
    pub color: u32,
    pub step_y: [f32; 3],
    pub elevation: f32,
    pub step_z: [f32; 3],
    pub elevation_step: f32,
    pub anchor: [u32; 3],
    pub padding: u32,
}

impl NodeUniform {
    /// The place of a node whose lattice, relative to the anchor, is `node`.
    pub fn new(node: &NodeView, anchor: [u32; 3], record_bits: u32) -> Self {
        let vector = |v: DVec3| -> [f32; 3] { Vec3::to_array(&v.as_vec3()) };
        Self {
            anchor_view: vector(node.origin),
            record_bits,
            step_x: vector(node.step.x_axis),
            color: 0,
            step_y: vector(node.step.y_axis),
            elevation: 0.0,
            step_z: vector(node.step.z_axis),
            elevation_step: 0.0,
            anchor,
            padding: 0,
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

const _: () = assert!(size_of::<CameraUniform>() == 48);
const _: () = assert!(size_of::<NodeUniform>() == 80);
const _: () = assert!(size_of::<ChunkEntry>() == 12);
const _: () = assert!(CHUNK_POINTS.is_multiple_of(32));

/// Colour as the shaders unpack it: red in the lowest byte.
pub fn packed_color([r, g, b]: [u8; 3]) -> u32 {
    u32::from_le_bytes([r, g, b, 255])
}
