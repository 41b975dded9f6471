//! How wrong a picture is, or a set of points: the numbers that run time is paid for with.
//!
//! Pictures are compared with a picture of every point
//! ([`TruthRenderer`](crate::render::TruthRenderer)) by [`PictureError`]: structural similarity,
//! mean squared error, holes and spill, depth. What consecutive pictures change beyond what the
//! truth changes is [`Popping`]. Sets of points are compared by [`CloudError`]: the distance each way,
//! and how far normals and colours are off.
//!
//! The similarity that reports tell is that of the luma ([`ssim`]): so it is defined (Wang 2004), and
//! scans' colours differ by their lightness first. [`ssim_color`] is the mean over red, green and
//! blue, as scikit-image takes it of colour pictures. Both, and the squared errors, are held to
//! values of scikit-image by recorded pairs.
//!
//! A number that does not exist (of no pixels, of no points, of a picture smaller than a window) is
//! `None`; none is NaN. The only infinite one is the PSNR of equal pictures: see [`PictureError`].
//!
//! FLIP is not among them. The crate that has it binds the C++ of its authors; none in Rust was
//! found, and a second metric of perception is not worth a C++ compiler.

mod cloud_error;
mod coverage;
mod decibels;
mod depth;
mod neighbours;
mod picture_error;
mod point_set;
mod popping;
mod spread;
mod ssim;

#[cfg(test)]
mod recorded;
#[cfg(test)]
mod testing;

pub use cloud_error::CloudError;
pub use coverage::{CoverageError, Share};
pub use depth::DepthError;
pub use picture_error::PictureError;
pub use point_set::PointSet;
pub use popping::Popping;
pub use spread::Spread;
pub use ssim::{WINDOW_PX, ssim, ssim_color, ssim_map};

use crate::render::Picture;

/// Why there is no number.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum MetricsError {
    /// Pictures of different sizes: draw both in one size.
    #[error("pictures of {0} and {1} pixels cannot be compared: draw both in one size")]
    Sizes(String, String),
    /// A picture in which no window fits.
    #[error("a picture of {0} pixels is too small for SSIM: draw at least {side}x{side}", side = WINDOW_PX)]
    TooSmall(String),
    /// Sets of points on different lattices: compare sets of one dataset.
    #[error("the sets of points are of different datasets: their lattices differ")]
    Lattices,
    /// More points than can be numbered: compare parts.
    #[error("more than {} points in a set: compare parts of the cloud", u32::MAX)]
    TooManyPoints,
}

/// Pixels of each of two pictures of one size.
///
/// # Errors
/// [`MetricsError::Sizes`] where the sizes differ, or a picture does not have its size.
fn same_size(a: &Picture, b: &Picture) -> Result<usize, MetricsError> {
    let pixels = a.width as usize * a.height as usize;
    let holds = |p: &Picture| p.rgba8.len() / 4 == pixels && p.depth.len() == pixels;
    if (a.width, a.height) == (b.width, b.height) && holds(a) && holds(b) {
        return Ok(pixels);
    }
    Err(MetricsError::Sizes(size(a), size(b)))
}

fn size(picture: &Picture) -> String {
    format!("{}x{}", picture.width, picture.height)
}
