//! Structural similarity of two pictures.
//!
//! Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli: Image Quality Assessment: From Error
//! Visibility to Structural Similarity, 2004. As in the authors' reference: an 11 x 11 Gaussian
//! window of sigma 1.5, the mean over all places where the window lies inside the picture. Of luma
//! (as there), or of red, green and blue apart and then their mean.
//!
//! In f64 throughout: in f32 the variance of a bright, flat window, a difference of squares, would
//! be off by up to 0.01, which beside C2 = 58.5 is far more than the 1e-6 that is promised. The
//! Gaussian is separable and symmetric, and formula (13) asks only for the sum of the two variances:
//! four moments are filtered, with six multiplications each way.

use rayon::prelude::*;

use super::{MetricsError, same_size};
use crate::render::{Picture, Ramp};

/// Side of the window in pixels: pictures that are smaller either way have no similarity.
pub const WINDOW_PX: u32 = 11;

const SIGMA_PX: f64 = 1.5;

/// (K1 L)^2 and (K2 L)^2 with K1 = 0.01, K2 = 0.03, L = 255 (Wang 2004, eqs. 6 and 9).
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Rows of similarities that one task finds: rows at its ends are filtered twice.
const TASK_ROWS: usize = 64;

/// Mean structural similarity of the luma of two pictures: 1 where they are the same, around 0
/// where they have nothing in common, above -1.
///
/// # Errors
/// [`MetricsError::Sizes`] where the pictures differ in size, [`MetricsError::TooSmall`] where they
/// are smaller than 11 x 11 pixels.
pub fn ssim(a: &Picture, b: &Picture) -> Result<f64, MetricsError> {
    Ok(luma_map(a, b, &Window::of_wang())?.mean())
}

/// Mean over red, green and blue of their structural similarities.
///
/// # Errors
/// As [`ssim`].
pub fn ssim_color(a: &Picture, b: &Picture) -> Result<f64, MetricsError> {
    color_mean(a, b, &Window::of_wang())
}

/// The structural similarity of the luma around each pixel, as a picture: black where the pictures
/// are alike (1), lighter by way of purple and orange to pale yellow where they have nothing in
/// common (0 or less). Pixels at the edges, around which no window fits, have the colour of the nearest
/// around which one does.
///
/// # Errors
/// As [`ssim`].
pub fn ssim_map(a: &Picture, b: &Picture) -> Result<Picture, MetricsError> {
    let map = luma_map(a, b, &Window::of_wang())?;
    let (width, height) = (a.width as usize, a.height as usize);
    let margin = (WINDOW_PX / 2) as usize;
    let inside = |at: usize, count: usize| at.saturating_sub(margin).min(count - 1);
    let ramp = Ramp::Difference.table();
    let mut rgba8 = Vec::with_capacity(4 * width * height);
    for y in 0..height {
        let row = inside(y, map.values.len() / map.columns) * map.columns;
        for x in 0..width {
            let similarity = map.values[row + inside(x, map.columns)];
            let [red, green, blue] = ramp[usize::from(Ramp::step(1.0 - similarity))];
            rgba8.extend([red, green, blue, u8::MAX]);
        }
    }
    let depth = vec![f32::INFINITY; width * height];
    Ok(Picture { width: a.width, height: a.height, rgba8, depth })
}

/// Similarities at all places where the window lies inside the picture, row by row.
pub(super) struct Map {
    values: Vec<f64>,
    columns: usize,
}

impl Map {
    pub(super) fn mean(&self) -> f64 {
        let rows = self.values.par_chunks(self.columns).map(|row| row.iter().sum::<f64>());
        // Added up in order, so that the same pictures give the same bits on any number of cores.
        rows.collect::<Vec<_>>().iter().sum::<f64>() / self.values.len() as f64
    }

    /// Of what `value` makes of the pixels (red, green, blue, alpha) of two pictures of one size.
    ///
    /// # Errors
    /// [`MetricsError`] where the sizes differ, or the window does not fit.
    fn of(
        [a, b]: [&Picture; 2],
        window: &Window,
        value: impl Fn(&[u8; 4]) -> f64 + Sync,
    ) -> Result<Self, MetricsError> {
        same_size(a, b)?;
        let (width, height, size) = (a.width as usize, a.height as usize, window.size());
        if width.min(height) < size {
            return Err(MetricsError::TooSmall(super::size(a)));
        }
        let columns = width - size + 1;
        let mut values = vec![0.0; columns * (height - size + 1)];
        let tasks = values.par_chunks_mut(TASK_ROWS * columns).enumerate();
        tasks.for_each(|(task, values)| {
            let first = task * TASK_ROWS;
            let rows = first..first + values.len() / columns + size - 1;
            let [a, b] = [a, b].map(|picture| {
                let pixels = picture.rgba8.as_chunks().0;
                pixels[rows.start * width..rows.end * width].chunks_exact(width)
            });
            similarities(a.zip(b), window, &value, columns, values);
        });
        Ok(Self { values, columns })
    }
}

/// The similarities of a strip of two pictures: at all its places where the window lies inside.
fn similarities<'a>(
    rows: impl Iterator<Item = (&'a [[u8; 4]], &'a [[u8; 4]])>,
    window: &Window,
    value: &impl Fn(&[u8; 4]) -> f64,
    columns: usize,
    values: &mut [f64],
) {
    // Along rows first, then down columns. Planes of a, b, a² + b² and ab.
    let plane = values.len() + (window.size() - 1) * columns;
    let mut filtered = [0; 4].map(|_| vec![0.0; plane]);
    let mut moments = [0; 4].map(|_| vec![0.0; columns + window.size() - 1]);
    for (row, (a_pixels, b_pixels)) in rows.enumerate() {
        let [a, b, squares, product] = &mut moments;
        for (x, (a_pixel, b_pixel)) in a_pixels.iter().zip(b_pixels).enumerate() {
            (a[x], b[x]) = (value(a_pixel), value(b_pixel));
        }
        for ((a, b), (square, product)) in a.iter().zip(&*b).zip(squares.iter_mut().zip(product)) {
            *square = a * a + b * b;
            *product = a * b;
        }
        for (moment, plane) in moments.iter().zip(&mut filtered) {
            let sums = &mut plane[row * columns..(row + 1) * columns];
            window.sum(|i| &moment[i..i + columns], sums);
        }
    }
    let mut sums = [0; 4].map(|_| vec![0.0; columns]);
    for (y, values) in values.chunks_exact_mut(columns).enumerate() {
        for (plane, sums) in filtered.iter().zip(&mut sums) {
            window.sum(|i| &plane[(y + i) * columns..(y + i + 1) * columns], sums);
        }
        let [mean_a, mean_b, squares, products] = &sums;
        let means = mean_a.iter().zip(mean_b);
        let moments = means.zip(squares.iter().zip(products));
        for (value, ((a, b), (squares, product))) in values.iter_mut().zip(moments) {
            *value = similarity(*a, *b, *squares, *product);
        }
    }
}

/// Wang 2004, eq. 13, from the weighted means of a, b, a² + b² and ab (eqs. 14 to 16).
#[inline]
fn similarity(mean_a: f64, mean_b: f64, squares: f64, product: f64) -> f64 {
    let mean_squares = mean_a * mean_a + mean_b * mean_b;
    let mean_product = mean_a * mean_b;
    ((2.0 * mean_product + C1) * (2.0 * (product - mean_product) + C2))
        / ((mean_squares + C1) * (squares - mean_squares + C2))
}

/// Weights of unit sum along a side of the window, the same from both ends.
pub(super) struct Window(Vec<f64>);

impl Window {
    /// That of Wang 2004.
    pub(super) fn of_wang() -> Self {
        Self::gaussian(WINDOW_PX as usize, SIGMA_PX)
    }

    /// A Gaussian cut off to `size` weights.
    pub(super) fn gaussian(size: usize, sigma: f64) -> Self {
        let middle = 0.5 * (size as f64 - 1.0);
        let weight = |i| (-(i as f64 - middle).powi(2) / (2.0 * sigma * sigma)).exp();
        let weights: Vec<f64> = (0..size).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Self(weights.into_iter().map(|weight| weight / sum).collect())
    }

    fn size(&self) -> usize {
        self.0.len()
    }

    /// The weighted sum of as many rows as there are weights.
    fn sum<'a>(&self, row: impl Fn(usize) -> &'a [f64], sums: &mut [f64]) {
        let size = self.size();
        sums.fill(0.0);
        for i in 0..size / 2 {
            let (weight, pairs) = (self.0[i], row(i).iter().zip(row(size - 1 - i)));
            for (sum, (one, other)) in sums.iter_mut().zip(pairs) {
                *sum += weight * (one + other);
            }
        }
        if size % 2 == 1 {
            for (sum, value) in sums.iter_mut().zip(row(size / 2)) {
                *sum += self.0[size / 2] * value;
            }
        }
    }
}

pub(super) fn luma_map(a: &Picture, b: &Picture, window: &Window) -> Result<Map, MetricsError> {
    // ITU-R BT.601, 0 to 255.
    Map::of([a, b], window, |[red, green, blue, _]| {
        0.299 * f64::from(*red) + 0.587 * f64::from(*green) + 0.114 * f64::from(*blue)
    })
}

pub(super) fn color_mean(a: &Picture, b: &Picture, window: &Window) -> Result<f64, MetricsError> {
    let mean = |component: usize| {
        Map::of([a, b], window, |pixel| f64::from(pixel[component])).map(|map| map.mean())
    };
    Ok((mean(0)? + mean(1)? + mean(2)?) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::{colors, grey, texture};

    #[test]
    fn a_picture_is_exactly_like_itself() {
        let a = grey(40, 30, texture);
        assert_eq!(ssim(&a, &a), Ok(1.0));
        assert_eq!(ssim_color(&a, &a), Ok(1.0));
    }

    #[test]
    fn flat_pictures_differ_by_their_lightness_alone() {
        let (a, b) = (grey(16, 16, |_, _| 100), grey(16, 16, |_, _| 50));
        let expected = (2.0 * 100.0 * 50.0 + C1) / (100.0 * 100.0 + 50.0 * 50.0 + C1);
        let found = ssim(&a, &b).expect("same size");
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    }

    #[test]
    fn similarity_is_symmetric() {
        let a = grey(40, 30, texture);
        let b = grey(40, 30, |x, y| texture(x, y) / 2 + ((x * x + 3 * y) % 40) as u8);
        assert_eq!(ssim(&a, &b), ssim(&b, &a));
    }

    #[test]
    fn tasks_meet_without_a_seam() {
        // The middle rows of two tasks: the same window rows give the same values.
        let (high, low) = (grey(12, 200, |x, y| texture(x, y % 75)), grey(12, 75, texture));
        let other = |x, y| texture(y, x);
        let all = luma_map(&high, &grey(12, 200, |x, y| other(x, y % 75)), &Window::of_wang());
        let part = luma_map(&low, &grey(12, 75, other), &Window::of_wang());
        let (all, part) = (all.expect("fits"), part.expect("fits"));
        assert_eq!(all.values[..part.values.len()], part.values);
        assert_eq!(all.values[75 * 2..75 * 2 + part.values.len()], part.values);
    }

    #[test]
    fn colours_of_one_luma_are_alike_in_luma_alone() {
        // 0.299 * 196 = 58.6 = 0.587 * 99.8
        let a = colors(16, 16, |x, _| if x % 2 == 0 { [196, 0, 0] } else { [0, 100, 0] });
        let b = colors(16, 16, |x, _| if x % 2 == 0 { [0, 100, 0] } else { [196, 0, 0] });
        assert!(ssim(&a, &b).expect("same size") > 0.99);
        assert!(ssim_color(&a, &b).expect("same size") < 0.5);
    }

    #[test]
    fn the_map_is_bright_where_the_pictures_differ() {
        let a = grey(60, 40, texture);
        let b = grey(60, 40, |x, y| if x < 30 { texture(x, y) } else { texture(y, x) });
        let map = ssim_map(&a, &b).expect("same size");
        assert_eq!((map.width, map.height), (60, 40));
        let at = |x: usize, y: usize| &map.rgba8[4 * (y * 60 + x)..][..3];
        let black = Ramp::Difference.color(0);
        for (x, y) in [(0, 0), (0, 39), (24, 20)] {
            assert_eq!(at(x, y), black, "{x} {y}");
        }
        for (x, y) in [(36, 20), (59, 0), (59, 39)] {
            assert!(at(x, y)[0] > 100, "{x} {y}: {:?}", at(x, y));
        }
    }

    #[test]
    fn pictures_of_different_or_tiny_sizes_are_refused() {
        let a = grey(16, 16, texture);
        assert!(ssim(&a, &grey(16, 17, texture)).is_err());
        let tiny = grey(10, 16, texture);
        for of in [ssim, ssim_color, |a: &Picture, b: &Picture| ssim_map(a, b).map(|_| 0.0)] {
            assert_eq!(of(&tiny, &tiny), Err(MetricsError::TooSmall("10x16".into())));
        }
        assert!(ssim(&grey(11, 11, texture), &grey(11, 11, texture)).is_ok());
    }

    #[test]
    fn extreme_pictures_have_a_number() {
        let flat = [0, 1, 128, 255].map(|value| grey(16, 11, move |_, _| value));
        let check = grey(16, 11, |x, y| if (x + y) % 2 == 0 { 0 } else { 255 });
        let inverse = grey(16, 11, |x, y| if (x + y) % 2 == 0 { 255 } else { 0 });
        let all: Vec<_> = flat.iter().chain([&check, &inverse]).collect();
        for (a, b) in all.iter().flat_map(|a| all.iter().map(move |b| (a, b))) {
            let found = ssim(a, b).expect("same size");
            assert!((-1.0..=1.0).contains(&found), "{found}");
        }
        assert!(ssim(&check, &inverse).expect("same size") < -0.9);
    }
}
