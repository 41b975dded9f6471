//! The symmetric eigenproblem.

use fastrand::Rng;
use glam::{DMat3, DQuat, DVec3};
use lodestream_preprocess::numerics::{Eigen, Rank, Symmetric3};

use super::Rows;
use crate::stability::{
    Row,
    exact::{Big, Big3, apart, big, big3, dot, length, rounded, whole},
    naive,
};

const REFERENCE: &str = "the residual of the pairs, in 512-bit floats";
const BACKWARD: &str =
    "the entries' own rounding, a few times over: five sweeps of three rotations";
/// Of the largest entry.
const TOLERANCE: f64 = 8.0 * f64::EPSILON;
const UNIT: &str = "of the largest entry";

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(6);
    let tilt = DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 0.7);
    let diagonal = |x, y, z| Symmetric3::new([x, 0.0, 0.0, y, 0.0, z]);
    let turned = |x, y, z| turned(tilt, [x, y, z]);
    let random = Symmetric3::new(std::array::from_fn(|_| rng.f64() - 0.5));
    let graded = std::array::from_fn(|i| [1.0, 1e-8, 1e-12, 1e-16, 1e-20, 1e-30][i]);
    let matrices = [
        ("diag(2000, 1, 0) (no number elsewhere)", diagonal(2000.0, 1.0, 0.0)),
        ("eigenvalues 1 : 1 : 10^-15", turned(1.0, 1.0, 1e-15)),
        ("eigenvalues 1 : 10^-15 : 10^-15", turned(1.0, 1e-15, 1e-15)),
        ("eigenvalues nearly equal (1 part in 10^15)", turned(1.0, 1.0 + 1e-15, 1.0 + 2e-15)),
        ("eigenvalues nearly equal (1 part in 10^8)", turned(1.0, 1.0 + 1e-8, 1.0 - 1e-8)),
        ("two equal eigenvalues", turned(3.0, 3.0, 1.0)),
        ("three equal eigenvalues", diagonal(5.0, 5.0, 5.0)),
        ("needle, aspect 10^6", turned(1e12, 1.0, 1.0)),
        ("sheet, aspect 10^6", turned(1e12, 1e12, 1.0)),
        ("entries of 10^-300", turned(1.0, 2.0, 3.0).scaled(1e-300)),
        ("entries of 10^300", turned(1.0, 2.0, 3.0).scaled(1e300)),
        ("denormal entries", diagonal(f64::from_bits(3), f64::from_bits(1), 0.0)),
        ("graded, 1 to 10^-30", Symmetric3::new(graded)),
        ("all ones (rank one)", Symmetric3::new([1.0; 6])),
        ("zero", diagonal(0.0, 0.0, 0.0)),
        ("at random, of both signs", random),
    ];
    let mut rows: Vec<Row> =
        matrices.into_iter().map(|(case, matrix)| row(case, &matrix)).collect();
    rows.extend(names());
    Ok(rows)
}

/// A matrix with these eigenvalues, rounded.
fn turned(by: DQuat, values: [f64; 3]) -> Symmetric3 {
    let axes = DMat3::from_quat(by);
    let matrix = axes * DMat3::from_diagonal(values.into()) * axes.transpose();
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    Symmetric3::new([x.x, x.y, x.z, y.y, y.z, z.z])
}

fn row(case: &'static str, matrix: &Symmetric3) -> Row {
    let largest = matrix.largest();
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let Some(eigen) = Eigen::of(matrix) else {
        return Row::holds(case, false, "finite matrices have a solution", REFERENCE);
    };
    let pairs: Vec<(f64, DVec3)> = eigen.values.into_iter().zip(eigen.vectors).collect();
    let ours = residual(matrix, &pairs, largest);
    let values = naive::eigenvalues_closed_form(matrix.entries());
    let pairs = values.map(|value| (value, naive::eigenvector_by_rows(matrix.entries(), value)));
    Row::new(case, (ours, UNIT), (TOLERANCE, BACKWARD), REFERENCE)
        .beside("closed form, double precision", residual(matrix, &pairs, largest))
}

/// Largest of: residuals in the largest entry, and how far the vectors are from orthonormal.
/// Infinite where something is no number.
fn residual(matrix: &Symmetric3, pairs: &[(f64, DVec3)], largest: f64) -> f64 {
    let finite = |(value, v): &(f64, DVec3)| value.is_finite() && v.is_finite();
    if !pairs.iter().all(finite) {
        return f64::INFINITY;
    }
    let [xx, xy, xz, yy, yz, zz] = matrix.entries().map(big);
    let rows = [[xx, xy.clone(), xz.clone()], [xy, yy, yz.clone()], [xz, yz, zz]];
    let vectors: Vec<Big3> = pairs.iter().map(|(_, v)| big3(*v)).collect();
    let mut worst = 0.0f64;
    for (i, (value, _)) in pairs.iter().enumerate() {
        let v = &vectors[i];
        let off: Big3 = std::array::from_fn(|a| dot(&rows[a], v) - big(*value) * &v[a]);
        // Both in the reference: the length of the smallest numbers is not one of theirs.
        worst = worst.max(rounded(&(length(&off) / big(largest))));
        for (j, other) in vectors.iter().enumerate() {
            let expected: Big = whole(i128::from(i == j));
            worst = worst
                .max(rounded(&dot(v, other)) - rounded(&expected))
                .max(apart_from(v, other, &expected));
        }
    }
    worst
}

fn apart_from(a: &Big3, b: &Big3, expected: &Big) -> f64 {
    apart(0.0, &(dot(a, b) - expected))
}

/// Ranks are named, and what is no number is refused.
fn names() -> Vec<Row> {
    let of = |x, y, z| Eigen::of(&Symmetric3::new([x, 0.0, 0.0, y, 0.0, z]));
    let rank = |x, y, z| of(x, y, z).map(|eigen| eigen.rank());
    let ranks = rank(0.0, 0.0, 0.0) == Some(Rank::Point)
        && rank(1e-300, 0.0, 0.0) == Some(Rank::Line)
        && rank(4.0, 0.0, 4.0) == Some(Rank::Plane)
        && rank(1.0, 1e-12, 1e-12) == Some(Rank::Solid);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    vec![
        Row::holds(
            "ranks 0, 1, 2, 3 are named",
            ranks,
            "what cannot be told from zero is zero, beside the largest",
            "matrices of known rank",
        ),
        Row::holds(
            "NaN and infinite entries",
            bad.into_iter().all(|entry| of(1.0, entry, 1.0).is_none()),
            "no solution, and that is what is said",
            "nothing",
        ),
    ]
}
