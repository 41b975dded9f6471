//! Covariance sums, and their merging.

use lodestream_preprocess::numerics::Moments;

use super::Rows;
use crate::stability::{
    Row,
    clouds::{self, Cloud},
    exact::{Big, apart, rounded, whole},
    naive,
};

const REFERENCE: &str = "exact quotients of 512-bit integers";
const ROUNDINGS: &str = "three roundings, each half an ulp, of an entry that is exact before";
/// Of the largest entry.
const TOLERANCE: f64 = 2.0 * f64::EPSILON;
const UNIT: &str = "of the largest entry";

/// Parts that a cloud is cut into to be merged.
const PARTS: usize = 8;

pub(super) fn cases() -> Rows {
    let mut rows = Vec::new();
    for cloud in clouds::all() {
        rows.push(entries(&cloud));
        if cloud.points.len() >= PARTS {
            rows.push(merges(&cloud));
        }
    }
    rows.push(two_methods());
    Ok(rows)
}

/// xx, xy, xz, yy, yz, zz in lattice units squared.
fn exact(points: &[[u32; 3]]) -> [Big; 6] {
    let n = points.len() as i128;
    let sum = |a: usize| whole(points.iter().map(|q| i128::from(q[a])).sum());
    let entry = |a: usize, b: usize| {
        let products = points.iter().map(|q| i128::from(q[a]) * i128::from(q[b])).sum();
        (whole(n) * whole(products) - sum(a) * sum(b)) / whole(n * n)
    };
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}

/// Largest error of entries in multiples of `unit`, in the largest entry (in one unit, where all are
/// zero).
fn error(found: [f64; 6], exact: &[Big; 6], unit: f64) -> f64 {
    let largest = exact.iter().map(|e| rounded(e).abs()).fold(0.0, f64::max);
    let largest = if largest > 0.0 { largest } else { 1.0 };
    let errors = found.iter().zip(exact).map(|(&f, exact)| apart(f / unit, exact) / largest);
    errors.fold(0.0, f64::max)
}

fn entries(cloud: &Cloud) -> Row {
    let Some(covariance) = Moments::of(&cloud.points).covariance() else {
        return Row::holds(
            cloud.name,
            cloud.points.is_empty(),
            "no points have no mean, and that is what is said",
            "nothing",
        );
    };
    let exact = exact(&cloud.points);
    let world = cloud.world();
    let unit = cloud.lattice.scale * cloud.lattice.scale;
    let ours = error(covariance.matrix.entries(), &exact, 1.0);
    Row::new(cloud.name, (ours, UNIT), (TOLERANCE, ROUNDINGS), REFERENCE)
        .beside("single precision", error(naive::covariance_f32(&world), &exact, unit))
        .beside("double precision", error(naive::covariance_f64(&world), &exact, unit))
        .beside(
            "shifted by the first point",
            error(naive::covariance_shifted(&world), &exact, unit),
        )
        .beside("pairwise", error(naive::covariance_pairwise(&world), &exact, unit))
}

/// Sums of parts about corners of their own, moved and merged, against those of the whole.
fn merges(cloud: &Cloud) -> Row {
    let mut merged = Moments::default();
    for part in cloud.points.chunks(cloud.points.len().div_ceil(PARTS)) {
        let corner = part[0].map(i64::from);
        let mut moments = Moments::default();
        for q in part {
            moments.add(std::array::from_fn(|a| i64::from(q[a]) - corner[a]));
        }
        merged.merge(&moments.moved(corner));
    }
    let difference = usize::from(merged != Moments::of(&cloud.points));
    Row::new(
        format!("merged from {PARTS} parts: {}", cloud.name),
        (difference as f64, "differences"),
        (0.0, "sums of integers do not hang on their order"),
        "the sums of the whole",
    )
}

/// The covariance of the same points at the origin and far away: the same to the last bit, and
/// nowhere a variance below zero.
fn two_methods() -> Row {
    let Some(plane) = clouds::all().into_iter().find(|cloud| cloud.normal.is_some()) else {
        return Row::holds("negative variances", false, "there is a plane", "nothing");
    };
    let far: Vec<[u32; 3]> = plane.points.iter().map(|q| q.map(|c| c + 4_000_000_000)).collect();
    let of = |points: &[[u32; 3]]| Moments::of(points).covariance();
    let (near, far) = (of(&plane.points), of(&far));
    let is_same = near.zip(far).is_some_and(|(near, far)| {
        near.matrix == far.matrix && near.matrix.diagonal.iter().all(|&variance| variance >= 0.0)
    });
    let world = plane.world();
    let below_zero = |entries: [f64; 6]| {
        [entries[0], entries[3], entries[5]].iter().filter(|&&variance| variance < 0.0).count()
            as f64
    };
    Row::holds(
        "variances below zero (PCL #2403), the same points at two places",
        is_same,
        "the difference is taken between integers",
        "the same points at the origin, bit by bit",
    )
    .beside("single precision", below_zero(naive::covariance_f32(&world)))
    .beside("double precision", below_zero(naive::covariance_f64(&world)))
}
