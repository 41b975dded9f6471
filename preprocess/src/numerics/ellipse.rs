//! The bounding ellipse of points in a tangent plane. (Pajarola 2003, section 4)
//!
//! The directions of the axes and their ratio come from the covariance within the plane, and their
//! size from the points: the ellipse is scaled until it holds them all. Two formulas of the paper do
//! not do what its text says, and are derived here:
//!
//! - The eigenvalues of a 2 x 2 matrix M solve `λ² - trace(M) λ + det(M) = 0`; eq. 5 adds the trace,
//!   which gives them the wrong sign.
//! - Points that fill an ellipse of half axes a and b evenly have variances a²/4 and b²/4 along
//!   them: an axis goes with the *root* of its eigenvalue. The paper takes `a' = λ1`, `b' = λ2`, so
//!   that an ellipse twice as long as wide comes out four times as long.

use glam::{DVec2, DVec3};

use super::{Covariance, RANK_TOLERANCE};

/// What the size grows by, times the ratio of the axes, so that no point is outside by a rounding: by
/// as much the direction of the longer axis is off, and that counts against the shorter one.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// An ellipse in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipse {
    /// Its middle, lattice units from the [`Covariance::center`] that it was made from.
    pub middle: DVec3,
    /// Half axes in lattice units, the longer one first; perpendicular, with `axes[0] × axes[1]`
    /// along the normal. Zero where all points are the middle.
    pub axes: [DVec3; 2],
}

impl Ellipse {
    /// The ellipse around `middle` and across `normal` (a unit vector) that holds the projections of
    /// `points` and has the shape of `covariance`, which is theirs. Middle and points are lattice
    /// units from [`Covariance::center`]; the middle need not be the mean.
    ///
    /// To hold ellipses (those of the nodes below), give their [corners](Self::corners).
    ///
    /// A shape is no thinner than numbers can tell: at least by the root of [`RANK_TOLERANCE`], in
    /// the longer axis.
    #[must_use]
    pub fn bounding(
        covariance: &Covariance,
        middle: DVec3,
        normal: DVec3,
        points: impl IntoIterator<Item = DVec3>,
    ) -> Self {
        let (x, y) = normal.any_orthonormal_pair();
        let spread = covariance.about(middle);
        let (along_x, along_y) = (spread.apply(x), spread.apply(y));
        let (xx, xy, yy) = (x.dot(along_x), x.dot(along_y), y.dot(along_y));
        let ([least, most], direction) = principal_axes(xx, xy, yy);
        let across = DVec2::new(-direction.y, direction.x);
        let [long, short] = [direction, across].map(|d| d.x * x + d.y * y);
        let most = most.max(0.0);
        let least = least.max(RANK_TOLERANCE * most);
        // Of unit size where there is no shape: all points are the middle, then, or not the ones
        // that the covariance is of.
        let (a, b) = if most > 0.0 { (most.sqrt(), least.sqrt()) } else { (1.0, 1.0) };
        // Pajarola 2003, last equation of section 4: f² = x²/a² + y²/b², the largest over all points.
        let factor = points.into_iter().fold(0.0, |factor: f64, point| {
            let d = point - middle;
            factor.max((d.dot(long) / a).hypot(d.dot(short) / b))
        });
        let factor = factor * (1.0 + ROUNDING * a / b);
        Self { middle, axes: [long * (factor * a), short * (factor * b)] }
    }

    /// The corners of the rectangle around the ellipse.
    #[must_use]
    pub fn corners(&self) -> [DVec3; 4] {
        let [u, v] = self.axes;
        [u + v, u - v, v - u, -u - v].map(|corner| self.middle + corner)
    }
}

/// Eigenvalues of `[xx xy; xy yy]`, the smaller one first, and the unit eigenvector of the larger.
///
/// By the rotation that takes `xy` to zero, and not by the roots of the characteristic polynomial,
/// whose determinant cancels for slim shapes.
fn principal_axes(xx: f64, xy: f64, yy: f64) -> ([f64; 2], DVec2) {
    let along = |high: bool| if high { DVec2::X } else { DVec2::Y };
    if xy == 0.0 {
        return ([xx.min(yy), xx.max(yy)], along(xx >= yy));
    }
    let theta = 0.5 * (yy - xx) / xy;
    // Of two equal diagonal entries the turn is 45 degrees one way or the other.
    let t = 1.0_f64.copysign(theta) / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / t.hypot(1.0);
    let sine = t * cosine;
    let (first, second) = (xx - t * xy, yy + t * xy);
    if first >= second {
        ([second, first], DVec2::new(cosine, -sine))
    } else {
        ([first, second], DVec2::new(sine, cosine))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::numerics::Moments;

    fn relative(points: &[[u32; 3]], covariance: &Covariance) -> Vec<DVec3> {
        let near = |q: &[u32; 3]| {
            DVec3::from(std::array::from_fn(|a| (i64::from(q[a]) - covariance.center[a]) as f64))
        };
        points.iter().map(near).collect()
    }

    /// How far out a point is: 1 on the rim.
    fn reach(ellipse: &Ellipse, point: DVec3) -> f64 {
        let d = point - ellipse.middle;
        ellipse
            .axes
            .map(|axis| d.dot(axis) / axis.length_squared())
            .into_iter()
            .fold(0.0, f64::hypot)
    }

    proptest! {
        #[test]
        fn all_points_are_inside_and_one_is_on_the_rim(
            points in prop::collection::vec(any::<[u32; 3]>(), 2..40), bits in 3u32..=32,
            normal in [-1.0..1.0, -1.0..1.0, -1.0..1.0f64],
        ) {
            let Some(normal) = DVec3::from(normal).try_normalize() else { return Ok(()) };
            let points: Vec<[u32; 3]> = points.iter().map(|q| q.map(|c| c >> (32 - bits))).collect();
            let covariance = Moments::of(&points).covariance().expect("points");
            let near = relative(&points, &covariance);
            let ellipse = Ellipse::bounding(&covariance, covariance.offset, normal, near.iter().copied());
            let [u, v] = ellipse.axes;
            prop_assert!(u.length() >= v.length() * (1.0 - 1e-15));
            prop_assert!(u.dot(v).abs() <= 1e-14 * u.length() * v.length().max(1e-300));
            prop_assert!(u.cross(v).dot(normal) >= 0.0);
            if u == DVec3::ZERO {
                // All are one.
                return Ok(());
            }
            let farthest = near.iter().map(|&p| reach(&ellipse, p)).fold(0.0, f64::max);
            // The slimmest shapes have the most room.
            prop_assert!((1.0 - 1e-7..=1.0).contains(&farthest), "{}", farthest);
        }

        #[test]
        fn an_ellipse_around_ellipses_holds_their_rims(
            points in prop::collection::vec([0u32..1000, 0u32..1000, 0u32..30], 3..30),
            radius in 1.0..50.0f64,
        ) {
            let covariance = Moments::of(&points).covariance().expect("points");
            let discs: Vec<Ellipse> = relative(&points, &covariance)
                .iter()
                .map(|&middle| Ellipse { middle, axes: [radius * DVec3::X, 0.5 * radius * DVec3::Y] })
                .collect();
            let corners = discs.iter().flat_map(Ellipse::corners);
            let around = Ellipse::bounding(&covariance, covariance.offset, DVec3::Z, corners);
            for disc in &discs {
                for turn in 0..16 {
                    let (sine, cosine) = (f64::from(turn) * 0.4).sin_cos();
                    let rim = disc.middle + cosine * disc.axes[0] + sine * disc.axes[1];
                    prop_assert!(reach(&around, rim) <= 1.0 + 1e-12);
                }
            }
        }
    }

    #[test]
    fn an_evenly_filled_ellipse_is_found_with_its_axes() {
        // Half axes 4000 and 1000: the paper's formula would make that 16 : 1.
        let points: Vec<[u32; 3]> = (-80i32..=80)
            .flat_map(|x| (-20i32..=20).map(move |y| [x * 50, y * 50]))
            .filter(|[x, y]| (f64::from(*x) / 4000.0).hypot(f64::from(*y) / 1000.0) <= 1.0)
            .map(|[x, y]| [x, y, 0].map(|c| c.wrapping_add(1 << 30) as u32))
            .collect();
        let covariance = Moments::of(&points).covariance().expect("points");
        let near = relative(&points, &covariance);
        let ellipse = Ellipse::bounding(&covariance, covariance.offset, DVec3::Z, near);
        let [long, short] = ellipse.axes.map(DVec3::length);
        assert!(
            (long / 4000.0 - 1.0).abs() < 0.02 && (short / 1000.0 - 1.0).abs() < 0.02,
            "{long} {short}"
        );
    }

    #[test]
    fn points_that_are_one_or_on_a_line_have_an_ellipse_too() {
        let one = Moments::of(&[[3; 3]; 5]).covariance().expect("points");
        let ellipse = Ellipse::bounding(&one, DVec3::ZERO, DVec3::Z, [DVec3::ZERO]);
        assert_eq!(ellipse.axes, [DVec3::ZERO; 2]);
        let line: Vec<[u32; 3]> = (0..=10).map(|i| [1000 * i, 0, 0]).collect();
        let covariance = Moments::of(&line).covariance().expect("points");
        let near = relative(&line, &covariance);
        let ellipse = Ellipse::bounding(&covariance, covariance.offset, DVec3::Z, near);
        let [long, short] = ellipse.axes.map(DVec3::length);
        assert!((long - 5000.0).abs() < 1e-3 && short > 0.0 && short < 1e-3, "{long} {short}");
    }
}
