//! Means and covariances from exact sums.
//!
//! The textbook's `E[xy] - E[x] E[y]` cancels: far from the origin both terms are large, nearly
//! equal, and rounded. Here the difference is taken between integers, and is rounded once.

use glam::DVec3;

use super::{Eigen, Moments, Symmetric3};

/// Largest integer part whose fraction is kept: below, the sum of both is exact in an i128.
const SMALL: u128 = 1 << 60;

/// Mean and covariance of a set of points, lattice units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance {
    /// How many points there are; at least one.
    pub count: u64,
    /// The lattice point nearest to the mean, from the origin of the [`Moments`].
    pub center: [i64; 3],
    /// From there to the mean: at most half a unit on each axis.
    pub offset: DVec3,
    /// The covariance (divided by the number of points), lattice units squared. Each entry is within
    /// 2 ulp of the exact one: three roundings.
    pub matrix: Symmetric3,
}

impl Covariance {
    pub(super) fn of(moments: &Moments) -> Option<Self> {
        let count = moments.count();
        if count == 0 {
            return None;
        }
        let n = i128::from(count);
        // Rounded to the nearest.
        let center = moments.sum().map(|sum| (2 * sum + n).div_euclid(2 * n) as i64);
        let near = moments.moved(center.map(|c| -c));
        let sum = near.sum();
        let [xx, xy, xz, yy, yz, zz] = near.products();
        let entry = |product: i128, a: usize, b: usize| {
            // n times the covariance is `product - sum[a] sum[b] / n`: a whole part and a fraction.
            // Sums are at most n / 2 now, so that their product fits.
            let square = sum[a] * sum[b];
            let whole = product - square.div_euclid(n);
            let rest = square.rem_euclid(n);
            if whole.unsigned_abs() < SMALL {
                (whole * n - rest) as f64 / n as f64 / n as f64
            } else {
                // The fraction is less than an ulp of the whole.
                whole as f64 / n as f64
            }
        };
        let matrix = Symmetric3::new([
            entry(xx, 0, 0),
            entry(xy, 0, 1),
            entry(xz, 0, 2),
            entry(yy, 1, 1),
            entry(yz, 1, 2),
            entry(zz, 2, 2),
        ]);
        let offset = DVec3::from(sum.map(|sum| sum as f64 / n as f64));
        Some(Self { count, center, offset, matrix })
    }

    /// The mean square products about another place than the mean, given from [`center`]:
    /// Pajarola's covariance with respect to an arbitrary centre (Pajarola 2003, eq. 2).
    ///
    /// [`center`]: Self::center
    #[must_use]
    pub fn about(&self, place: DVec3) -> Symmetric3 {
        let d = self.offset - place;
        let mut matrix = self.matrix;
        for (entry, c) in matrix.diagonal.iter_mut().zip(d.to_array()) {
            *entry += c * c;
        }
        for (entry, c) in matrix.beside.iter_mut().zip([d.y * d.z, d.x * d.z, d.x * d.y]) {
            *entry += c;
        }
        matrix
    }

    /// Variances along the principal axes (none below zero), and these.
    #[must_use]
    pub fn principal(&self) -> Eigen {
        let mut eigen =
            Eigen::of(&self.matrix).expect("quotients of integers below 2^123 are finite");
        // A variance is not negative; where rounding says so, it is zero.
        eigen.values = eigen.values.map(|value| value.max(0.0));
        eigen
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The covariance of integers as a fraction of n².
    fn numerators(points: &[[u32; 3]]) -> [i128; 6] {
        let n = points.len() as i128;
        let of = |a: usize| points.iter().map(move |q| i128::from(q[a]));
        let pair = |a: usize, b: usize| {
            let product: i128 = of(a).zip(of(b)).map(|(x, y)| x * y).sum();
            n * product - of(a).sum::<i128>() * of(b).sum::<i128>()
        };
        [pair(0, 0), pair(0, 1), pair(0, 2), pair(1, 1), pair(1, 2), pair(2, 2)]
    }

    proptest! {
        #[test]
        fn entries_are_the_exact_ones_rounded(
            corner in any::<[u32; 3]>(),
            points in prop::collection::vec(any::<[u32; 3]>(), 1..50), bits in 0u32..=32,
        ) {
            let mask = u32::try_from((1u64 << bits) - 1).expect("32 bits");
            let points: Vec<[u32; 3]> = points
                .iter()
                .map(|q| std::array::from_fn(|a| (corner[a] & !mask) + (q[a] & mask)))
                .collect();
            let covariance = Moments::of(&points).covariance().expect("points");
            let n = points.len() as f64;
            for (found, exact) in covariance.matrix.entries().iter().zip(numerators(&points)) {
                let exact = exact as f64 / (n * n);
                prop_assert!((found - exact).abs() <= 1e-15 * exact.abs(), "{} for {}", found, exact);
            }
            prop_assert!(covariance.offset.abs().max_element() <= 0.5);
            prop_assert!(covariance.principal().values[0] >= 0.0);
        }

        #[test]
        fn about_the_mean_is_the_covariance(
            points in prop::collection::vec([0u32..1000, 0u32..1000, 0u32..1000], 1..20),
        ) {
            let covariance = Moments::of(&points).covariance().expect("points");
            prop_assert_eq!(covariance.about(covariance.offset), covariance.matrix);
            // About any place, it is what the definition says.
            let place = DVec3::new(3.0, -2.0, 0.5);
            let center = DVec3::from(covariance.center.map(|c| c as f64));
            let mean = points.iter().map(|q| {
                let d = DVec3::from(q.map(f64::from)) - center - place;
                d.x * d.z
            }).sum::<f64>() / points.len() as f64;
            prop_assert!((covariance.about(place).entries()[2] - mean).abs() < 1e-6);
        }
    }

    #[test]
    fn no_points_have_no_mean_and_one_has_itself() {
        assert_eq!(Moments::default().covariance(), None);
        let one = Moments::of(&[[7, u32::MAX, 0]]).covariance().expect("a point");
        assert_eq!((one.center, one.offset), ([7, i64::from(u32::MAX), 0], DVec3::ZERO));
        assert_eq!(one.matrix, Symmetric3::default());
    }
}
