//! What the points of a picture have in common, and what those of a node have.

use std::{ops::Range, sync::Arc};

use glam::DVec3;
use lodestream_protocol::Manifest;
use lodestream_shaders::Footprint as Kind;

use super::{
    footprint::{
        Cone, Dot, Facing, Flat, Footprint, Fragment, Grid, Mesh, Oriented, Paraboloid, Spot,
        Square,
    },
    paint::{Light, NodePaint},
};
use crate::{
    engine::DrawNode,
    render::{
        CloudColors, ColorMode, RenderSettings, VisibleTree,
        color::NodeColor,
        scene::Surroundings,
        size::NodeSize,
        surface::NodeSurface,
        view::{NodeView, View},
    },
};

/// All that a picture is made by, but for its nodes.
pub(super) struct Stage {
    pub settings: RenderSettings,
    /// Along a side of a pixel.
    pub samples: u32,
    pub view: View,
    pub clouds: Vec<Arc<Manifest>>,
    /// Per cloud, where they are not those of the settings.
    colors: Vec<Option<ColorMode>>,
    around: Surroundings,
    tree: VisibleTree,
    mesh: Mesh,
}

impl Stage {
    /// Of checked settings.
    pub fn new(
        settings: RenderSettings,
        samples: u32,
        clouds: &[Arc<Manifest>],
        tree: VisibleTree,
    ) -> Self {
        let around = Surroundings::of(clouds, |_| settings.color);
        let view = View::new(&settings, samples, around.farthest(settings.camera.eye));
        let mesh = Mesh::new(settings.splat.footprint().rings(), &view);
        let (clouds, colors) = (clouds.to_vec(), Vec::new());
        Self { settings, samples, view, clouds, colors, around, tree, mesh }
    }

    /// Colours each cloud by its own mode.
    pub fn set_colors(&mut self, colors: CloudColors) {
        self.around = Surroundings::of(&self.clouds, |cloud| colors.mode(cloud, &self.settings));
        self.colors = colors.0.to_vec();
    }

    /// Columns and rows of samples.
    pub fn grid(&self) -> Grid {
        let [width, height] = self.settings.size_px.map(|side| (side * self.samples) as usize);
        Grid { width, height }
    }

    /// The colours of a node's points.
    pub fn paint<'a>(&'a self, node: &'a DrawNode) -> NodePaint<'a> {
        let cloud = &self.clouds[node.cloud];
        let settings = self.settings_of(node.cloud);
        let surface = NodeSurface::of(&settings, cloud, &node.points);
        let color = NodeColor::of(&self.around, node.cloud, &cloud.lattice, &node.points, &surface);
        let light = self.settings.shading.phong.then(|| Light {
            view: &self.view,
            node: self.node_view(node),
            surface,
        });
        NodePaint { color, light, positions: &node.points.positions }
    }

    /// Draws a run of a node's points: `take` is called with the number of a point within the node
    /// and with a part of its splat.
    pub fn draw(
        &self,
        node: &DrawNode,
        run: Range<usize>,
        grid: Grid,
        take: impl FnMut(usize, Fragment),
    ) {
        let cloud = &self.clouds[node.cloud];
        let settings = self.settings_of(node.cloud);
        let surface = NodeSurface::of(&settings, cloud, &node.points);
        let bits = cloud.lattice.node_bits(node.key.level());
        let place = self.tree.place(node.cloud, node.key).unwrap_or(u32::MAX);
        let (size, spacing) = (self.settings.splat_size, node.spacing);
        let size = NodeSize::of(size, spacing, &self.tree, place, bits, &surface);
        let strokes = Strokes {
            view: &self.view,
            node: self.node_view(node),
            size,
            positions: &node.points.positions,
            run,
            grid,
        };
        match self.settings.splat.footprint() {
            Kind::Point if self.samples == 1 => strokes.draw(&Dot, take),
            // Of a pixel's size, which is several samples.
            Kind::Point | Kind::Square => strokes.draw(&Square, take),
            Kind::Circle => strokes.draw(&Facing(Flat), take),
            Kind::Cone => strokes.draw(&Facing(Cone), take),
            Kind::Paraboloid => strokes.draw(&Facing(Paraboloid), take),
            Kind::Paraboloid8 | Kind::Paraboloid16 | Kind::Paraboloid32 | Kind::Paraboloid48 => {
                strokes.draw(&&self.mesh, take)
            }
            kind @ (Kind::Disc | Kind::Ellipse) => {
                let has_axes = kind == Kind::Ellipse;
                let oriented = Oriented::new(&self.view, &surface, has_axes, self.samples);
                strokes.draw(&oriented, take);
            }
        }
    }

    fn settings_of(&self, cloud: usize) -> RenderSettings {
        CloudColors(&self.colors).settings(cloud, &self.settings)
    }

    fn node_view(&self, node: &DrawNode) -> NodeView {
        self.view.node(&self.clouds[node.cloud].lattice, node.key, [0; 3])
    }
}

/// Where a point of a node is in view space.
#[inline]
pub(super) fn place(node: &NodeView, q: [u32; 3]) -> DVec3 {
    node.origin + node.step * DVec3::from_array(q.map(f64::from))
}

/// Points that are projected before the first of them is drawn. Two small loops take a tenth less
/// time than one that does both.
const BLOCK_POINTS: usize = 64;

/// A run of points of a node, about to be drawn.
struct Strokes<'a> {
    view: &'a View,
    node: NodeView,
    size: NodeSize<'a>,
    positions: &'a [[u32; 3]],
    run: Range<usize>,
    grid: Grid,
}

impl Strokes<'_> {
    fn draw<F: Footprint>(self, footprint: &F, mut take: impl FnMut(usize, Fragment)) {
        let Self { view, node, size, positions, run, grid } = self;
        let mut projected = [None; BLOCK_POINTS];
        for block in run.clone().step_by(BLOCK_POINTS) {
            let positions = &positions[block..run.end.min(block + BLOCK_POINTS)];
            for (projected, q) in projected.iter_mut().zip(positions) {
                let place = place(&node, *q);
                *projected = view.project(place).map(|at| (place, at));
            }
            for ((projected, q), index) in projected.iter().zip(positions).zip(block..) {
                let Some((place, at)) = *projected else { continue };
                let size_px = if F::SIZED { view.size(&at, size.world(index, *q)) } else { 1.0 };
                let spot = Spot { index, place, at, radius_px: 0.5 * size_px };
                footprint.cover(&spot, grid, |fragment| take(index, fragment));
            }
        }
    }
}
