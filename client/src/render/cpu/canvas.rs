//! What the CPU draws on: one 64-bit key per sample, taken by the smallest.
//!
//! A key is the distance (its f32 bits order like the number, as it is not negative) above the
//! number of the point in the batch being drawn. Threads offer keys with an atomic minimum, so that
//! the outcome does not hang on their order: the nearest part is seen and, of parts equally near,
//! that of the first point. Colours are looked up only for points that are seen, when the batch is
//! done; then the number of the sample's point becomes 0, which is before all points of the next
//! batch.
//!
//! Blended splats and counts keep distances only, and sums beside them.

use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicU32, AtomicU64, Ordering},
};

use rayon::prelude::*;

use super::{
    batch::{Batch, Task},
    blend::Sums,
    footprint::{Fragment, Grid},
    stage::Stage,
};
use crate::render::{ColorMode, PointsPerPixel, density};

/// A sample on which nothing was drawn: behind everything.
const EMPTY: u64 = u64::MAX;

/// Samples that one task looks through.
const TASK_SAMPLES: usize = 4096;

/// Samples of the largest canvas whose memory is kept: 4096 x 2304.
const MOST_SPARE_SAMPLES: usize = 4096 * 2304;

/// The memory of the last canvas, for the next: getting it anew for every frame, page by page, was a
/// quarter of a frame's time.
static SPARE: Mutex<Option<Spare>> = Mutex::new(None);

#[derive(Default)]
struct Spare {
    keys: Vec<AtomicU64>,
    colors: Vec<[u8; 3]>,
}

impl Spare {
    fn take() -> Self {
        SPARE.lock().unwrap_or_else(PoisonError::into_inner).take().unwrap_or_default()
    }
}

/// What colours come from.
enum Ink {
    /// The nearest point.
    Nearest,
    /// Means of the foremost surface; empty while that is being found.
    Blended(Vec<Sums>),
    /// How many points there are.
    Counted(Vec<AtomicU32>),
}

pub(super) struct Canvas {
    grid: Grid,
    keys: Vec<AtomicU64>,
    ink: Ink,
    /// Of the samples on which something was drawn; complete once the canvas is [dry](Self::dry).
    colors: Vec<[u8; 3]>,
}

impl Canvas {
    /// An empty canvas for pictures of a stage.
    pub fn new(stage: &Stage) -> Self {
        let grid = stage.grid();
        let samples = grid.width * grid.height;
        let ink = if stage.settings.color == ColorMode::Density {
            Ink::Counted(filled(samples, || AtomicU32::new(0)))
        } else if stage.settings.splat.is_blended() {
            Ink::Blended(Vec::new())
        } else {
            Ink::Nearest
        };
        let Spare { mut keys, mut colors } = Spare::take();
        if keys.len() == samples {
            keys.par_iter_mut().with_min_len(TASK_SAMPLES).for_each(|key| *key.get_mut() = EMPTY);
        } else {
            keys = filled(samples, || AtomicU64::new(EMPTY));
            colors = vec![[0; 3]; samples];
        }
        Self { grid, keys, ink, colors }
    }

    /// How many times everything is drawn, [`turn`](Self::turn)ed in between.
    pub const fn passes(&self) -> u32 {
        match self.ink {
            Ink::Nearest | Ink::Counted(_) => 1,
            Ink::Blended(_) => 2,
        }
    }

    /// From finding the foremost surface to averaging it.
    pub fn turn(&mut self) {
        if let Ink::Blended(sums) = &mut self.ink {
            *sums = filled(self.keys.len(), Sums::default);
        }
    }

    /// Draws the points of a batch.
    pub fn draw(&mut self, stage: &Stage, batch: &Batch) {
        let (grid, keys) = (self.grid, &self.keys);
        match &self.ink {
            Ink::Nearest => {
                batch.for_each(|Task { node, run, start, .. }| {
                    stage.draw(node, run, grid, |index, part: Fragment| {
                        offer(&keys[part.pixel], key(part.distance, start + index));
                    });
                });
                self.take_colors(stage, batch);
            }
            Ink::Blended(sums) if sums.is_empty() => {
                batch.for_each(|Task { node, run, .. }| {
                    stage.draw(node, run, grid, |_, part: Fragment| {
                        offer(&keys[part.pixel], key(part.distance, 0));
                    });
                });
            }
            Ink::Blended(sums) => {
                batch.for_each(|Task { node, run, .. }| {
                    let paint = stage.paint(node);
                    // Of the point whose parts come.
                    let mut point = (usize::MAX, [0; 3]);
                    stage.draw(node, run, grid, |index, part: Fragment| {
                        let foremost = depth_of(keys[part.pixel].load(Ordering::Relaxed));
                        // In f32, as the foremost is: so it is never behind itself.
                        let distance = depth_of(key(part.distance, 0));
                        if f64::from(distance) - part.radius <= f64::from(foremost) {
                            if point.0 != index {
                                point = (index, paint.color(index));
                            }
                            sums[part.pixel].add(point.1, part.r_squared);
                        }
                    });
                });
            }
            Ink::Counted(counts) => {
                batch.for_each(|Task { node, run, .. }| {
                    stage.draw(node, run, grid, |_, part: Fragment| {
                        offer(&keys[part.pixel], key(part.distance, 0));
                        let more = |count: u32| count.checked_add(1);
                        // At the largest number it stays.
                        let _ = counts[part.pixel].fetch_update(
                            Ordering::Relaxed,
                            Ordering::Relaxed,
                            more,
                        );
                    });
                });
            }
        }
    }

    /// Looks up the colours of the batch's points that are seen.
    fn take_colors(&mut self, stage: &Stage, batch: &Batch) {
        let paints: Vec<_> = batch.nodes().iter().map(|node| stage.paint(node)).collect();
        let samples = self.keys.par_iter_mut().zip(&mut self.colors);
        samples.with_min_len(TASK_SAMPLES).for_each(|(key, color)| {
            let key = key.get_mut();
            let number = (*key & u64::from(u32::MAX)) as usize;
            if number == 0 || *key == EMPTY {
                return;
            }
            let (node, index) = batch.find(number);
            *color = paints[node].color(index);
            *key &= !u64::from(u32::MAX);
        });
    }

    /// Completes the colours when everything is drawn; tells what was counted.
    pub fn dry(&mut self) -> Option<PointsPerPixel> {
        let colors = self.colors.par_iter_mut();
        match &mut self.ink {
            Ink::Nearest => None,
            Ink::Blended(sums) => {
                let samples = colors.zip(sums).with_min_len(TASK_SAMPLES);
                samples.for_each(|(color, sums)| *color = sums.mean());
                None
            }
            Ink::Counted(counts) => {
                let counts: Vec<u32> = counts.iter_mut().map(|count| *count.get_mut()).collect();
                let told = PointsPerPixel::of(&counts);
                let samples = colors.zip(&counts).with_min_len(TASK_SAMPLES);
                samples.for_each(|(color, count)| *color = density::color(*count, told.largest));
                Some(told)
            }
        }
    }

    /// The canvas' size.
    pub const fn grid(&self) -> Grid {
        self.grid
    }

    /// Colour and distance of a sample; `None` where nothing was drawn.
    #[inline]
    pub fn sample(&self, index: usize) -> Option<([u8; 3], f32)> {
        let key = self.keys[index].load(Ordering::Relaxed);
        (key != EMPTY).then(|| (self.colors[index], depth_of(key)))
    }

    /// Distance of a sample; `None` where nothing was drawn and beside the canvas.
    #[inline]
    pub fn depth(&self, column: i64, row: i64) -> Option<f32> {
        let Grid { width, height } = self.grid;
        let column = usize::try_from(column).ok().filter(|column| *column < width)?;
        let row = usize::try_from(row).ok().filter(|row| *row < height)?;
        let key = self.keys[row * width + column].load(Ordering::Relaxed);
        (key != EMPTY).then(|| depth_of(key))
    }
}

impl Drop for Canvas {
    fn drop(&mut self) {
        if self.keys.len() <= MOST_SPARE_SAMPLES {
            let (keys, colors) = (std::mem::take(&mut self.keys), std::mem::take(&mut self.colors));
            let spare = Some(Spare { keys, colors });
            *SPARE.lock().unwrap_or_else(PoisonError::into_inner) = spare;
        }
    }
}

/// On all cores: the memory's pages are brought in by being written.
fn filled<T: Send>(count: usize, make: impl Fn() -> T + Send + Sync) -> Vec<T> {
    (0..count).into_par_iter().map(|_| make()).collect()
}

#[inline]
fn key(distance: f64, number: usize) -> u64 {
    // What is too far for f32 (or no number: scenes beyond all measure) is at its end. Numbers fit:
    // see `Batch::MOST_POINTS`.
    let distance = distance.abs().min(f64::from(f32::MAX)) as f32;
    u64::from(distance.to_bits()) << 32 | number as u64
}

#[inline]
const fn depth_of(key: u64) -> f32 {
    f32::from_bits((key >> 32) as u32)
}

#[inline]
fn offer(sample: &AtomicU64, key: u64) {
    // Most points are hidden: a plain load is cheaper than a read-modify-write.
    if key < sample.load(Ordering::Relaxed) {
        sample.fetch_min(key, Ordering::Relaxed);
    }
}
