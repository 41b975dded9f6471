//! Which pixels a splat covers and how far away its parts are: the rules of
//! [`Splat`](crate::render::Splat), in f64. The WGSL twins are `shaders/footprint_*.wgsl`.
//!
//! Each kind is a type that is made once per run of points of a node; the loops over points and
//! pixels are compiled for each of them, so that no choice is left inside.

mod cone;
mod facing;
mod mesh;
mod oriented;

use std::ops::Range;

use glam::DVec3;

pub(super) use cone::{Cone, Paraboloid};
pub(super) use facing::{Dot, Facing, Flat, Square};
pub(super) use mesh::Mesh;
pub(super) use oriented::Oriented;

use crate::render::view::Projected;

/// A kind of splat.
pub(super) trait Footprint {
    /// Whether the size of a splat matters.
    const SIZED: bool = true;

    /// Calls `take` with every part of a splat.
    fn cover(&self, spot: &Spot, grid: Grid, take: impl FnMut(Fragment));
}

/// A point that is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Which of the node's points.
    pub index: usize,
    /// In view space.
    pub place: DVec3,
    /// On the picture.
    pub at: Projected,
    /// Half its size.
    pub radius_px: f64,
}

impl Spot {
    /// World units that the radius is at the spot's distance. (Where not even f64 can tell, 0.)
    #[inline]
    pub fn radius(&self) -> f64 {
        let radius = self.radius_px / self.at.scale;
        if radius.is_finite() { radius } else { 0.0 }
    }

    /// Column and row of the pixel that holds the centre; it may lie beyond the last, and does where
    /// the centre is beside the first.
    #[inline]
    pub fn center_pixel(&self) -> [usize; 2] {
        [self.at.x, self.at.y].map(|c| if c >= 0.0 { floor(c) } else { usize::MAX })
    }
}

/// What a splat is on a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fragment {
    /// Row by row.
    pub pixel: usize,
    /// Along the view direction, world units.
    pub distance: f64,
    /// Square of the pixel's place within the splat: 0 is the centre, 1 the rim.
    pub r_squared: f64,
    /// Of the splat, world units.
    pub radius: f64,
}

/// Columns and rows of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Grid {
    /// Pixels per row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// The pixels of a row or column of `length` whose middles are above `low` and at most `high`.
#[inline]
fn span(low: f64, high: f64, length: usize) -> Range<usize> {
    // NaN is 0: nothing.
    floor(low + 0.5).min(length)..floor(high + 0.5).min(length)
}

/// The pixels of a row or column of `length` whose middles are at least `low` and at most `high`.
#[inline]
fn closed_span(low: f64, high: f64, length: usize) -> Range<usize> {
    let above = low + 0.5;
    let first = floor(above);
    // The middle before is `low` itself.
    let on_low = first > 0 && first as f64 == above;
    (first - usize::from(on_low)).min(length)..floor(high + 0.5).min(length)
}

/// The whole part of a number; 0 where that is negative or NaN.
#[inline]
fn floor(number: f64) -> usize {
    // Casts from float saturate. Those to i32 are one instruction and a correction; no picture has
    // so many pixels on a side.
    number.max(0.0) as i32 as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_holds_the_middles_above_its_low_end() {
        assert_eq!(span(1.5, 3.5, 9), 2..4);
        assert_eq!(span(1.4, 3.4, 9), 1..3);
        assert_eq!(span(-8.0, 80.0, 9), 0..9);
    }

    #[test]
    fn a_closed_span_holds_the_middles_at_both_ends() {
        assert_eq!(closed_span(1.5, 3.5, 9), 1..4);
        assert_eq!(closed_span(1.6, 3.4, 9), 2..3);
        assert_eq!(closed_span(0.5, 0.5, 9), 0..1);
        assert_eq!(closed_span(-0.5, 8.5, 9), 0..9);
        assert_eq!(closed_span(-8.0, 80.0, 9), 0..9);
    }

    #[test]
    fn a_span_of_what_is_no_place_is_empty() {
        for far in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300] {
            assert!(span(far - 2.0, far + 2.0, 9).is_empty(), "{far}");
            assert!(closed_span(far - 2.0, far + 2.0, 9).is_empty(), "{far}");
        }
    }
}
