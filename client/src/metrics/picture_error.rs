//! A picture against the truth.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{CoverageError, DepthError, MetricsError, decibels, same_size, ssim};
use crate::render::Picture;

/// Bytes of pixels that one task compares.
const TASK_BYTES: usize = 1 << 16;

/// How far a picture is from the truth, by colour, by coverage and by depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// Structural similarity of the luma, 1 for equal pictures, above -1: see [`ssim`](fn@ssim).
    /// `None` where a picture is narrower or lower than its window.
    pub ssim: Option<f64>,
    /// Mean square of the differences of red, green and blue, each 0 to 255 as displays take them.
    /// `None` where there are no pixels.
    pub mse: Option<f64>,
    /// `10 log10(255² / mse)`, decibels. Infinite for equal pictures, and then written as the text
    /// `Infinity` in JSON and CSV. `None` where there are no pixels.
    #[serde(with = "decibels")]
    pub psnr_db: Option<f64>,
    /// Which pixels are covered.
    pub coverage: CoverageError,
    /// How far away what is seen is, where both pictures see something. `None` where there is no
    /// such pixel.
    pub depth: Option<DepthError>,
}

impl PictureError {
    /// The errors of a picture of the same view in the same size.
    ///
    /// # Errors
    /// [`MetricsError::Sizes`] where the sizes differ.
    pub fn between(picture: &Picture, truth: &Picture) -> Result<Self, MetricsError> {
        let mse = mean_squared_error(picture, truth)?;
        let ssim = match ssim(picture, truth) {
            Ok(ssim) => Some(ssim),
            Err(MetricsError::TooSmall(_)) => None,
            Err(other) => return Err(other),
        };
        Ok(Self {
            ssim,
            mse,
            psnr_db: mse.map(psnr_db),
            coverage: CoverageError::between(picture, truth),
            depth: DepthError::between(picture, truth),
        })
    }
}

/// Over red, green and blue of all pixels; `None` where there are none.
fn mean_squared_error(a: &Picture, b: &Picture) -> Result<Option<f64>, MetricsError> {
    let pixels = same_size(a, b)?;
    // Of integers: exact, in whatever order. 2^46 pixels of the largest difference fit.
    let of_pixels = |(a, b): (&[u8], &[u8])| -> u64 {
        let pixels = a.chunks_exact(4).zip(b.chunks_exact(4));
        let square = |(a, b): (&u8, &u8)| u64::from(a.abs_diff(*b)).pow(2);
        pixels.map(|(a, b)| a.iter().zip(b).take(3).map(square).sum::<u64>()).sum()
    };
    let tasks = a.rgba8.par_chunks(TASK_BYTES).zip(b.rgba8.par_chunks(TASK_BYTES));
    let squares: u64 = tasks.map(of_pixels).sum();
    Ok((pixels > 0).then(|| squares as f64 / (3 * pixels) as f64))
}

fn psnr_db(mse: f64) -> f64 {
    if mse == 0.0 { f64::INFINITY } else { 10.0 * (255.0 * 255.0 / mse).log10() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::{colors, depths, grey, texture};

    fn between(a: &Picture, b: &Picture) -> PictureError {
        PictureError::between(a, b).expect("of one size")
    }

    #[test]
    fn equal_pictures_have_no_error() {
        let a = grey(20, 15, texture);
        let error = between(&a, &a);
        assert_eq!((error.ssim, error.mse), (Some(1.0), Some(0.0)));
        assert_eq!(error.psnr_db, Some(f64::INFINITY));
    }

    #[test]
    fn the_error_is_that_of_the_worst_of_colours() {
        let (black, white) = (grey(13, 12, |_, _| 0), grey(13, 12, |_, _| 255));
        let error = between(&black, &white);
        assert_eq!((error.mse, error.psnr_db), (Some(65_025.0), Some(0.0)));
        let ssim = error.ssim.expect("large enough");
        assert!(ssim > 0.0 && ssim < 1e-3, "no structure, no lightness in common: {ssim}");
        // A third of the components is off by 30.
        let red = colors(5, 5, |_, _| [30, 0, 0]);
        assert_eq!(between(&red, &grey(5, 5, |_, _| 0)).mse, Some(300.0));
    }

    #[test]
    fn alpha_does_not_count() {
        let a = grey(3, 3, |_, _| 9);
        let mut b = a.clone();
        b.rgba8.iter_mut().skip(3).step_by(4).for_each(|alpha| *alpha = 0);
        assert_eq!(between(&a, &b).mse, Some(0.0));
    }

    #[test]
    fn every_number_of_pictures_without_pixels_or_of_one_is_named() {
        let none = between(&depths(0, &[]), &depths(0, &[]));
        assert_eq!((none.ssim, none.mse, none.psnr_db, none.depth), (None, None, None, None));
        assert_eq!(none.coverage.holes.of_all, None);
        let one = between(&depths(1, &[2.0]), &depths(1, &[3.0]));
        assert_eq!((one.ssim, one.mse), (None, Some(0.0)));
        assert_eq!(one.depth.expect("covered").rmse, 1.0);
    }

    #[test]
    fn pictures_of_different_sizes_are_refused() {
        let error = PictureError::between(&grey(3, 4, texture), &grey(4, 3, texture));
        assert_eq!(error, Err(MetricsError::Sizes("3x4".into(), "4x3".into())));
        let mut short = grey(3, 4, texture);
        short.depth.pop();
        assert!(PictureError::between(&short, &grey(3, 4, texture)).is_err());
    }

    #[test]
    fn what_is_written_is_read_back() {
        let a = Picture { depth: vec![4.0; 144], ..grey(12, 12, texture) };
        let b = Picture { depth: vec![5.0; 144], ..grey(12, 12, |x, y| texture(y, x)) };
        for error in [between(&a, &a), between(&a, &b), between(&depths(0, &[]), &depths(0, &[]))] {
            let text = serde_json::to_string(&error).expect("numbers and names");
            assert_eq!(serde_json::from_str::<PictureError>(&text).expect(&text), error);
        }
        let text = serde_json::to_string(&between(&a, &a)).expect("numbers and names");
        assert!(text.contains(r#""psnr_db":"Infinity""#), "{text}");
        assert!(serde_json::from_str::<PictureError>(&text.replace("Infinity", "inf")).is_err());
    }
}
