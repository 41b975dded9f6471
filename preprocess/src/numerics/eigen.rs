//! The eigenproblem of a symmetric 3 x 3 matrix.
//!
//! Jacobi's rotations throughout, on a matrix scaled to entries of about one. The closed form by
//! trigonometry needs a quarter of the time, but loses half of the digits where eigenvalues are
//! nearly equal and all of them in its cross products where they are, takes `acos` of what rounding
//! put beyond one, and then needs this as a fallback. Finding sixteen neighbours of a point takes
//! thirty times as long as this does (all in a debug build).

use glam::DVec3;

use super::Symmetric3;

/// An eigenvalue of less than this times the largest cannot be told from zero: the entries of the
/// matrix are rounded themselves, by 2^-53 of the largest at least, and the rotations add as much a
/// few times over.
pub const RANK_TOLERANCE: f64 = 16.0 * f64::EPSILON;

/// Rotations converge quadratically: five or six sweeps do.
const MOST_SWEEPS: usize = 40;

/// In how many directions a set of points extends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rank {
    /// All points are one.
    Point,
    /// All points lie on a line.
    Line,
    /// All points lie in a plane.
    Plane,
    /// Points extend in all directions.
    Solid,
}

/// Eigenvalues and eigenvectors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eigen {
    /// Ascending.
    pub values: [f64; 3],
    /// Of the values, in their order: orthonormal and right-handed. The largest component of the
    /// second and of the third is positive. Where eigenvalues are equal, which vectors of their
    /// plane these are means nothing.
    pub vectors: [DVec3; 3],
}

impl Eigen {
    /// Solves; `None` where an entry is not finite.
    #[must_use]
    pub fn of(matrix: &Symmetric3) -> Option<Self> {
        if !matrix.is_finite() {
            return None;
        }
        let largest = matrix.largest();
        // By a power of two: exact, and no square over- or underflows that matters. Two factors, as
        // that of the smallest numbers is not representable.
        let exponent = if largest > 0.0 { largest.log2().floor() as i32 } else { 0 };
        let half = f64::from(exponent / 2).exp2();
        let rest = f64::from(exponent - exponent / 2).exp2();
        let mut a = matrix.scaled(1.0 / half).scaled(1.0 / rest);
        let mut vectors = [DVec3::X, DVec3::Y, DVec3::Z];
        for _ in 0..MOST_SWEEPS {
            if a.beside == [0.0; 3] {
                break;
            }
            for (p, q) in [(0, 1), (0, 2), (1, 2)] {
                rotate(&mut a, &mut vectors, p, q);
            }
        }
        let mut order = [0, 1, 2];
        order.sort_by(|&i, &j| a.diagonal[i].total_cmp(&a.diagonal[j]));
        let values = order.map(|i| a.diagonal[i] * half * rest);
        let [first, second, third] = order.map(|i| vectors[i].normalize());
        let (second, third) = (upright(second), upright(third));
        let is_right_handed = first.dot(second.cross(third)) > 0.0;
        let first = if is_right_handed { first } else { -first };
        Some(Self { values, vectors: [first, second, third] })
    }

    /// In how many directions the points extend of which this matrix is the covariance: how many
    /// eigenvalues are above [`RANK_TOLERANCE`] times the largest.
    #[must_use]
    pub fn rank(&self) -> Rank {
        let largest = self.values.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        let above = |value: &&f64| **value > RANK_TOLERANCE * largest;
        match self.values.iter().filter(above).count() {
            0 => Rank::Point,
            1 => Rank::Line,
            2 => Rank::Plane,
            _ => Rank::Solid,
        }
    }
}

/// Takes the entry (p, q) to zero. (Rutishauser 1966, in the form of Golub and Van Loan, 8.5)
fn rotate(a: &mut Symmetric3, vectors: &mut [DVec3; 3], p: usize, q: usize) {
    let r = 3 - p - q;
    // Named by the axis that it lacks.
    let across = a.beside[r];
    if across == 0.0 {
        return;
    }
    let (low, high) = (a.diagonal[p], a.diagonal[q]);
    // Too small to change either value: done. Both, so that a small eigenvalue beside a large one
    // keeps its own digits.
    if low + across == low && high + across == high {
        a.beside[r] = 0.0;
        return;
    }
    let theta = 0.5 * (high - low) / across;
    // Infinite where the angle is too small for its cosine to differ from one; then t is 0.
    let t = theta.signum() / (theta.abs() + theta.hypot(1.0));
    let cosine = 1.0 / t.hypot(1.0);
    let sine = t * cosine;
    let tau = sine / (1.0 + cosine);
    a.diagonal[p] = low - t * across;
    a.diagonal[q] = high + t * across;
    a.beside[r] = 0.0;
    // (r, p) lacks q, and (r, q) lacks p.
    let (rp, rq) = (a.beside[q], a.beside[p]);
    a.beside[q] = rp - sine * (rq + tau * rp);
    a.beside[p] = rq + sine * (rp - tau * rq);
    let (vp, vq) = (vectors[p], vectors[q]);
    vectors[p] = vp - sine * (vq + tau * vp);
    vectors[q] = vq + sine * (vp - tau * vq);
}

/// Of the two unit vectors of an axis, the one whose largest component is positive.
fn upright(v: DVec3) -> DVec3 {
    let magnitude = v.abs();
    let largest = magnitude.max_element();
    let first = magnitude.to_array().into_iter().position(|c| c == largest).unwrap_or(0);
    if v[first] < 0.0 { -v } else { v }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Largest component of `matrix v - value v` over all three pairs.
    fn residual(eigen: &Eigen, matrix: &Symmetric3) -> f64 {
        let pairs = eigen.values.iter().zip(eigen.vectors);
        let rest = pairs.map(|(&value, v)| (matrix.apply(v) - value * v).abs().max_element());
        rest.fold(0.0, f64::max)
    }

    fn check(matrix: &Symmetric3) {
        let eigen = Eigen::of(matrix).expect("finite");
        let largest = matrix.largest();
        assert!(eigen.values.is_sorted(), "{eigen:?}");
        assert!(residual(&eigen, matrix) <= 8.0 * f64::EPSILON * largest, "{matrix:?} {eigen:?}");
        let [u, v, w] = eigen.vectors;
        for (length, cross) in
            [(u.length(), u.dot(v)), (v.length(), v.dot(w)), (w.length(), w.dot(u))]
        {
            assert!((length - 1.0).abs() < 4e-16 && cross.abs() < 2e-15, "{eigen:?}");
        }
        assert!((u.cross(v) - w).length() < 4e-15, "right-handed: {eigen:?}");
    }

    proptest! {
        #[test]
        fn every_matrix_is_solved(entries in prop::array::uniform6(-1.0..1.0), exponent in -1000i32..1000) {
            // Six entries and one size; where that is beyond an f64's, nothing but zero remains.
            check(&Symmetric3::new(entries).scaled(f64::from(exponent).exp2()));
        }

        #[test]
        fn entries_of_very_different_sizes_are_no_trouble(
            entries in prop::array::uniform6((-1.0..1.0, -60i32..60)),
        ) {
            check(&Symmetric3::new(entries.map(|(m, e)| m * f64::from(e).exp2())));
        }
    }

    #[test]
    fn the_matrix_that_closed_forms_fail_on_is_solved() {
        let eigen = Eigen::of(&Symmetric3::new([2000.0, 0.0, 0.0, 1.0, 0.0, 0.0])).expect("finite");
        assert_eq!(eigen.values, [0.0, 1.0, 2000.0]);
        assert_eq!(eigen.vectors.map(DVec3::abs), [DVec3::Z, DVec3::Y, DVec3::X]);
        assert_eq!(eigen.rank(), Rank::Plane);
    }

    #[test]
    fn ranks_are_named() {
        let rank =
            |x, y, z| Eigen::of(&Symmetric3::new([x, 0.0, 0.0, y, 0.0, z])).expect("finite").rank();
        assert_eq!(rank(0.0, 0.0, 0.0), Rank::Point);
        assert_eq!(rank(1e-300, 0.0, 0.0), Rank::Line);
        assert_eq!(rank(0.0, 4.0, 4.0), Rank::Plane);
        assert_eq!(rank(1.0, 1e-16, 1.0), Rank::Plane);
        assert_eq!(rank(1.0, 1e-12, 1.0), Rank::Solid);
    }

    #[test]
    fn what_is_no_number_has_no_solution() {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(Eigen::of(&Symmetric3::new([1.0, 0.0, 0.0, bad, 0.0, 1.0])), None);
            assert_eq!(Eigen::of(&Symmetric3::new([1.0, 0.0, bad, 1.0, 0.0, 1.0])), None);
        }
    }

    #[test]
    fn a_small_eigenvalue_beside_a_large_one_keeps_its_digits() {
        let eigen = Eigen::of(&Symmetric3::new([1.0, 0.0, 0.0, 1.0, 0.0, 1e-15])).expect("finite");
        assert_eq!(eigen.values, [1e-15, 1.0, 1.0]);
    }

    #[test]
    fn the_smallest_and_largest_numbers_are_solved() {
        for size in [f64::from_bits(1), f64::MIN_POSITIVE, f64::MAX / 4.0] {
            let eigen =
                Eigen::of(&Symmetric3::new([size, 0.0, 0.0, size, 0.0, 0.0])).expect("finite");
            assert_eq!(eigen.values, [0.0, size, size]);
        }
    }
}
