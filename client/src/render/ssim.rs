//! Structural similarity of two pictures.
//!
//! Z. Wang, A. C. Bovik, H. R. Sheikh, E. P. Simoncelli: Image Quality Assessment: From Error
//! Visibility to Structural Similarity, 2004. As in the authors' reference: luma, an 11 x 11
//! Gaussian window of sigma 1.5, the mean over all places where the window lies inside the picture.

use rayon::prelude::*;

use crate::render::{Picture, RenderError};

const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// (K1 L)^2 and (K2 L)^2 with K1 = 0.01, K2 = 0.03, L = 255 (Wang 2004, eqs. 6 and 9).
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Mean structural similarity of the colours of two pictures: 1 where they are the same, around 0
/// where they have nothing in common.
///
/// # Errors
/// [`RenderError::Compare`] where the pictures differ in size, or are smaller than 11 x 11 pixels.
pub fn ssim(a: &Picture, b: &Picture) -> Result<f64, RenderError> {
    let (width, height) = (a.width as usize, a.height as usize);
    if (a.width, a.height) != (b.width, b.height) || width < WINDOW || height < WINDOW {
        let size = |p: &Picture| format!("{}x{}", p.width, p.height);
        return Err(RenderError::Compare(size(a), size(b)));
    }
    let weights = window();
    let (a, b) = (luma(a), luma(b));
    // Moments along rows first, then down columns: the Gaussian is separable.
    let columns = width - WINDOW + 1;
    let rows: Vec<Vec<[f64; 5]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let row = y * width;
            (row..row + columns)
                .map(|first| {
                    let mut moments = [0.0; 5];
                    for (i, weight) in weights.iter().enumerate() {
                        let (a, b) = (a[first + i], b[first + i]);
                        for (sum, value) in moments.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                            *sum += weight * value;
                        }
                    }
                    moments
                })
                .collect()
        })
        .collect();
    let sums: Vec<f64> = rows
        .par_windows(WINDOW)
        .map(|rows| {
            (0..columns)
                .map(|x| {
                    let mut moments = [0.0; 5];
                    for (weight, row) in weights.iter().zip(rows) {
                        for (sum, value) in moments.iter_mut().zip(row[x]) {
                            *sum += weight * value;
                        }
                    }
                    similarity(moments)
                })
                .sum()
        })
        .collect();
    // Added up in order, so that the same pictures give the same bits on any number of cores.
    Ok(sums.iter().sum::<f64>() / (sums.len() * columns) as f64)
}

/// Wang 2004, eq. 13, from the weighted means of a, b, a², b² and ab (eqs. 14 to 16).
fn similarity([mean_a, mean_b, square_a, square_b, product]: [f64; 5]) -> f64 {
    let variance_a = square_a - mean_a * mean_a;
    let variance_b = square_b - mean_b * mean_b;
    let covariance = product - mean_a * mean_b;
    ((2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2))
        / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
}

/// A Gaussian of unit sum.
fn window() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let x = i as f64 - (WINDOW / 2) as f64;
        (-x * x / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Luma per pixel, 0 to 255 (ITU-R BT.601).
fn luma(picture: &Picture) -> Vec<f64> {
    let luma =
        |p: &[u8]| 0.299 * f64::from(p[0]) + 0.587 * f64::from(p[1]) + 0.114 * f64::from(p[2]);
    picture.rgba8.chunks_exact(4).map(luma).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(width: u32, height: u32, value: impl Fn(u32, u32) -> u8) -> Picture {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let rgba8 = places.flat_map(|(x, y)| [value(x, y), value(x, y), value(x, y), 255]);
        let depth = vec![0.0; (width * height) as usize];
        Picture { width, height, rgba8: rgba8.collect(), depth }
    }

    fn texture(x: u32, y: u32) -> u8 {
        ((x * 7 + y * 13 + x * y) % 256) as u8
    }

    #[test]
    fn a_picture_is_like_itself() {
        let a = grey(40, 30, texture);
        assert!((ssim(&a, &a).expect("same size") - 1.0).abs() < 1e-12);
    }

    #[test]
    fn flat_pictures_differ_by_their_lightness_alone() {
        let (a, b) = (grey(16, 16, |_, _| 100), grey(16, 16, |_, _| 50));
        let expected = (2.0 * 100.0 * 50.0 + C1) / (100.0 * 100.0 + 50.0 * 50.0 + C1);
        let found = ssim(&a, &b).expect("same size");
        assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
    }

    #[test]
    fn agrees_with_an_independent_implementation() {
        // scikit-image 0.26, structural_similarity(a, b, data_range=255, gaussian_weights=True,
        // sigma=1.5, use_sample_covariance=False), which takes the same mean over whole windows.
        let a = grey(40, 30, texture);
        let b = grey(40, 30, |x, y| texture(x, y) / 2 + ((x * x + 3 * y) % 40) as u8);
        let found = ssim(&a, &b).expect("same size");
        assert!((found - SCIKIT_IMAGE).abs() < 1e-9, "{found}");
        assert!((found - ssim(&b, &a).expect("same size")).abs() < 1e-12, "symmetric");
    }

    const SCIKIT_IMAGE: f64 = 0.719_590_914_603_398_3;

    #[test]
    fn pictures_of_different_or_tiny_sizes_are_refused() {
        let a = grey(16, 16, texture);
        assert!(ssim(&a, &grey(16, 17, texture)).is_err());
        assert!(ssim(&grey(10, 16, texture), &grey(10, 16, texture)).is_err());
    }
}
