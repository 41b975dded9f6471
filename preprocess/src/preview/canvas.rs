//! What points are drawn on: several samples a pixel, each with a depth and a colour.

/// Samples of a pixel along each axis.
pub(super) const SAMPLES: u32 = 2;
/// Largest side of a splat in samples.
const MAX_SIDE: f32 = 24.0;
/// How dark a sample may become behind an edge.
const DARKEST: f32 = 0.35;
/// Steps of a colour channel that are kept: fewer make the picture smaller, and no one sees it.
const COLOR_STEPS: f32 = 63.0;

/// A point on the canvas, in samples from its upper left corner, and its distance.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projected {
    pub(super) x: f32,
    pub(super) y: f32,
    /// Larger is farther, in samples' sides.
    pub(super) depth: f32,
}

/// Samples.
#[derive(Debug)]
pub(super) struct Canvas {
    width: usize,
    height: usize,
    depths: Vec<f32>,
    colors: Vec<[f32; 3]>,
}

impl Canvas {
    pub(super) fn new(size: [u32; 2]) -> Self {
        let [width, height] = size.map(|side| (side * SAMPLES) as usize);
        let samples = width * height;
        Self {
            width,
            height,
            depths: vec![f32::INFINITY; samples],
            colors: vec![[0.0; 3]; samples],
        }
    }

    /// Draws a square around a point; the nearest point of a sample stays.
    pub(super) fn splat(&mut self, at: Projected, side: f32, color: [f32; 3]) {
        let half = side.clamp(1.0, MAX_SIDE) / 2.0;
        let range = |middle: f32, end: usize| {
            let first = (middle - half).round().max(0.0) as usize;
            let last = (middle + half).round().max(0.0) as usize;
            first..last.max(first + 1).min(end)
        };
        for y in range(at.y, self.height) {
            for x in range(at.x, self.width) {
                let sample = y * self.width + x;
                if at.depth < self.depths[sample] {
                    self.depths[sample] = at.depth;
                    self.colors[sample] = color;
                }
            }
        }
    }

    /// Darkens what lies behind its neighbours, so that shapes are seen without any light (after the
    /// eye-dome lighting of Boucheny 2009).
    pub(super) fn shade(&mut self) {
        const REACH: isize = 3;
        let (width, height) = (self.width as isize, self.height as isize);
        let shades: Vec<f32> = (0..self.depths.len())
            .map(|sample| {
                let depth = self.depths[sample];
                if depth.is_infinite() {
                    return 1.0;
                }
                let (x, y) = (sample as isize % width, sample as isize / width);
                let mut hidden = 0.0;
                for (dx, dy) in
                    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
                {
                    let (x, y) = (x + dx * REACH, y + dy * REACH);
                    if (0..width).contains(&x) && (0..height).contains(&y) {
                        let step = depth - self.depths[(y * width + x) as usize];
                        hidden += (step / 24.0).clamp(0.0, 1.0);
                    }
                }
                (1.15 - hidden * 0.18).clamp(DARKEST, 1.0)
            })
            .collect();
        for (color, shade) in self.colors.iter_mut().zip(shades) {
            *color = color.map(|channel| channel * shade);
        }
    }

    /// Pixels: red, green, blue and coverage, rows from the top.
    pub(super) fn resolve(&self) -> Vec<u8> {
        let samples = SAMPLES as usize;
        let (columns, rows) = (self.width / samples, self.height / samples);
        let mut rgba = Vec::with_capacity(columns * rows * 4);
        for row in 0..rows {
            for column in 0..columns {
                let (mut covered, mut sum) = (0.0, [0.0; 3]);
                for y in row * samples..(row + 1) * samples {
                    for x in column * samples..(column + 1) * samples {
                        let sample = y * self.width + x;
                        if self.depths[sample].is_finite() {
                            covered += 1.0;
                            for (total, channel) in sum.iter_mut().zip(self.colors[sample]) {
                                *total += channel;
                            }
                        }
                    }
                }
                let share = covered / (samples * samples) as f32;
                let channel = |total: f32| match covered > 0.0 {
                    true => ((total / covered * COLOR_STEPS).round() * 255.0 / COLOR_STEPS) as u8,
                    false => 0,
                };
                rgba.extend(sum.map(channel));
                rgba.push((share * 255.0).round() as u8);
            }
        }
        rgba
    }
}
