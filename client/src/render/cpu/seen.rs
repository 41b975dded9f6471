//! What is seen on a pixel, or near it: the same rules that draw pictures, asked the other way round.
//!
//! The depths of a picture tell where something is, but not what; and reading them back from a GPU
//! waits for it. Here the nodes whose splats can reach the place are drawn once more, into a window of
//! a few pixels. So the answer is exact for every splat, size and projection: a point of the dataset,
//! never a place between points.

use rayon::prelude::*;

use super::{TruthRenderer, footprint::Fragment, stage::Stage};
use crate::{
    engine::{Optics, View, WorldBox},
    render::{
        ColorMode, DrawNode, RenderError, RenderSettings, Scene, Splat, SplatSize,
        settings::CLOSED_SURFACE,
    },
};

/// A point that is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Index into the scene's nodes.
    pub node: usize,
    /// Which of the node's points.
    pub point: usize,
    /// Along the view direction, world units.
    pub distance: f64,
    /// How far beside the pixel that was asked about, squared.
    beside_squared: i64,
}

impl Seen {
    /// Whether it is to be taken instead of another.
    fn is_before(&self, other: &Self) -> bool {
        let order = |seen: &Self| (seen.beside_squared, seen.distance);
        let (own, other_key) = (order(self), order(other));
        own < other_key || (own == other_key && (self.node, self.point) < (other.node, other.point))
    }
}

/// The pixels around one.
#[derive(Debug, Clone, Copy)]
struct Window {
    at: [i64; 2],
    reach: i64,
    width: i64,
}

impl Window {
    /// Square of the distance of a pixel of the picture, if it is in the window.
    fn beside_squared(&self, pixel: usize) -> Option<(usize, i64)> {
        // Pictures have fewer than 2^63 pixels.
        let pixel = pixel as i64;
        let [x, y] = [pixel % self.width - self.at[0], pixel / self.width - self.at[1]];
        let inside = x.abs() <= self.reach && y.abs() <= self.reach;
        let side = 2 * self.reach + 1;
        inside.then(|| (((y + self.reach) * side + x + self.reach) as usize, x * x + y * y))
    }

    fn cells(&self) -> usize {
        let side = (2 * self.reach + 1) as usize;
        side * side
    }
}

impl super::CpuRenderer {
    /// The point that is seen on pixel `at` (column and row), or, where nothing is drawn there, on the
    /// nearest pixel at most `reach_px` columns and rows away.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the scene cannot be drawn.
    pub fn seen(
        &self,
        scene: &Scene,
        settings: &RenderSettings,
        at: [u32; 2],
        reach_px: u32,
    ) -> Result<Option<Seen>, RenderError> {
        settings.check()?;
        scene.ordered()?;
        let mut settings = *settings;
        if settings.color == ColorMode::Density {
            settings.splat = Splat::Point;
        }
        let stage = TruthRenderer::stage_of(&settings, scene);
        let window = Window {
            at: at.map(i64::from),
            reach: i64::from(reach_px.min(64)),
            width: i64::from(settings.size_px[0]),
        };
        let optics = Optics::new(&View { camera: settings.camera, size_px: settings.size_px });
        let nodes = scene.nodes.par_iter().enumerate();
        let seen = nodes.filter(|(_, node)| may_reach(&stage, &optics, &window, node)).map(
            |(index, node)| {
                let mut nearest = vec![None; window.cells()];
                let run = 0..node.points.positions.len();
                stage.draw(node, run, stage.grid(), |point, part: Fragment| {
                    let Some((cell, beside_squared)) = window.beside_squared(part.pixel) else {
                        return;
                    };
                    let distance = part.distance;
                    let found = Seen { node: index, point, distance, beside_squared };
                    if nearest[cell].is_none_or(|before| found.is_before(&before)) {
                        nearest[cell] = Some(found);
                    }
                });
                nearest
            },
        );
        // What is nearest on each pixel is seen there; then the pixel that is nearest counts.
        let seen = seen.reduce(
            || vec![None; window.cells()],
            |mut a, b| {
                for (a, b) in a.iter_mut().zip(b) {
                    let Some(found) = b else { continue };
                    if a.is_none_or(|before| found.is_before(&before)) {
                        *a = Some(found);
                    }
                }
                a
            },
        );
        Ok(seen.into_iter().flatten().reduce(|a, b| if b.is_before(&a) { b } else { a }))
    }
}

/// Whether a splat of the node may reach the window.
fn may_reach(stage: &Stage, optics: &Optics, window: &Window, node: &DrawNode) -> bool {
    let settings = &stage.settings;
    let lattice = &stage.clouds[node.cloud].lattice;
    let corner = lattice.node_min(node.key).map(f64::from);
    let side = lattice.node_side_world(node.key.level());
    let low = glam::DVec3::from(lattice.world_f64(corner));
    let world = match settings.splat_size {
        SplatSize::Pixels(_) => 0.0,
        SplatSize::World(size) => size,
        SplatSize::Level(factor) | SplatSize::Adaptive(factor) => factor * f64::from(node.spacing),
        // What the points say is not known before they are looked at.
        SplatSize::Own => return true,
    };
    let world = world.max(match settings.splat {
        // Without axes, discs are as large as adaptive splats; seen obliquely, they are no larger.
        Splat::Disc | Splat::Ellipse | Splat::BlendedDisc | Splat::BlendedEllipse => {
            CLOSED_SURFACE * f64::from(node.spacing)
        }
        _ => 0.0,
    });
    let bounds = WorldBox::from_corners(low, low + side);
    let grown = WorldBox { half: bounds.half + glam::DVec3::splat(world), ..bounds };
    let Some(extent) = optics.extent(&optics.with_rounding(&grown)) else { return true };
    let pixels = match settings.splat_size {
        SplatSize::Pixels(size) => f64::from(size),
        _ => settings.size_limits.min_px,
    };
    let margin = window.reach as f64 + pixels.max(settings.size_limits.min_px) + 2.0;
    let [width, height] = settings.size_px.map(f64::from);
    let [x, y] = [window.at[0] as f64 - 0.5 * width, 0.5 * height - window.at[1] as f64];
    let is_within =
        |axis: usize, c: f64| extent.min[axis] - margin <= c && c <= extent.max[axis] + margin;
    is_within(0, x) && is_within(1, y)
}
