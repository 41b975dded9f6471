//! The truth: every point of the cloud, supersampled, no levels of detail.
//!
//! Nodes come one after the other and are drawn in batches, so that a dataset of any size passes
//! through; for blended splats it passes twice. Each pixel is `samples` by `samples` samples,
//! box-filtered: their colours (background included) are averaged as they are coded, the values that
//! a display takes and that errors are measured on.
//!
//! A pixel's depth is the median of its samples', those on which nothing was drawn being infinitely
//! far: a pixel is covered where at least half of it is. A picture of one sample takes its depth from
//! one place of the pixel; the median has the least mean difference from what it may find there. The
//! nearest sample would make every rim up to a pixel wider and every slope nearer, so that the best
//! of pictures had holes; the mean would be of no surface at all.
//!
//! Splats have the size that they have in a picture of the same settings, at least one pixel (not
//! one sample): the truth is the same picture, better sampled. Where the size is `adaptive` (or `own`,
//! of a cloud without radii) and the tree is of all nodes, it follows the spacing that the points
//! have where they are. A [`Splat::Point`] is a one-pixel square, placed to the sample. Counts of
//! points per pixel are what they are: they have one sample a pixel, always.
//!
//! The samples of all pixels are one regular grid, which [`jittered`](TruthRenderer::jittered) moves as
//! a whole, by less than a sample. How far two truths of different seeds are apart tells how far one
//! is to be trusted. Not each sample by itself: footprints would have to ask for the place of every
//! sample that they test, and pictures, which have one a pixel, would pay for it.

use std::sync::Arc;

use glam::DVec2;
use lodestream_protocol::Manifest;

use super::{batch::Batch, blend, canvas::Canvas, resolve::resolve, stage::Stage};
use crate::{
    engine::DrawNode,
    render::{
        CloudColors, ColorMode, Frame, FrameStatistics, RenderError, Shading, Splat, VisibleTree,
        scene::Scene,
        settings::{LARGEST_SIDE_PX, RenderSettings},
    },
};

/// Points that are gathered before they are drawn: enough work to share out between cores.
const GATHER_POINTS: usize = 1 << 21;

/// Most samples along one side of the supersampled picture, both sides multiplied.
const LARGEST_SAMPLES: u64 = 1 << 29;

/// Draws every point it is given.
///
/// ```text
/// for pass in 0..renderer.passes() {
///     if pass > 0 { renderer.next_pass()?; }
///     for node in all { renderer.add_node(node)?; }
/// }
/// let frame = renderer.finish()?;
/// ```
pub struct TruthRenderer {
    stage: Stage,
    canvas: Canvas,
    gather_points: usize,
    gathered: Vec<DrawNode>,
    gathered_points: usize,
    /// What was drawn in the passes before this one.
    earlier: Vec<FrameStatistics>,
    /// What was drawn in this one.
    drawn: FrameStatistics,
}

impl TruthRenderer {
    /// A renderer for all points of `clouds`, with `samples` by `samples` samples a pixel (1 to
    /// 16). It holds 11 bytes a sample, 43 for blended splats. `tree` is of all nodes that will be
    /// added, for sizes that adapt to them.
    ///
    /// # Errors
    /// [`RenderError::Settings`] where the settings cannot be drawn.
    pub fn new(
        settings: &RenderSettings,
        clouds: &[Arc<Manifest>],
        tree: VisibleTree,
        samples: u32,
    ) -> Result<Self, RenderError> {
        settings.check()?;
        let [width, height] = settings.size_px;
        let too_large = || {
            let why = format!("{width}x{height} pixels with {samples}x{samples} samples each");
            RenderError::Settings(format!("{why}: at most 16x16 and {LARGEST_SAMPLES} in all"))
        };
        if !(1..=16).contains(&samples) {
            return Err(too_large());
        }
        let (mut settings, mut samples) = (*settings, samples);
        if settings.color == ColorMode::Density {
            (settings.splat, settings.shading, samples) = (Splat::Point, Shading::default(), 1);
        }
        debug_assert!(u64::from(LARGEST_SIDE_PX) * 16 < u64::from(u32::MAX));
        if u64::from(width * samples) * u64::from(height * samples) > LARGEST_SAMPLES {
            return Err(too_large());
        }
        let stage = Stage::new(settings, samples, clouds, tree);
        Ok(Self {
            canvas: Canvas::new(&stage),
            stage,
            gather_points: GATHER_POINTS,
            gathered: Vec::new(),
            gathered_points: 0,
            earlier: Vec::new(),
            drawn: FrameStatistics::default(),
        })
    }

    /// Moves all samples by up to half the distance between two, as the seed says: to the right or
    /// left, up or down. Counts of points per pixel stay where they are.
    #[must_use]
    pub fn jittered(mut self, seed: u64) -> Self {
        if self.stage.settings.color != ColorMode::Density {
            let mut random = fastrand::Rng::with_seed(seed);
            self.stage.view.half_size_px += DVec2::new(random.f64(), random.f64()) - 0.5;
        }
        self
    }

    /// What pictures of a scene with one sample a pixel are drawn by.
    pub(super) fn stage_of(settings: &RenderSettings, scene: &Scene) -> Stage {
        Stage::new(*settings, 1, scene.clouds, scene.tree())
    }

    /// Colours each cloud by its own mode.
    pub(super) fn colored(mut self, colors: CloudColors) -> Self {
        self.stage.set_colors(colors);
        self
    }

    /// For nodes that are in memory anyway: gathers as many as can be drawn at once, so that colours
    /// are looked up once.
    pub(super) const fn of_nodes_in_memory(mut self) -> Self {
        self.gather_points = Batch::MOST_POINTS;
        self
    }

    /// How many times all nodes must be added, with [`next_pass`](Self::next_pass) called in between.
    #[must_use]
    pub const fn passes(&self) -> u32 {
        self.canvas.passes()
    }

    /// Takes a node. Of points of equal depth, those of earlier nodes are seen.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where the node is of no cloud, or where there are more points than can
    /// be blended (68 billion).
    pub fn add_node(&mut self, node: DrawNode) -> Result<(), RenderError> {
        Scene { clouds: &self.stage.clouds, nodes: std::slice::from_ref(&node) }.ordered()?;
        let points = node.points.positions.len();
        if points > self.gather_points.saturating_sub(self.gathered_points) {
            self.draw_gathered();
        }
        debug_assert!(points <= Batch::MOST_POINTS);
        self.drawn.nodes += 1;
        self.drawn.points += points as u64;
        if self.passes() > 1 && self.drawn.points > blend::MOST_POINTS {
            let most = blend::MOST_POINTS;
            return Err(RenderError::Scene(format!("more than {most} points to blend")));
        }
        self.gathered_points += points;
        self.gathered.push(node);
        Ok(())
    }

    /// Begins the next pass: all nodes must be added again.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where there is no further pass.
    pub fn next_pass(&mut self) -> Result<(), RenderError> {
        let passes = self.passes();
        if self.is_last_pass() {
            return Err(RenderError::Scene(format!("a picture of {passes} passes has no further")));
        }
        self.draw_gathered();
        self.canvas.turn();
        self.earlier.push(std::mem::take(&mut self.drawn));
        Ok(())
    }

    fn is_last_pass(&self) -> bool {
        self.earlier.len() + 1 == self.passes() as usize
    }

    fn draw_gathered(&mut self) {
        self.canvas.draw(&self.stage, &Batch::of(&self.gathered));
        self.gathered.clear();
        self.gathered_points = 0;
    }

    /// The picture of all points taken, with the statistics of one pass.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where a pass is missing, or where passes were of different points.
    pub fn finish(mut self) -> Result<Frame, RenderError> {
        if !self.is_last_pass() || self.earlier.iter().any(|pass| *pass != self.drawn) {
            let passes = self.passes();
            let points: Vec<_> =
                self.earlier.iter().chain([&self.drawn]).map(|pass| pass.points).collect();
            return Err(RenderError::Scene(format!(
                "a picture of {passes} passes over the same points was given {points:?}"
            )));
        }
        self.draw_gathered();
        let points_per_pixel = self.canvas.dry();
        let picture = resolve(&self.canvas, &self.stage);
        Ok(Frame { picture, statistics: self.drawn, points_per_pixel })
    }
}
