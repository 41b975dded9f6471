//! What a frame draws, in drawing order: one record per node, one per chunk, and runs of chunks that
//! are drawn with one call each.

use glam::Vec3;
use lodestream_protocol::Manifest;
use lodestream_shaders::{CHUNK_POINTS, ColorSource, ShapeField, SizeSource, Splatting};

use super::{
    device::Device,
    layout::{ChunkEntry, NodeUniform, packed_color},
    pack::{RecordFields, RecordLayout},
    pool::{Found, Pool},
};
use crate::{
    engine::DrawNode,
    render::{
        CloudColors, ColorMode, RenderSettings, Scene, Splat, SplatSize, VisibleTree,
        color::NodeColor,
        scene::Surroundings,
        settings::CLOSED_SURFACE,
        surface::{NodeSurface, SurfaceParts},
        view::View,
    },
};

/// Consecutive chunks of a frame that one call draws.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    pub splatting: Splatting,
    pub page: usize,
    pub chunks: std::ops::Range<u32>,
}

/// What a frame draws.
#[derive(Default)]
pub struct Plan {
    pub nodes: Vec<NodeUniform>,
    pub chunks: Vec<ChunkEntry>,
    pub runs: Vec<Run>,
    /// Nodes that wait for a later frame.
    pub waiting_nodes: u64,
    /// Points in the nodes that are drawn.
    pub points: u64,
    /// About the size of the largest splat.
    pub largest_px: f64,
}

/// What all nodes of a frame share.
pub struct Frame<'a> {
    pub colors: CloudColors<'a>,
    pub scene: &'a Scene<'a>,
    pub settings: &'a RenderSettings,
    pub around: &'a Surroundings,
    pub tree: &'a VisibleTree,
    pub view: &'a View,
}

impl Frame<'_> {
    /// Times the spacing, for sizes that adapt to it.
    pub const fn size_factor(&self) -> f64 {
        match self.settings.splat_size {
            SplatSize::Adaptive(factor) => factor,
            _ => CLOSED_SURFACE,
        }
    }

    /// About the size of the largest splat of a node, of whose points none is nearer than its anchor.
    fn largest_px(&self, node: &NodeUniform, spacing: f32) -> f64 {
        let world = match self.settings.splat_size {
            SplatSize::Pixels(_) => 0.0,
            SplatSize::World(size) => size,
            SplatSize::Level(factor) | SplatSize::Adaptive(factor) => factor * f64::from(spacing),
            SplatSize::Own if node.shape_unit > 0.0 => 2.0 * f64::from(node.shape_unit),
            SplatSize::Own => CLOSED_SURFACE * f64::from(spacing),
        };
        let distance = f64::from(Vec3::from(node.anchor_view).length()).max(self.view.near);
        let w = if self.view.perspective { distance } else { 1.0 };
        let px = self.view.size_px + world * self.view.px_per_world / w;
        px.clamp(self.view.smallest_size_px, self.view.largest_size_px)
    }

    /// How the nodes of a cloud are drawn whose colours are `colors`.
    fn splatting(&self, cloud: usize, colors: &NodeColor) -> Splatting {
        let color = match colors {
            NodeColor::Rgb { .. } => ColorSource::Rgb,
            NodeColor::Intensity { .. } => ColorSource::Intensity,
            NodeColor::Class { .. } => ColorSource::Class,
            NodeColor::Normal(_) => ColorSource::Normal,
            NodeColor::Elevation { .. } => ColorSource::Elevation,
            NodeColor::Constant(_) => ColorSource::Node,
        };
        let settings = self.colors.settings(cloud, self.settings);
        splatting(&settings, &self.scene.clouds[cloud], color)
    }
}

/// How a cloud is drawn whose colours come from `color`.
pub fn splatting(settings: &RenderSettings, cloud: &Manifest, color: ColorSource) -> Splatting {
    let parts = SurfaceParts::of(settings, cloud);
    let shape = match parts {
        SurfaceParts { axes: true, .. } => ShapeField::Axes,
        SurfaceParts { radii: true, .. } => ShapeField::Radius,
        _ => ShapeField::None,
    };
    let counted = settings.color == ColorMode::Density;
    let footprint = if counted { Splat::Point } else { settings.splat }.footprint();
    let size = match (settings.splat_size, shape) {
        // A point has no size to look up.
        _ if footprint == Splat::Point.footprint() => SizeSource::Node,
        (SplatSize::Own, ShapeField::None) | (SplatSize::Adaptive(_), _) => SizeSource::Adaptive,
        (SplatSize::Own, _) => SizeSource::Record,
        _ => SizeSource::Node,
    };
    let phong = settings.shading.phong && !counted;
    Splatting { footprint, color, size, normals: parts.normals, shape, phong }
}

impl Plan {
    /// Uploads a node where needed and appends it.
    pub fn add(&mut self, device: &Device, pool: &mut Pool, frame: &Frame, node: &DrawNode) {
        let points = node.points.as_ref();
        if points.positions.is_empty() {
            return;
        }
        let Frame { scene, around, tree, view, colors, settings } = frame;
        let settings = &colors.settings(node.cloud, settings);
        let cloud = &scene.clouds[node.cloud];
        let lattice = &cloud.lattice;
        let surface = NodeSurface::of(settings, cloud, points);
        let colors = NodeColor::of(around, node.cloud, lattice, points, &surface);
        let splatting = frame.splatting(node.cloud, &colors);
        let Splatting { color, normals, shape, .. } = splatting;
        // What takes no payload shares its records.
        let payload = if color.payload_bits() == 0 { ColorSource::Node } else { color };
        let fields = RecordFields { color: payload, normals, shape };
        let found = pool.node(device, cloud, node, fields, &colors, &surface);
        self.waiting_nodes += u64::from(found.as_ref().is_none_or(|found| found.is_waiting));
        let Some(Found { resident, .. }) = found else { return };
        self.points += points.positions.len() as u64;

        let RecordLayout { min, max, shape_unit, .. } = resident.layout;
        // The lattice point of the node's box nearest to the eye.
        let eye = view.eye_in_node(lattice, points.key);
        let nearest = |axis: usize| {
            let eye = eye[axis].round().clamp(f64::from(min[axis]), f64::from(max[axis]));
            eye as u32
        };
        let anchor: [u32; 3] = std::array::from_fn(nearest);
        let node_view = view.node(lattice, points.key, anchor);
        let relative = std::array::from_fn(|axis| anchor[axis] - min[axis]);
        let place = NodeUniform::new(&node_view, relative, resident.layout.position_bits());
        let mut uniform = NodeUniform {
            size_world: match settings.splat_size {
                SplatSize::World(size) => size as f32,
                SplatSize::Level(factor) => (factor * f64::from(node.spacing)) as f32,
                SplatSize::Pixels(_) | SplatSize::Adaptive(_) | SplatSize::Own => 0.0,
            },
            corner: min,
            side_bits: u32::from(lattice.node_bits(points.key.level())),
            tree_place: tree.place(node.cloud, points.key).unwrap_or(0),
            shape_unit,
            color: packed_color(crate::render::color::NEUTRAL),
            ..place
        };
        self.largest_px = self.largest_px.max(frame.largest_px(&uniform, node.spacing));
        match colors {
            NodeColor::Constant(color) => uniform.color = packed_color(color),
            NodeColor::Elevation { at_corner, per_unit } => {
                uniform.elevation = (at_corner + per_unit * f64::from(min[2])) as f32;
                uniform.elevation_step = per_unit as f32;
            }
            _ => {}
        }
        // The plan of a frame is far below 2^32 nodes and chunks: points are counted in memory.
        let index = self.nodes.len() as u32;
        self.nodes.push(uniform);
        let chunk_words = resident.layout.chunk_words() as u32;
        for piece in &resident.pieces {
            let first = self.chunks.len() as u32;
            let starts = (0..piece.points).step_by(CHUNK_POINTS);
            self.chunks.extend(starts.zip(0..).map(|(start, chunk)| ChunkEntry {
                node: index,
                first_word: piece.first_word + chunk * chunk_words,
                points: (piece.points - start).min(CHUNK_POINTS as u32),
            }));
            let end = self.chunks.len() as u32;
            match self.runs.last_mut() {
                Some(run) if run.splatting == splatting && run.page == piece.page => {
                    run.chunks.end = end;
                }
                _ => self.runs.push(Run { splatting, page: piece.page, chunks: first..end }),
            }
        }
    }
}
