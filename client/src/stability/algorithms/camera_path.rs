//! Cameras between key frames.

use glam::DVec3;

use super::Rows;
use crate::{
    path::{CameraPath, KeyFrame, LARGEST_COORDINATE, Lens, SHORTEST_STEP},
    stability::{
        Row,
        exact::{Big, Big3, apart, big, big3, dot, minus, whole},
    },
};

const REFERENCE: &str = "the cubic of Barry and Goldman 1988, in 512-bit floats";
const ROUNDINGS: &str = "roundings of the sums, of the size of the coordinates and of the path";

fn key(time: f64, position: DVec3) -> KeyFrame {
    KeyFrame {
        time,
        position,
        // As far as tells a direction beside the largest coordinates.
        target: position - DVec3::Z * (1e-6 * position.abs().max_element()).max(10.0),
        up: DVec3::Y,
        lens: Lens::FovYDegrees(60.0),
        jump: false,
    }
}

/// Keys around a place: `steps` of the path, and their times.
fn keys(at: [f64; 3], size: f64, times: [f64; 4]) -> Vec<KeyFrame> {
    let steps = [
        DVec3::ZERO,
        DVec3::new(1.0, 0.3, 0.1),
        DVec3::new(1.9, 1.1, -0.2),
        DVec3::new(3.1, 1.0, 0.4),
    ];
    let at = DVec3::from(at);
    times.into_iter().zip(steps).map(|(time, step)| key(time, at + size * step)).collect()
}

pub(super) fn cases() -> Rows {
    let even = [0.0, 1.0, 2.0, 3.0];
    let paths = [
        ("at the origin", keys([0.0; 3], 10.0, even)),
        ("offset of 10^7 m, millimetres apart", keys([1e7, -1e7, 1e3], 0.01, even)),
        ("earth-centred (ECEF)", keys([4_027_881.628, 306_998.785, 4_919_498.981], 2.0, even)),
        ("cloud at 10^9 m", keys([1e9; 3], 5.0, even)),
        ("coordinates of 10^15", keys([0.2 * LARGEST_COORDINATE; 3], 1e6, even)),
        ("steps of a microsecond", keys([500.0; 3], 10.0, [0.0, 1e-6, 2e-6, 3e-6])),
        (
            "a step of a microsecond beside one of 1000 s",
            keys([500.0; 3], 10.0, [0.0, 1000.0, 1000.0 + 1e-5, 2000.0]),
        ),
        ("times of 10^8 s", keys([500.0; 3], 10.0, [1e8, 1e8 + 1.0, 1e8 + 2.5, 1e8 + 3.0])),
    ];
    let mut rows = Vec::new();
    for (case, keys) in paths {
        let Ok(path) = CameraPath::new(keys.clone(), false) else {
            rows.push(Row::holds(case, false, "the keys are possible", REFERENCE));
            continue;
        };
        rows.push(row(case, &path, &keys));
    }
    let twice = vec![key(1.0, DVec3::ZERO), key(1.0, DVec3::X)];
    let too_near = vec![key(1.0, DVec3::ZERO), key(1.0 + 0.4 * SHORTEST_STEP, DVec3::X)];
    rows.push(Row::holds(
        "a time step of 0",
        CameraPath::new(twice, false).is_err() && CameraPath::new(too_near, false).is_err(),
        "two places at one time are no motion: refused, with the key's number",
        "nothing",
    ));
    let alone = CameraPath::new(vec![key(1.0, DVec3::splat(3.0))], false);
    let times = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, -1e300];
    rows.push(Row::holds(
        "one key, any time, NaN among them",
        alone.is_ok_and(|path| {
            times.iter().all(|&t| path.at(t).eye == DVec3::splat(3.0) && path.at(t).check().is_ok())
        }),
        "a camera that stands still is where it is",
        "the key",
    ));
    Ok(rows)
}

fn row(case: &'static str, path: &CameraPath, keys: &[KeyFrame]) -> Row {
    let (mut ours, mut single, mut reach) = (0.0f64, 0.0f64, 0.0f64);
    let rounded = |v: DVec3| v.as_vec3().as_dvec3();
    let in_single = keys.iter().map(|key| KeyFrame { position: rounded(key.position), ..*key });
    // The same curve, through places that are floats.
    let in_single = CameraPath::new(in_single.collect(), false);
    let velocities: Vec<Big3> = (0..keys.len()).map(|i| velocity(keys, i)).collect();
    let reaches = keys.iter().map(|key| key.position.abs().max_element());
    reach = reaches.fold(reach, f64::max);
    for (i, pair) in keys.windows(2).enumerate() {
        let [from, to] = pair else { continue };
        for part in [0.0, 0.1, 0.37, 0.5, 0.9] {
            let time = from.time + part * (to.time - from.time);
            if !(from.time..to.time).contains(&time) {
                continue;
            }
            let exact = between(from, to, [&velocities[i], &velocities[i + 1]], time);
            let off = |found: DVec3| {
                let found = found.to_array().into_iter().zip(&exact);
                found.map(|(found, exact)| apart(found, exact)).fold(0.0, f64::max)
            };
            ours = ours.max(off(path.at(time).eye));
            let rounded = in_single.as_ref().map(|path| rounded(path.at(time).eye));
            single = single.max(rounded.map_or(f64::INFINITY, off));
        }
    }
    let length =
        keys.windows(2).map(|pair| (pair[1].position - pair[0].position).length()).sum::<f64>();
    // A place is known as well as the time is.
    let tolerance = 2.0 * f64::EPSILON * reach + 16.0 * f64::EPSILON * length;
    Row::new(case, (ours, "world units"), (tolerance, ROUNDINGS), REFERENCE)
        .beside("key positions in single precision", single)
}

/// Velocity at a key: of the parabola through it and its neighbours, cut to three times the slower
/// chord's; at an end, that of the one chord.
fn velocity(keys: &[KeyFrame], i: usize) -> Big3 {
    let chord = |a: usize, b: usize| -> (Big3, Big) {
        let step = minus(&big3(keys[b].position), &big3(keys[a].position));
        (step, big(keys[b].time) - big(keys[a].time))
    };
    let speed =
        |(step, seconds): &(Big3, Big)| -> Big3 { std::array::from_fn(|a| &step[a] / seconds) };
    if i == 0 {
        return speed(&chord(0, 1));
    }
    if i + 1 == keys.len() {
        return speed(&chord(i - 1, i));
    }
    let (before, after) = (chord(i - 1, i), chord(i, i + 1));
    let (speed0, speed1) = (speed(&before), speed(&after));
    let parabola: Big3 = std::array::from_fn(|a| {
        (&after.1 * &speed0[a] + &before.1 * &speed1[a]) / (&before.1 + &after.1)
    });
    let length = |v: &Big3| dot(v, v).sqrt();
    let (slow0, slow1) = (length(&speed0), length(&speed1));
    let limit = whole(3) * if slow0 < slow1 { slow0 } else { slow1 };
    let fast = length(&parabola);
    if fast > limit { parabola.map(|c| c * &limit / &fast) } else { parabola }
}

fn between(from: &KeyFrame, to: &KeyFrame, velocities: [&Big3; 2], time: f64) -> Big3 {
    let seconds = big(to.time) - big(from.time);
    let s = (big(time) - big(from.time)) / &seconds;
    let rest = whole(1) - &s;
    let step = &s * &s * (whole(3) - whole(2) * &s);
    let (first, second) = (&s * &rest * &rest, -(&s * &s * &rest));
    let (p, q) = (big3(from.position), big3(to.position));
    std::array::from_fn(|a| {
        &p[a]
            + &step * (&q[a] - &p[a])
            + &seconds * (&first * &velocities[0][a] + &second * &velocities[1][a])
    })
}
