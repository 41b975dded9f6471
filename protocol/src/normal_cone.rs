//! Normal cones: where the normals of a node and of all below it point, in three bytes.
//!
//! Renderers leave out nodes that face away, or aggregate what faces alike, without looking at any
//! normal. So a cone is never too narrow: both roundings, that of the axis and that of the angle,
//! widen it. `FORMAT.md` ("Normal cones") says what the bytes mean.

use std::f64::consts::PI;

/// The cone of a set of normals: an axis and the largest angle of a normal from it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NormalCone([u8; 3]);

/// Angles are measured from unit vectors in single precision. Their lengths differ by 1e-7, which
/// moves a cosine as much, and so an angle near 0 or pi by up to 5e-4.
const ANGLE_ERROR: f64 = 1e-3;

impl NormalCone {
    /// Holds every direction, and normals that have none.
    pub const ANY: Self = Self([128, 128, 255]);

    /// The cone that three bytes of a hierarchy page mean: any do.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 3]) -> Self {
        Self(bytes)
    }

    /// The bytes of a hierarchy page.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 3] {
        self.0
    }

    /// The cone around `axis` (of any length) that holds all `units`, as [`unit`](Self::unit)
    /// gives them. One of them without direction makes it [`ANY`](Self::ANY), as does an axis
    /// without direction.
    #[must_use]
    pub fn of_units(axis: [f64; 3], units: impl IntoIterator<Item = [f32; 3]>) -> Self {
        let Some(axis) = quantize(axis) else { return Self::ANY };
        let direction = expand(axis);
        let mut least = 1.0;
        let mut farthest = direction;
        for unit in units {
            if unit == [0.0; 3] {
                return Self::ANY;
            }
            let unit = unit.map(f64::from);
            let cosine = dot(unit, direction);
            if cosine < least {
                (least, farthest) = (cosine, unit);
            }
        }
        Self::new(axis, angle(direction, farthest) + ANGLE_ERROR)
    }

    /// The cone around `axis` (of any length) that holds all `cones`. An axis without direction
    /// makes it [`ANY`](Self::ANY).
    #[must_use]
    pub fn of_cones(axis: [f64; 3], cones: impl IntoIterator<Item = Self>) -> Self {
        let Some(axis) = quantize(axis) else { return Self::ANY };
        let direction = expand(axis);
        let reach = |cone: Self| angle(direction, cone.axis()) + cone.half_angle();
        Self::new(axis, cones.into_iter().map(reach).fold(0.0, f64::max) + ANGLE_ERROR)
    }

    /// The direction of a normal of any length; zero where it has none (its length is zero or not
    /// finite).
    #[must_use]
    pub fn unit(normal: [f64; 3]) -> [f32; 3] {
        normalized(normal).map_or([0.0; 3], |unit| unit.map(|c| c as f32))
    }

    /// The axis, a unit vector.
    #[must_use]
    pub fn axis(self) -> [f64; 3] {
        expand([self.0[0], self.0[1]])
    }

    /// Largest angle of a normal from the axis, radians, 0 to pi.
    #[must_use]
    pub fn half_angle(self) -> f64 {
        half_angle(self.0[2])
    }

    /// Whether a normal of any length lies inside; one without direction, only where any does.
    #[must_use]
    pub fn contains(self, normal: [f64; 3]) -> bool {
        self.0[2] == u8::MAX
            || normalized(normal).is_some_and(|unit| angle(self.axis(), unit) <= self.half_angle())
    }

    fn new([u, v]: [u8; 2], angle: f64) -> Self {
        // The cast saturates: beyond pi is pi.
        let mut steps = (angle * 255.0 / PI).ceil() as u8;
        while half_angle(steps) < angle && steps < u8::MAX {
            steps += 1;
        }
        Self([u, v, steps])
    }
}

fn half_angle(steps: u8) -> f64 {
    f64::from(steps) * PI / 255.0
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The angle between two vectors, precise for all angles.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    dot(cross, cross).sqrt().atan2(dot(a, b))
}

fn normalized(v: [f64; 3]) -> Option<[f64; 3]> {
    // By the largest component first: squares of what a float can hold would over- or underflow.
    let largest = v.iter().fold(0.0, |largest: f64, c| largest.max(c.abs()));
    if !v.iter().all(|c| c.is_finite()) || largest == 0.0 {
        return None;
    }
    let scaled = v.map(|c| c / largest);
    let length = dot(scaled, scaled).sqrt();
    Some(scaled.map(|c| c / length))
}

/// The octahedral bytes of a direction; `None` where it has none.
fn quantize(direction: [f64; 3]) -> Option<[u8; 2]> {
    let [x, y, z] = normalized(direction)?;
    let sum = x.abs() + y.abs() + z.abs();
    let (u, v) = (x / sum, y / sum);
    let (u, v) =
        if z < 0.0 { ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)) } else { (u, v) };
    Some([u, v].map(|c| ((c + 1.0) * 127.5).round() as u8))
}

/// The unit vector of octahedral bytes.
fn expand(bytes: [u8; 2]) -> [f64; 3] {
    let [u, v] = bytes.map(|b| f64::from(b) / 127.5 - 1.0);
    let z = 1.0 - u.abs() - v.abs();
    let (x, y) =
        if z < 0.0 { ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)) } else { (u, v) };
    let length = dot([x, y, z], [x, y, z]).sqrt();
    [x, y, z].map(|c| c / length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn directions() -> impl Strategy<Value = Vec<[f64; 3]>> {
        // All around, or all within a little of one direction, of any length.
        let any = [-1.0..1.0, -1.0..1.0, -1.0..1.0f64];
        (
            any,
            0.0..1.0f64,
            prop::collection::vec(([-1.0..1.0, -1.0..1.0, -1.0..1.0f64], -30..30), 1..40),
        )
            .prop_map(|(near, spread, all)| {
                all.into_iter()
                    .map(|(v, exponent)| {
                        let length = f64::from(exponent).exp2();
                        std::array::from_fn(|a| (near[a] + spread * v[a]) * length)
                    })
                    .collect()
            })
    }

    proptest! {
        #[test]
        fn a_cone_holds_what_it_was_made_of(
            axis in [-1.0..1.0, -1.0..1.0, -1.0..1.0f64], normals in directions(),
        ) {
            let units = normals.iter().map(|&n| NormalCone::unit(n));
            let cone = NormalCone::of_units(axis, units);
            prop_assert!(normals.iter().all(|&n| cone.contains(n)), "{:?} {:?}", cone, normals);
        }

        #[test]
        fn a_cone_of_cones_holds_what_they_hold(a in directions(), b in directions()) {
            let cones = [&a, &b].map(|normals| {
                NormalCone::of_units(normals[0], normals.iter().map(|&n| NormalCone::unit(n)))
            });
            let both = NormalCone::of_cones(a[0], cones);
            prop_assert!(a.iter().chain(&b).all(|&n| both.contains(n)), "{:?} {:?}", both, cones);
        }

        #[test]
        fn a_cone_is_not_much_wider_than_its_normals(axis in directions()) {
            let cone = NormalCone::of_units(axis[0], [NormalCone::unit(axis[0])]);
            // The axis is off by less than a degree, the angle rounded up by less than another.
            prop_assert!(NormalCone::unit(axis[0]) == [0.0; 3] || cone.half_angle() < 0.03, "{:?}", cone);
        }
    }

    #[test]
    fn every_axis_reads_back_as_its_bytes() {
        for bytes in (0..=255).flat_map(|u| (0..=255).map(move |v| [u, v])) {
            let axis = expand(bytes);
            assert!((dot(axis, axis) - 1.0).abs() < 1e-12);
            // On the folds, two pairs of bytes mean the same axis.
            let again = expand(quantize(axis).expect("a direction"));
            assert!(angle(axis, again) < 1e-6, "{bytes:?}");
        }
    }

    #[test]
    fn normals_without_direction_are_in_no_cone_but_that_of_any() {
        let narrow = NormalCone::of_units([0.0, 0.0, 1.0], [[0.0, 0.0, 1.0]]);
        for none in [[0.0; 3], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            assert_eq!(NormalCone::unit(none), [0.0; 3]);
            assert!(!narrow.contains(none) && NormalCone::ANY.contains(none));
            let units = [[0.0, 0.0, 1.0], NormalCone::unit(none)];
            assert_eq!(NormalCone::of_units([0.0, 0.0, 1.0], units), NormalCone::ANY);
            assert_eq!(NormalCone::of_units(none, [[0.0, 0.0, 1.0]]), NormalCone::ANY);
        }
    }
}
