//! The usual shortcuts, as programs have them: what the table sets beside ours.

use glam::DVec3;

/// A covariance as xx, xy, xz, yy, yz, zz.
pub(super) type Entries = [f64; 6];

const PAIRS: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// `E[xy] - E[x] E[y]` in single precision, as the textbook and some libraries have it.
pub(super) fn covariance_f32(points: &[[f64; 3]]) -> Entries {
    let (mut sum, mut products) = ([0.0f32; 3], [0.0f32; 6]);
    for p in points {
        let p = p.map(|c| c as f32);
        (0..3).for_each(|a| sum[a] += p[a]);
        PAIRS.iter().zip(&mut products).for_each(|(&(a, b), product)| *product += p[a] * p[b]);
    }
    let n = points.len() as f32;
    let entry = |i: usize| products[i] / n - (sum[PAIRS[i].0] / n) * (sum[PAIRS[i].1] / n);
    std::array::from_fn(|i| f64::from(entry(i)))
}

/// The same in double precision.
pub(super) fn covariance_f64(points: &[[f64; 3]]) -> Entries {
    covariance_shifted_by(points, [0.0; 3])
}

/// The same with the first point as origin.
pub(super) fn covariance_shifted(points: &[[f64; 3]]) -> Entries {
    covariance_shifted_by(points, points.first().copied().unwrap_or_default())
}

fn covariance_shifted_by(points: &[[f64; 3]], by: [f64; 3]) -> Entries {
    let (mut sum, mut products) = ([0.0; 3], [0.0; 6]);
    for p in points {
        let p: [f64; 3] = std::array::from_fn(|a| p[a] - by[a]);
        (0..3).for_each(|a| sum[a] += p[a]);
        PAIRS.iter().zip(&mut products).for_each(|(&(a, b), product)| *product += p[a] * p[b]);
    }
    let n = points.len() as f64;
    std::array::from_fn(|i| products[i] / n - (sum[PAIRS[i].0] / n) * (sum[PAIRS[i].1] / n))
}

/// Means and centred products of halves, merged: the best that floats can do. (Chan, Golub, LeVeque
/// 1979)
pub(super) fn covariance_pairwise(points: &[[f64; 3]]) -> Entries {
    let (n, _, products) = pairwise(points);
    products.map(|product| product / n)
}

fn pairwise(points: &[[f64; 3]]) -> (f64, [f64; 3], Entries) {
    if let [] | [_] = points {
        return (points.len() as f64, points.first().copied().unwrap_or_default(), [0.0; 6]);
    }
    let (left, right) = points.split_at(points.len() / 2);
    let ((n, mean, products), (m, other, others)) = (pairwise(left), pairwise(right));
    let all = n + m;
    let step: [f64; 3] = std::array::from_fn(|a| other[a] - mean[a]);
    let mean = std::array::from_fn(|a| mean[a] + step[a] * m / all);
    let products = std::array::from_fn(|i| {
        let (a, b) = PAIRS[i];
        products[i] + others[i] + step[a] * step[b] * n * m / all
    });
    (all, mean, products)
}

/// Eigenvalues by trigonometry, ascending, as textbooks give the formula. (Smith 1961)
pub(super) fn eigenvalues_closed_form([xx, xy, xz, yy, yz, zz]: Entries) -> [f64; 3] {
    let q = (xx + yy + zz) / 3.0;
    let beside = xy * xy + xz * xz + yz * yz;
    let p = (((xx - q).powi(2) + (yy - q).powi(2) + (zz - q).powi(2) + 2.0 * beside) / 6.0).sqrt();
    let b = [xx - q, xy, xz, yy - q, yz, zz - q].map(|c| c / p);
    let determinant = b[0] * (b[3] * b[5] - b[4] * b[4]) - b[1] * (b[1] * b[5] - b[4] * b[2])
        + b[2] * (b[1] * b[4] - b[3] * b[2]);
    let third = (0.5 * determinant).acos() / 3.0;
    let most = q + 2.0 * p * third.cos();
    let least = q + 2.0 * p * (third + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    [least, 3.0 * q - most - least, most]
}

/// An eigenvector as the cross product of two rows of `matrix - value`, as closed forms have it: the
/// longest of the three.
pub(super) fn eigenvector_by_rows([xx, xy, xz, yy, yz, zz]: Entries, value: f64) -> DVec3 {
    let rows = [
        DVec3::new(xx - value, xy, xz),
        DVec3::new(xy, yy - value, yz),
        DVec3::new(xz, yz, zz - value),
    ];
    let crosses = [rows[0].cross(rows[1]), rows[0].cross(rows[2]), rows[1].cross(rows[2])];
    let longest =
        crosses.into_iter().max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()));
    longest.unwrap_or(DVec3::ZERO).normalize()
}
