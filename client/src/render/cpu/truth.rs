//! The truth: every point of the cloud, supersampled, no levels of detail.
//!
//! Nodes come one after the other and are drawn in batches, so that a dataset of any size passes
//! through. Each pixel is `samples` by `samples` samples, box-filtered: their colours (background
//! included) are averaged as they are coded, the values that a display takes and that errors are
//! measured on. A pixel's depth is that of its nearest sample. Splats have the size that they have
//! in a picture of the same settings, at least one pixel (not one sample): the truth is the same
//! picture, better sampled. A [`Splat::Point`](crate::render::Splat::Point) is a one-pixel square,
//! placed to the sample.

use std::sync::Arc;

use lodestream_protocol::Manifest;
use rayon::prelude::*;

use super::canvas::{BATCH_POINTS, Canvas};
use crate::{
    engine::DrawNode,
    render::{
        Picture, RenderError, VisibleTree,
        scene::{Scene, Surroundings},
        settings::{LARGEST_SIDE_PX, RenderSettings},
        view::View,
    },
};

/// Points that are gathered before they are drawn: enough work to share out between cores.
const GATHER_POINTS: usize = 1 << 21;

/// Most samples along one side of the supersampled picture, both sides multiplied.
const LARGEST_SAMPLES: u64 = 1 << 29;

/// Draws every point it is given.
pub struct TruthRenderer {
    settings: RenderSettings,
    samples: u32,
    clouds: Vec<Arc<Manifest>>,
    around: Surroundings,
    tree: VisibleTree,
    view: View,
    canvas: Canvas,
    gathered: Vec<DrawNode>,
    gathered_points: usize,
}

impl TruthRenderer {
    /// A renderer for all points of `clouds`, with `samples` by `samples` samples a pixel (1 to
    /// 16). It holds 12 bytes a sample. `tree` is of all nodes that will be added, for sizes that
    /// adapt to them.
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
        debug_assert!(u64::from(LARGEST_SIDE_PX) * 16 < u64::from(u32::MAX));
        let sides = [width * samples, height * samples];
        if u64::from(sides[0]) * u64::from(sides[1]) > LARGEST_SAMPLES {
            return Err(too_large());
        }
        let around = Surroundings::of(clouds, settings.color);
        let view = View::new(settings, samples, around.farthest(settings.camera.eye));
        Ok(Self {
            settings: *settings,
            samples,
            clouds: clouds.to_vec(),
            around,
            tree,
            view,
            canvas: Canvas::new(sides.map(|side| side as usize)),
            gathered: Vec::new(),
            gathered_points: 0,
        })
    }

    /// Takes a node. Of points of equal depth, those of earlier nodes are seen.
    ///
    /// # Errors
    /// [`RenderError::Scene`] where the node is of no cloud.
    pub fn add_node(&mut self, node: DrawNode) -> Result<(), RenderError> {
        Scene { clouds: &self.clouds, nodes: std::slice::from_ref(&node) }.ordered()?;
        let points = node.points.positions.len();
        if self.gathered_points + points > GATHER_POINTS {
            self.draw_gathered();
        }
        debug_assert!(points <= BATCH_POINTS);
        self.gathered_points += points;
        self.gathered.push(node);
        Ok(())
    }

    fn draw_gathered(&mut self) {
        let nodes: Vec<_> = self.gathered.iter().collect();
        let (settings, tree) = (&self.settings, &self.tree);
        self.canvas.draw(&self.view, settings, tree, &self.clouds, &self.around, &nodes);
        self.gathered.clear();
        self.gathered_points = 0;
    }

    /// The picture of all points taken.
    #[must_use]
    pub fn finish(mut self) -> Picture {
        self.draw_gathered();
        let [width, height] = self.settings.size_px;
        let samples = self.samples as usize;
        let pixels = width as usize * height as usize;
        let mut picture = Picture {
            width,
            height,
            rgba8: vec![255; 4 * pixels],
            depth: vec![f32::INFINITY; pixels],
        };
        let (canvas, background) = (&self.canvas, self.settings.background);
        let width = width as usize;
        let rows = picture.rgba8.par_chunks_exact_mut(4 * width);
        rows.zip(picture.depth.par_chunks_exact_mut(width)).enumerate().for_each(
            |(y, (colors, depths))| {
                for (x, (color, depth)) in colors.chunks_exact_mut(4).zip(depths).enumerate() {
                    let mut sums = [0u32; 3];
                    for sample_row in 0..samples {
                        let first = (y * samples + sample_row) * width * samples + x * samples;
                        for sample in first..first + samples {
                            let (rgb, d) =
                                canvas.pixel(sample).unwrap_or((background, f32::INFINITY));
                            *depth = depth.min(d);
                            for (sum, component) in sums.iter_mut().zip(rgb) {
                                *sum += u32::from(component);
                            }
                        }
                    }
                    let count = (samples * samples) as u32;
                    for (component, sum) in color.iter_mut().zip(sums) {
                        // Rounded to nearest; the mean of bytes is a byte.
                        *component = ((sum + count / 2) / count) as u8;
                    }
                }
            },
        );
        picture
    }
}
