//! The extent of what a path is made for.

use std::sync::Arc;

use glam::DVec3;
use lodestream_protocol::Manifest;

use crate::path::{PathError, camera_path::NEAREST_TARGET};

/// Largest absolute coordinate of a cloud; paths around it go somewhat beyond.
const LARGEST: f64 = 1e13;

/// Part of the box's diagonal that a side counts as, if it is shorter.
const THINNEST: f64 = 0.05;

/// Part of the largest coordinate that a diagonal counts as, if it is shorter: what is nearer to
/// each other than that may be rounding.
const SMALLEST: f64 = 1e-6;

/// Least extent in world units, at the origin.
const LEAST: f64 = 1e-6;

/// Width over height of the pictures that boxes are fitted into.
const ASPECT: f64 = 16.0 / 9.0;

/// Part of the picture's half width and height that a box may fill.
const FILL: f64 = 0.95;

/// A box around clouds, in world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    min: DVec3,
    max: DVec3,
}

impl Extent {
    /// The box between two corners, in any order.
    ///
    /// # Errors
    /// [`PathError::Extent`] where a coordinate is not within ±10^13.
    pub fn new(min: [f64; 3], max: [f64; 3]) -> Result<Self, PathError> {
        let corners = [min, max].map(DVec3::from);
        for corner in corners {
            if !corner.to_array().iter().all(|c| c.abs() <= LARGEST) {
                return Err(PathError::Extent(format!(
                    "no path can be made around a cloud that reaches to {corner}: coordinates must \
                     be within ±{LARGEST:e}"
                )));
            }
        }
        Ok(Self { min: corners[0].min(corners[1]), max: corners[0].max(corners[1]) })
    }

    /// The box around all clouds; where there are no points, a unit cube at the origin.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn of(clouds: &[Arc<Manifest>]) -> Result<Self, PathError> {
        let boxes = clouds.iter().filter_map(|cloud| cloud.bounds_world());
        let boxes: Vec<Self> =
            boxes.map(|(min, max)| Self::new(min, max)).collect::<Result<_, _>>()?;
        let union = |a: Self, b: Self| Self { min: a.min.min(b.min), max: a.max.max(b.max) };
        let unit = Self { min: DVec3::ZERO, max: DVec3::ONE };
        Ok(boxes.into_iter().reduce(union).unwrap_or(unit))
    }

    /// Lowest corner.
    #[must_use]
    pub const fn min(&self) -> DVec3 {
        self.min
    }

    /// Highest corner.
    #[must_use]
    pub const fn max(&self) -> DVec3 {
        self.max
    }

    pub(super) fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Length of the diagonal; of a point, what its coordinates can tell apart.
    pub(super) fn size(&self) -> f64 {
        let largest = self.min.abs().max(self.max.abs()).max_element();
        (self.max - self.min).length().max(SMALLEST * largest).max(LEAST)
    }

    /// Half of the sides.
    pub(super) fn half(&self) -> DVec3 {
        0.5 * (self.max - self.min)
    }

    /// Half of the sides as ways through the cloud take them: none thinner than a part of the size.
    pub(super) fn roomy_half(&self) -> DVec3 {
        self.half().max(DVec3::splat(THINNEST * self.size()))
    }

    /// Nearest that a camera may come to its target: ten times what a path's keys must keep where
    /// its coordinates are those of the cloud.
    pub(super) fn nearest(&self) -> f64 {
        10.0 * NEAREST_TARGET * self.min.abs().max(self.max.abs()).max_element()
    }

    /// Distance from the centre in the unit direction `away` from which the whole box is seen at
    /// a vertical field of view of `fov_y` radians, in a picture of 16 : 9.
    pub(super) fn fit_distance(&self, away: DVec3, fov_y: f64) -> f64 {
        let forward = -away;
        let right = forward.cross(DVec3::Z).normalize_or(DVec3::X);
        let up = right.cross(forward);
        let tangent = FILL * libm::tan(0.5 * fov_y);
        let half = self.half();
        let corners = (0..8u8).map(|corner| {
            let sign = |axis: u8| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            half * DVec3::new(sign(0), sign(1), sign(2))
        });
        // A corner c is `distance + c · forward` away along the view, and must be no farther from
        // its axis than that times the tangent.
        let needed = corners.map(|c| {
            let across = (c.dot(right).abs() / ASPECT).max(c.dot(up).abs());
            across / tangent - c.dot(forward)
        });
        // A point would be seen from where it is.
        needed.fold(THINNEST * self.size(), f64::max)
    }
}

/// The unit vector at `bearing` radians counter-clockwise from south as seen from above, `elevation`
/// radians above the horizon.
pub(super) fn direction(bearing: f64, elevation: f64) -> DVec3 {
    let (sine, cosine) = libm::sincos(bearing);
    let (rise, run) = libm::sincos(elevation);
    DVec3::new(run * sine, -run * cosine, rise)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fitted_box_is_seen_whole_and_fills_the_picture_one_way() {
        let boxes = [([0.0; 3], [4.0, 2.0, 1.0]), ([5e5, 5e6, 0.0], [5e5, 5e6, 300.0])];
        for (min, max) in boxes {
            let extent = Extent::new(min, max).expect("finite");
            let (away, fov_y) = (direction(0.7, 0.4), 0.9);
            let distance = extent.fit_distance(away, fov_y);
            let right = (-away).cross(DVec3::Z).normalize();
            let up = right.cross(-away);
            let mut most: f64 = 0.0;
            for x in [-1.0, 1.0] {
                for y in [-1.0, 1.0] {
                    for z in [-1.0, 1.0] {
                        let corner = extent.half() * DVec3::new(x, y, z) - distance * away;
                        let depth = corner.dot(-away) * (0.5 * fov_y).tan();
                        most = most.max(corner.dot(right).abs() / depth / ASPECT);
                        most = most.max(corner.dot(up).abs() / depth);
                    }
                }
            }
            assert!((most - FILL).abs() < 1e-9, "{most}");
        }
    }

    #[test]
    fn coordinates_that_no_path_reaches_are_refused() {
        for bad in [f64::NAN, f64::INFINITY, 1e14] {
            let error = Extent::new([0.0; 3], [1.0, bad, 1.0]).expect_err("too large");
            assert!(error.to_string().contains("1e13"), "{error}");
        }
    }
}
