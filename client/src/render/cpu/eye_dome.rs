//! Eye-dome lighting: what lies behind its neighbours is darker. (Boucheny 2009)

use super::canvas::Canvas;
use crate::render::{EyeDome, view::View};

/// The shades of a drawn canvas.
pub(super) struct Shades<'a> {
    canvas: &'a Canvas,
    neighbours: [[i64; 2]; 8],
    perspective: bool,
    px_per_world: f64,
    /// What a step in pixels is divided by.
    radius_px: f64,
    strength: f64,
}

impl<'a> Shades<'a> {
    /// Of a canvas with `samples` by `samples` samples a pixel.
    pub fn of(canvas: &'a Canvas, eye_dome: &EyeDome, view: &View, samples: u32) -> Self {
        Self {
            canvas,
            neighbours: eye_dome.neighbours(samples).map(|to| to.map(i64::from)),
            perspective: view.perspective,
            px_per_world: view.px_per_world,
            radius_px: eye_dome.radius_px * f64::from(samples),
            strength: eye_dome.strength,
        }
    }

    /// What the colour of the sample at a column and row, `distance` away, is to be multiplied by.
    pub fn shade(&self, column: usize, row: usize, distance: f32) -> f64 {
        let (column, row) = (column as i64, row as i64);
        let sum: f64 = self
            .neighbours
            .iter()
            .filter_map(|[right, down]| self.canvas.depth(column + right, row + down))
            // The logarithms are most of the work, and those of what is not in front count nothing.
            .filter(|neighbour| *neighbour < distance)
            .map(|neighbour| self.step(f64::from(distance), f64::from(neighbour)))
            .map(|step_px| (step_px / self.radius_px).min(EyeDome::STEEPEST))
            .sum();
        (-self.strength * sum / self.neighbours.len() as f64).exp()
    }

    /// How far one distance is behind another, in pixels.
    fn step(&self, distance: f64, neighbour: f64) -> f64 {
        let step =
            if self.perspective { (distance / neighbour).ln() } else { distance - neighbour };
        step * self.px_per_world
    }
}
