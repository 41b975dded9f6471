//! Exact sums over lattice points: how many, their coordinates, and all products of two of them.
//!
//! That is Pajarola's *generic homogeneous covariance matrix* (Pajarola 2003, eqs. 2 to 4): for
//! points `p = (x, y, z, 1)` the 4 x 4 sum of `p pᵀ`. Its use is that sums of parts are the sum of
//! the whole; in floats its price is that it is dominated by where the origin is. Here it is
//! integers, and has no price.

use super::Covariance;

/// Pairs of axes in the order of [`Moments::products`].
const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// Exact sums over a set of points, about an origin that their owner knows.
///
/// Nothing overflows for up to 2^40 points whose coordinates, before and after any
/// [move](Self::moved), are less than 2^41 lattice units from the origin: the largest sum is then
/// below 2^123.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Moments {
    count: u64,
    sum: [i128; 3],
    /// xx, xy, xz, yy, yz, zz.
    products: [i128; 6],
}

impl Moments {
    /// The sums over lattice points.
    #[must_use]
    pub fn of<'a>(points: impl IntoIterator<Item = &'a [u32; 3]>) -> Self {
        let mut moments = Self::default();
        points.into_iter().for_each(|q| moments.add(q.map(i64::from)));
        moments
    }

    /// Takes in a point: lattice units from the origin.
    pub fn add(&mut self, q: [i64; 3]) {
        let q = q.map(i128::from);
        self.count += 1;
        for a in 0..3 {
            self.sum[a] += q[a];
        }
        for (product, (a, b)) in self.products.iter_mut().zip(PAIRS) {
            *product += q[a] * q[b];
        }
    }

    /// Takes in the sums over other points about the same origin. (Pajarola 2003, eq. 4)
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        for a in 0..3 {
            self.sum[a] += other.sum[a];
        }
        for (mine, other) in self.products.iter_mut().zip(other.products) {
            *mine += other;
        }
    }

    /// The sums over the same points, all moved by as many lattice units: from a child's origin to
    /// its parent's, say. (Pajarola 2003, eq. 3, of which this is the translation)
    #[must_use]
    pub fn moved(&self, by: [i64; 3]) -> Self {
        let by = by.map(i128::from);
        let count = i128::from(self.count);
        let sum = std::array::from_fn(|a| self.sum[a] + count * by[a]);
        let mut products = self.products;
        for (product, (a, b)) in products.iter_mut().zip(PAIRS) {
            // Σ (p + d)(q + e) = Σ pq + e Σ p + d Σ q + n d e
            *product += by[b] * self.sum[a] + by[a] * sum[b];
        }
        Self { count: self.count, sum, products }
    }

    /// How many points there are.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }

    /// Sum of the coordinates.
    #[must_use]
    pub const fn sum(&self) -> [i128; 3] {
        self.sum
    }

    /// Sums of the products of two coordinates: xx, xy, xz, yy, yz, zz.
    #[must_use]
    pub const fn products(&self) -> [i128; 6] {
        self.products
    }

    /// Mean and covariance; `None` where there are no points.
    #[must_use]
    pub fn covariance(&self) -> Option<Covariance> {
        Covariance::of(self)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn sums_of_parts_are_the_sum_of_the_whole_whatever_their_origins(
            points in prop::collection::vec(any::<[u32; 3]>(), 0..40),
            cut in 0usize..40,
            by in [-(1i64 << 40)..1 << 40, -(1i64 << 40)..1 << 40, -(1i64 << 40)..1 << 40],
        ) {
            let (left, right) = points.split_at(cut.min(points.len()));
            let mut parts = Moments::of(left);
            parts.merge(&Moments::of(right));
            let whole = Moments::of(&points);
            prop_assert_eq!(parts, whole);
            prop_assert_eq!(whole.moved(by).moved(by.map(|d| -d)), whole);
            let mut moved = Moments::default();
            points.iter().for_each(|q| {
                moved.add(std::array::from_fn(|a| i64::from(q[a]) + by[a]));
            });
            prop_assert_eq!(whole.moved(by), moved);
        }
    }

    #[test]
    fn nothing_overflows_at_the_bounds() {
        let mut far = Moments::default();
        far.add([(1 << 41) - 1; 3]);
        let mut all = far;
        // 2^40 points by doubling.
        for _ in 0..40 {
            let again = all;
            all.merge(&again);
        }
        assert_eq!(all.count(), 1 << 40);
        assert_eq!(all.products()[0], (1i128 << 40) * ((1i128 << 41) - 1).pow(2));
        let covariance = all.covariance().expect("points");
        assert_eq!(covariance.matrix.entries(), [0.0; 6]);
    }
}
