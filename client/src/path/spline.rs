//! The curves between keys: Catmull-Rom by time, in the form of cubic Hermite segments.
//!
//! Keys are to be passed at their times, which may be as uneven as their distances. A uniform
//! Catmull-Rom spline takes the neighbours' chord as velocity whatever the times, so that the camera
//! jerks where steps of time change; the centripetal one chooses its own times. So the non-uniform
//! form with the keys' times as parameters (Barry and Goldman 1988): at each key the velocity of
//! the parabola through it and its two neighbours. It is C1 for any times. What it lacks is a
//! bound: beside a fast segment a slow one starts fast, and runs far away before it comes back.
//! Therefore velocities are cut to three times the slower of both chords, which for data on a line
//! is the limit of Fritsch and Carlson (1980): normal paths never meet it, a camera that stands
//! still at two keys stands still between them, and a curve is nowhere farther from its chord than
//! three quarters of the chord's length.

use glam::DVec3;

/// Largest velocity at a key, in those of the slower chord beside it.
const FASTEST: f64 = 3.0;

/// Sine of the angle below which two directions count as the same, or as opposite.
const SAME: f64 = 1e-9;

/// A segment's displacement and how many seconds it takes.
pub(super) type Chord<T> = (T, f64);

/// Velocity at the key between two chords.
pub(super) fn velocity(before: Chord<DVec3>, after: Chord<DVec3>) -> DVec3 {
    let ((step0, seconds0), (step1, seconds1)) = (before, after);
    let (speed0, speed1) = (step0 / seconds0, step1 / seconds1);
    // Barry and Goldman 1988; the derivative of the parabola through three points.
    let parabola = (seconds1 * speed0 + seconds0 * speed1) / (seconds0 + seconds1);
    parabola.clamp_length_max(FASTEST * speed0.length().min(speed1.length()))
}

/// The same for a number that must stay between those of its keys: zero at a turning point
/// (Fritsch and Carlson 1980).
pub(super) fn monotone_velocity(before: Chord<f64>, after: Chord<f64>) -> f64 {
    let (speed0, speed1) = (before.0 / before.1, after.0 / after.1);
    if speed0 * speed1 <= 0.0 {
        return 0.0;
    }
    let parabola = (after.1 * speed0 + before.1 * speed1) / (before.1 + after.1);
    let limit = FASTEST * speed0.abs().min(speed1.abs());
    parabola.clamp(-limit, limit)
}

/// Weights of a cubic Hermite segment at a share `s` of its time: of the whole displacement, and of
/// the velocities at both ends times the segment's seconds. Displacements instead of places, so
/// that far from the origin no digits are lost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hermite {
    pub step: f64,
    pub first: f64,
    pub second: f64,
}

impl Hermite {
    pub fn at(s: f64) -> Self {
        let rest = 1.0 - s;
        Self { step: s * s * (3.0 - 2.0 * s), first: s * rest * rest, second: -s * s * rest }
    }
}

/// The direction at a share `s` of the turn from unit vector `from` to unit vector `to`, at constant
/// angular speed. Between opposite ones the turn is about the first of `forward`, x and y that is
/// not along them.
pub(super) fn turn(from: DVec3, to: DVec3, forward: DVec3, s: f64) -> DVec3 {
    let normal = from.cross(to);
    let cosine = from.dot(to);
    let (axis, angle) = if normal.length() > SAME {
        (normal.normalize(), libm::atan2(normal.length(), cosine))
    } else if cosine > 0.0 {
        return from;
    } else {
        let across = |axis: DVec3| axis - axis.dot(from) * from;
        let axis = [forward, DVec3::X, DVec3::Y].map(across).into_iter();
        let axis = axis.filter(|axis| axis.length() > 1e-6).map(DVec3::normalize).next();
        (axis.expect("x and y are not both along one direction"), std::f64::consts::PI)
    };
    let (sine, cosine) = libm::sincos(s * angle);
    (cosine * from + sine * axis.cross(from)).normalize()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn even_steps_have_the_velocity_of_catmull_and_rom() {
        let (before, after) = (DVec3::new(1.0, 2.0, 0.0), DVec3::new(3.0, -2.0, 1.0));
        let expected = 0.5 * (before + after) / 2.0;
        assert!((velocity((before, 2.0), (after, 2.0)) - expected).length() < 1e-15);
    }

    #[test]
    fn uneven_steps_have_the_velocity_of_the_parabola_through_them() {
        // (t, t²) at 0, 1 and 3: its slope at 1 is 2.
        let (before, after) = (DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, 8.0, 0.0));
        assert!(
            (velocity((before, 1.0), (after, 2.0)) - DVec3::new(1.0, 2.0, 0.0)).length() < 1e-15
        );
        assert!((monotone_velocity((1.0, 1.0), (8.0, 2.0)) - 2.0).abs() < 1e-15);
    }

    #[test]
    fn a_standstill_beside_a_key_is_one_at_the_key() {
        assert_eq!(velocity((DVec3::ZERO, 1.0), (DVec3::X, 2.0)), DVec3::ZERO);
        assert_eq!(monotone_velocity((0.0, 1.0), (5.0, 2.0)), 0.0);
    }

    #[test]
    fn opposite_directions_turn_about_the_view() {
        let halfway = turn(DVec3::Z, DVec3::NEG_Z, DVec3::Y, 0.5);
        assert!((halfway - DVec3::X).length() < 1e-15, "{halfway}");
        let along_the_view = turn(DVec3::Z, DVec3::NEG_Z, DVec3::NEG_Z, 0.5);
        assert!((along_the_view - DVec3::NEG_Y).length() < 1e-15, "{along_the_view}");
        assert_eq!(turn(DVec3::Z, DVec3::Z, DVec3::Y, 0.5), DVec3::Z);
    }

    fn direction() -> impl Strategy<Value = DVec3> {
        [-1.0..1.0, -1.0..1.0, -1.0..1.0]
            .prop_filter_map("not zero", |v: [f64; 3]| DVec3::from(v).try_normalize())
    }

    proptest! {
        #[test]
        fn turns_go_from_one_direction_to_the_other_at_constant_speed(
            from in direction(), to in direction(), forward in direction(), s in 0.0..=1.0,
        ) {
            let between = turn(from, to, forward, s);
            prop_assert!((between.length() - 1.0).abs() < 1e-12);
            prop_assert!((turn(from, to, forward, 0.0) - from).length() < 1e-12);
            prop_assert!((turn(from, to, forward, 1.0) - to).length() < 1e-8);
            let angle = |a: DVec3, b: DVec3| a.cross(b).length().atan2(a.dot(b));
            prop_assert!((angle(from, between) - s * angle(from, to)).abs() < 1e-7);
        }
    }
}
