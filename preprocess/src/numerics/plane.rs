//! The plane that fits a set of points best, in the sense of least squares across it.

use glam::DVec3;

use super::{Covariance, Rank};

/// Least difference of the two smaller variances, in the largest one, that tells a normal. The
/// direction is off by the rounding of the covariance over this difference: a milliradian here.
pub const SMALLEST_GAP: f64 = 1e-12;

/// A plane through the mean of points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Across the plane, a unit vector; its largest component is positive.
    pub normal: DVec3,
    /// Standard deviation of the points from the plane, lattice units.
    pub deviation: f64,
    /// Surface variation, 0 (flat) to 1/3 (the same in all directions): the smallest variance in the
    /// sum of all. (Pauly, Gross, Kobbelt 2002)
    pub curvature: f64,
}

/// Why points have no plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoPlane {
    /// There are none.
    #[error("there are no points")]
    Empty,
    /// All points are one.
    #[error("all points are in the same place")]
    Point,
    /// All points lie on a line.
    #[error("all points are on one line")]
    Line,
    /// The two smallest variances are the same: any direction between would do.
    #[error("the points extend equally far in all directions across")]
    Round,
}

impl Plane {
    /// Fits a plane.
    ///
    /// # Errors
    /// [`NoPlane`], where the points do not tell one.
    pub fn fit(covariance: &Covariance) -> Result<Self, NoPlane> {
        let eigen = covariance.principal();
        match eigen.rank() {
            Rank::Point => return Err(NoPlane::Point),
            Rank::Line => return Err(NoPlane::Line),
            Rank::Plane | Rank::Solid => {}
        }
        let [least, middle, most] = eigen.values;
        if middle - least <= SMALLEST_GAP * most {
            return Err(NoPlane::Round);
        }
        let normal = eigen.vectors[0];
        let magnitude = normal.abs();
        let axis = if magnitude.z >= magnitude.x.max(magnitude.y) {
            2
        } else {
            usize::from(magnitude.y > magnitude.x)
        };
        let normal = if normal[axis] < 0.0 { -normal } else { normal };
        Ok(Self { normal, deviation: least.sqrt(), curvature: least / (least + middle + most) })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::numerics::Moments;

    fn fit(points: &[[u32; 3]]) -> Result<Plane, NoPlane> {
        Plane::fit(&Moments::of(points).covariance().ok_or(NoPlane::Empty)?)
    }

    #[test]
    fn what_has_no_plane_is_named() {
        assert_eq!(fit(&[[5; 3]]), Err(NoPlane::Point));
        assert_eq!(fit(&[[u32::MAX; 3]; 1000]), Err(NoPlane::Point));
        let line: Vec<[u32; 3]> = (0..100).map(|i| [7 * i, 4_000_000_000 - 3 * i, i]).collect();
        assert_eq!(fit(&line), Err(NoPlane::Line));
        let cube: Vec<[u32; 3]> = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2]).collect();
        assert_eq!(fit(&cube), Err(NoPlane::Round));
        let rod: Vec<[u32; 3]> = cube.iter().map(|q| [1000 * q[0], q[1], q[2]]).collect();
        assert_eq!(fit(&rod), Err(NoPlane::Round), "a square rod has no flat side");
    }

    proptest! {
        #[test]
        fn a_plane_is_found_wherever_it_lies(
            tilt in [1u32..50, 1u32..50], corner in [0u32..4_000_000_000, 0u32..4_000_000_000],
            at in prop::collection::vec([0u32..1000, 0u32..1000], 3..60),
        ) {
            // z = tilt · (x, y), in whole numbers.
            let points: Vec<[u32; 3]> = at
                .iter()
                .map(|q| [corner[0] + q[0], corner[1] + q[1], tilt[0] * q[0] + tilt[1] * q[1]])
                .collect();
            let expected = DVec3::new(-f64::from(tilt[0]), -f64::from(tilt[1]), 1.0).normalize();
            match fit(&points) {
                Ok(plane) => {
                    // Of slim triangles, the direction is less sure.
                    let covariance = Moments::of(&points).covariance().expect("points");
                    let [_, middle, most] = covariance.principal().values;
                    let tolerance = 1e-14 * most / middle;
                    prop_assert!(plane.normal.cross(expected).length() < tolerance);
                    prop_assert!(plane.curvature < 1e-14, "{}", plane.curvature);
                }
                Err(why) => prop_assert!(matches!(why, NoPlane::Line | NoPlane::Point | NoPlane::Round)),
            }
        }
    }
}
