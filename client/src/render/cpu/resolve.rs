//! From samples to pixels: lit, then averaged as they are coded. A pixel's depth is the median of its
//! samples'.

use rayon::prelude::*;

use super::{canvas::Canvas, eye_dome::Shades, stage::Stage};
use crate::render::Picture;

/// Samples of a pixel: 16 by 16 at most.
const MOST_SAMPLES: usize = 256;

/// The picture of a canvas that is dry.
pub(super) fn resolve(canvas: &Canvas, stage: &Stage) -> Picture {
    let [width, height] = stage.settings.size_px;
    let pixels = width as usize * height as usize;
    // Zeros are free until they are written, which the rows do.
    let mut picture =
        Picture { width, height, rgba8: vec![0; 4 * pixels], depth: vec![0.0; pixels] };
    let eye_dome = stage.settings.shading.eye_dome.as_ref();
    let shades = eye_dome.map(|e| Shades::of(canvas, e, &stage.view, stage.samples));
    let (width, samples) = (width as usize, stage.samples as usize);
    let background = stage.settings.background;
    let sample = |column: usize, row: usize| {
        let index = row * canvas.grid().width + column;
        let Some((color, distance)) = canvas.sample(index) else {
            return (background, f32::INFINITY);
        };
        let Some(shades) = &shades else { return (color, distance) };
        let shade = shades.shade(column, row, distance);
        (color.map(|c| (f64::from(c) * shade).round() as u8), distance)
    };
    let pixel = |x: usize, y: usize| {
        if samples == 1 {
            return sample(x, y);
        }
        let (mut sums, mut distances) = ([0u32; 3], [f32::INFINITY; MOST_SAMPLES]);
        let distances = &mut distances[..samples * samples];
        let mut place = distances.iter_mut();
        for row in y * samples..(y + 1) * samples {
            for column in x * samples..(x + 1) * samples {
                let (rgb, distance) = sample(column, row);
                if let Some(place) = place.next() {
                    *place = distance;
                }
                for (sum, component) in sums.iter_mut().zip(rgb) {
                    *sum += u32::from(component);
                }
            }
        }
        let count = stage.samples * stage.samples;
        // Of an even number, the nearer of the two in the middle: half of them cover the pixel.
        let middle = (distances.len() - 1) / 2;
        let (_, median, _) = distances.select_nth_unstable_by(middle, f32::total_cmp);
        // Rounded to nearest; the mean of bytes is a byte.
        (sums.map(|sum| ((sum + count / 2) / count) as u8), *median)
    };
    let rows = picture.rgba8.par_chunks_exact_mut(4 * width);
    rows.zip(picture.depth.par_chunks_exact_mut(width)).enumerate().for_each(
        |(y, (colors, depths))| {
            let pixels = colors.as_chunks_mut::<4>().0.iter_mut().zip(depths);
            for (x, (rgba, depth)) in pixels.enumerate() {
                let ([red, green, blue], distance) = pixel(x, y);
                (*rgba, *depth) = ([red, green, blue, u8::MAX], distance);
            }
        },
    );
    picture
}
