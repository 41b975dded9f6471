//! Unit vectors and cones of normals.

use glam::DVec3;
use lodestream_protocol::NormalCone;

use super::Rows;
use crate::stability::{
    Row,
    exact::{Big, Big3, big3, cross, dot, length, rounded, unit, whole},
};

const REFERENCE: &str = "the direction in 512-bit floats";
const SINGLE: &str = "unit vectors are kept in single precision";

pub(super) fn cases() -> Rows {
    let lengths = [
        ("of length 1", 1.0),
        ("of length 10^-30", 1e-30),
        ("of length 10^-200 (squares underflow)", 1e-200),
        ("denormal", 1e-310),
        ("of length 10^200 (squares overflow)", 1e200),
        ("the largest", f64::MAX / 2.0),
    ];
    let mut rows: Vec<Row> =
        lengths.into_iter().map(|(case, size)| direction(case, size)).collect();
    let up = [0.0, 0.0, 1.0];
    let none = [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0], [-0.0; 3]];
    let refused = none.iter().all(|&n| {
        let unit = NormalCone::unit(n);
        unit == [0.0; 3] && NormalCone::of_units(up, [unit]) == NormalCone::ANY
    });
    let shortcut = none.iter().filter(|&&n| !naive_unit(n).is_nan()).count();
    rows.push(
        Row::holds(
            "zero, NaN and infinite",
            refused,
            "what has no direction has none, and is in no cone but that of any",
            "nothing",
        )
        .beside("v / |v| (NaN)", (none.len() - shortcut) as f64),
    );
    rows.push(opposite());
    Ok(rows)
}

fn naive_unit(n: [f64; 3]) -> DVec3 {
    let n = DVec3::from(n);
    n / n.length()
}

fn direction(case: &'static str, size: f64) -> Row {
    let normal = [0.48 * size, -0.6 * size, 0.64 * size];
    let exact = unit(&big3(normal));
    let angle = |found: Big3| rounded(&length(&cross(&found, &exact)));
    let ours = angle(big3(NormalCone::unit(normal).map(f64::from)));
    let shortcut = naive_unit(normal);
    let shortcut = if shortcut.is_finite() { angle(big3(shortcut)) } else { f64::INFINITY };
    Row::new(case, (ours, "rad"), (f64::from(f32::EPSILON), SINGLE), REFERENCE)
        .beside("v / |v|", shortcut)
}

/// Whether a normal lies inside of what the three bytes mean, by the format's own words.
fn is_inside(cone: NormalCone, normal: [f64; 3]) -> bool {
    if cone.to_bytes()[2] == u8::MAX || normal == [0.0; 3] {
        // What has no direction is in no other.
        return cone.to_bytes()[2] == u8::MAX;
    }
    let [u, v, angle] = cone.to_bytes().map(|byte| whole(byte.into()));
    let (one, signed) = (whole(1), |c: Big| c * whole(2) / whole(255) - whole(1));
    let (u, v) = (signed(u), signed(v));
    let size = |c: &Big| if *c < whole(0) { -c } else { c.clone() };
    let z = &one - size(&u) - size(&v);
    let fold = |c: &Big, other: &Big| {
        let folded = &one - size(other);
        if *c < whole(0) { -folded } else { folded }
    };
    let axis = if z < whole(0) { [fold(&u, &v), fold(&v, &u), z] } else { [u, v, z] };
    let normal = big3(normal);
    // Half a turn is the angle between opposite vectors.
    let half_turn = whole(0).atan2(&whole(-1));
    let apart = length(&cross(&axis, &normal)).atan2(&dot(&axis, &normal));
    apart <= angle * half_turn / whole(255)
}

/// A cone of normals all around holds them all.
fn opposite() -> Row {
    let normals: Vec<[f64; 3]> = (0..1000)
        .map(|i| {
            // Evenly on the sphere, the poles among them.
            let z = 1.0 - 2.0 * f64::from(i) / 999.0;
            let (sine, cosine) = (f64::from(i) * 2.399_963).sin_cos();
            let across = (1.0 - z * z).max(0.0).sqrt();
            [across * cosine, across * sine, z]
        })
        .collect();
    let mut lost = 0;
    for spread in [0.0, 1e-9, 1e-3, 0.1, 1.0] {
        let near = |n: &[f64; 3]| [spread * n[0], spread * n[1], 1.0 + spread * n[2]];
        let all: Vec<[f64; 3]> = normals.iter().map(near).collect();
        let cone = NormalCone::of_units([0.0, 0.0, 1.0], all.iter().map(|&n| NormalCone::unit(n)));
        lost += all.iter().filter(|&&n| !is_inside(cone, n)).count();
    }
    Row::new(
        "cones from a point to all directions",
        (lost as f64, "normals outside"),
        (0.0, "both roundings widen the cone"),
        "the bytes as the format has them, in 512-bit floats",
    )
}
