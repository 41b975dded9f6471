//! Bounding ellipses.

use fastrand::Rng;
use glam::DVec3;
use lodestream_preprocess::numerics::{Covariance, Ellipse, Moments};

use super::Rows;
use crate::stability::{
    Row,
    exact::{Big, big, big3, dot, minus, relative, rounded, whole},
};

const REFERENCE: &str = "the roots of the characteristic polynomial, in 512-bit floats";
const ROUNDINGS: &str = "the rounding of the covariance, by the square of the ratio";

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(7);
    let mut rows = Vec::new();
    let shapes: [(&'static str, [i64; 2], u32); 6] = [
        ("4 : 1 at the origin", [4000, 1000], 0),
        ("4 : 1 far away", [4000, 1000], 4_000_000_000),
        ("a circle", [3000, 3000], 1_000_000),
        ("1000 : 1", [2_000_000, 2000], 1_000_000),
        ("10^6 : 1", [100_000_000, 100], 1_000_000),
        ("nearly a circle (1 part in 10^6)", [1_000_000, 1_000_001], 1_000_000),
    ];
    for (name, half_axes, corner) in shapes {
        let points = filled(&mut rng, half_axes, corner);
        rows.push(ratio(name, &points));
        rows.push(bound(name, &points));
    }
    let line: Vec<[u32; 3]> = (0..50).map(|i| [5000 * i, 3000 * i, 7]).collect();
    rows.push(bound("collinear", &line));
    rows.push(bound("a thousand duplicates", &vec![[4_000_000_000; 3]; 1000]));
    rows.push(bound("one point", &[[7, 8, 9]]));
    Ok(rows)
}

/// Points of a plane of constant z, evenly in an ellipse that lies aslant (along (3, 4)), in pairs
/// about its middle.
fn filled(rng: &mut Rng, half_axes: [i64; 2], corner: u32) -> Vec<[u32; 3]> {
    let mut points = Vec::new();
    while points.len() < 800 {
        let at = half_axes.map(|half| rng.i64(-half..=half));
        let reach = (at[0] as f64 / half_axes[0] as f64).hypot(at[1] as f64 / half_axes[1] as f64);
        if reach > 1.0 {
            continue;
        }
        let slanted = [3 * at[0] - 4 * at[1], 4 * at[0] + 3 * at[1]];
        let reach = 4 * (half_axes[0] + half_axes[1]);
        for sign in [1, -1] {
            let place = |a: usize| {
                let c = i64::from(corner) + reach + sign * slanted[a];
                u32::try_from(c).expect("cases are inside the range")
            };
            points.push([place(0), place(1), corner]);
        }
    }
    points
}

fn around(points: &[[u32; 3]]) -> Option<(Covariance, Ellipse, Vec<DVec3>)> {
    let covariance = Moments::of(points).covariance()?;
    let near: Vec<DVec3> = points
        .iter()
        .map(|q| {
            DVec3::from(std::array::from_fn(|a| (i64::from(q[a]) - covariance.center[a]) as f64))
        })
        .collect();
    let ellipse = Ellipse::bounding(&covariance, covariance.offset, DVec3::Z, near.iter().copied());
    Some((covariance, ellipse, near))
}

/// The ratio of the axes.
fn ratio(name: &str, points: &[[u32; 3]]) -> Row {
    // Entries of the covariance, times n².
    let n = points.len() as i128;
    let sum = |a: usize| points.iter().map(|q| i128::from(q[a])).sum::<i128>();
    let entry = |a: usize, b: usize| {
        let products: i128 = points.iter().map(|q| i128::from(q[a]) * i128::from(q[b])).sum();
        whole(n) * whole(products) - whole(sum(a)) * whole(sum(b))
    };
    let (xx, xy, yy) = (entry(0, 0), entry(0, 1), entry(1, 1));
    let half = (&xx + &yy) / whole(2);
    let root = ((&xx - &yy) * (&xx - &yy) / whole(4) + &xy * &xy).sqrt();
    let exact: Big = ((&half + &root) / (&half - &root)).sqrt();
    let ours = around(points).map_or(f64::INFINITY, |(_, ellipse, _)| {
        let [long, short] = ellipse.axes.map(DVec3::length);
        relative(long / short, &exact)
    });
    // As printed: λ² + trace λ + det = 0, and axes that go with eigenvalues.
    let [xx, xy, yy] = [xx, xy, yy].map(|entry| rounded(&(entry / whole(n * n))));
    let (trace, determinant) = (xx + yy, xx * yy - xy * xy);
    let discriminant = (0.25 * trace * trace - determinant).max(0.0).sqrt();
    let printed = [-0.5 * trace + discriminant, -0.5 * trace - discriminant].map(f64::sqrt);
    let axes_by_value = (0.5 * trace + discriminant) / (0.5 * trace - discriminant);
    let largest = rounded(&exact).powi(2);
    Row::new(
        format!("ratio of the axes, {name}"),
        (ours, "of the ratio"),
        (16.0 * f64::EPSILON * largest.max(1.0), ROUNDINGS),
        REFERENCE,
    )
    .beside("eq. 5 as printed", relative(printed[1] / printed[0], &exact))
    .beside("axes by eigenvalue, not its root", relative(axes_by_value, &exact))
}

/// Whether all points are inside, and the ellipse no larger than it must be.
fn bound(name: &str, points: &[[u32; 3]]) -> Row {
    let Some((_, ellipse, near)) = around(points) else {
        return Row::holds(name, false, "there are points", REFERENCE);
    };
    let [u, v] = ellipse.axes.map(big3);
    let (uu, vv) = (dot(&u, &u), dot(&v, &v));
    let middle = big3(ellipse.middle);
    let mut farthest = whole(0);
    for &point in &near {
        let d = minus(&big3(point), &middle);
        let part = |axis: &[Big; 3], square: &Big| {
            let along = dot(&d, axis);
            if *square == whole(0) { big(0.0) } else { &along * &along / square / square }
        };
        let reach = part(&u, &uu) + part(&v, &vv);
        if reach > farthest {
            farthest = reach;
        }
    }
    let farthest = farthest.sqrt();
    // A point outside is none too few; room to spare counts as what it is.
    let is_one = near.iter().all(|&point| point == ellipse.middle) && uu == whole(0);
    let excess = rounded(&farthest) - 1.0;
    let error = if is_one {
        0.0
    } else if excess > 0.0 {
        f64::INFINITY
    } else {
        -excess
    };
    let ratio = if vv == whole(0) { 1.0 } else { rounded(&(&uu / &vv)).sqrt() };
    Row::new(
        format!("points inside, {name}"),
        (error, "of the radius"),
        (16.0 * f64::EPSILON * ratio, "no point is outside; room for the rounding of the axes"),
        "the equation of the ellipse, in 512-bit floats",
    )
}
