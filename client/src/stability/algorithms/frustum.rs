//! Culling and projected sizes.

use fastrand::Rng;
use glam::DVec3;

use super::Rows;
use crate::{
    camera::{Camera, Projection},
    engine::{Optics, View, WorldBox},
    stability::{
        Row,
        exact::{Big, Big3, big, big3, cross, dot, length, minus, relative, unit, whole},
    },
};

const SIZE_PX: [u32; 2] = [1600, 900];
const REFERENCE: &str = "the camera's frame in 512-bit floats";
const MARGIN: &str = "the margin of 8 px around the picture is wider than any rounding";
const ROUNDINGS: &str =
    "the roundings of the difference, its length, the tangent and two quotients";

/// Points that are classified for each camera.
const POINTS: usize = 2000;

/// A camera by name, and the distances in front of it that matter.
struct Case {
    name: &'static str,
    camera: Camera,
    /// Powers of ten.
    distances: [f64; 2],
}

fn views() -> Vec<Case> {
    let perspective = |degrees: f64| Projection::Perspective { fov_y: degrees.to_radians() };
    let look = |name, eye: [f64; 3], degrees, distances| {
        let eye = DVec3::from(eye);
        let target = eye + DVec3::new(3.0, -2.0, 0.7);
        let camera = Camera { eye, target, up: DVec3::Z, projection: perspective(degrees) };
        Case { name, camera, distances }
    };
    let utm = [500_000.123, 5_300_000.456, 412.789];
    let mut down = look("straight down", utm, 60.0, [-1.0, 4.0]);
    down.camera.target = down.camera.eye - DVec3::Z;
    let mut flat = look("orthographic", utm, 60.0, [-1.0, 4.0]);
    flat.camera.projection = Projection::Orthographic { height: 250.0 };
    vec![
        look("60 degrees at the origin", [0.0; 3], 60.0, [-1.0, 4.0]),
        look("0.1 degrees, from afar", utm, 0.1, [2.0, 6.0]),
        look("170 degrees", utm, 170.0, [-1.0, 4.0]),
        look("offset of 10^7 m, 1 mm detail", [1e7, -1e7, 1e3], 60.0, [-2.0, 3.0]),
        look(
            "earth-centred (ECEF)",
            [4_027_881.628, 306_998.785, 4_919_498.981],
            60.0,
            [-2.0, 3.0],
        ),
        look("cloud at 10^9 m", [1e9, 1e9, -1e9], 60.0, [0.0, 4.0]),
        look("depth range of 10^10", utm, 60.0, [-3.0, 7.0]),
        look("near plane inside the cloud", utm, 60.0, [-6.0, -3.0]),
        down,
        flat,
    ]
}

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(8);
    let mut rows = Vec::new();
    for case in views() {
        let frame = Frame::of(&case.camera);
        rows.push(culling(&case, &frame, &mut rng));
        if let Projection::Perspective { fov_y } = case.camera.projection {
            rows.push(size(&case, &frame, fov_y, &mut rng));
        }
    }
    rows.push(nonsense());
    Ok(rows)
}

/// A camera's frame, exactly.
struct Frame {
    eye: Big3,
    right: Big3,
    up: Big3,
    forward: Big3,
    /// Half of the picture: of the distance in perspective, else in world units.
    half: [Big; 2],
    is_perspective: bool,
}

impl Frame {
    fn of(camera: &Camera) -> Self {
        let eye = big3(camera.eye);
        let forward = unit(&minus(&big3(camera.target), &eye));
        let along_up = cross(&forward, &big3(camera.up));
        // Straight down, y stands in for up.
        let is_along = length(&along_up) < big(1e-9);
        let right = unit(&if is_along { cross(&forward, &big3(DVec3::Y)) } else { along_up });
        let up = cross(&right, &forward);
        let aspect = whole(SIZE_PX[0].into()) / whole(SIZE_PX[1].into());
        let (is_perspective, half) = match camera.projection {
            Projection::Perspective { fov_y } => (true, (big(fov_y) / whole(2)).tan()),
            Projection::Orthographic { height } => (false, big(height) / whole(2)),
        };
        Self { eye, right, up, forward, half: [&half * aspect, half], is_perspective }
    }

    /// Along right, up and forward.
    fn place(&self, p: DVec3) -> Big3 {
        let d = minus(&big3(p), &self.eye);
        [dot(&d, &self.right), dot(&d, &self.up), dot(&d, &self.forward)]
    }

    /// Where a point is on the picture: -1 to 1 on each axis inside; `None` behind the eye.
    fn on_picture(&self, p: DVec3) -> Option<[f64; 2]> {
        let [x, y, z] = self.place(p);
        if z <= whole(0) {
            return None;
        }
        let [half_x, half_y] = &self.half;
        let depth = if self.is_perspective { z } else { whole(1) };
        let share = |c: Big, half: &Big| crate::stability::exact::rounded(&(c / (half * &depth)));
        Some([share(x, half_x), share(y, half_y)])
    }
}

/// A random place that is `x`, `y` on the picture.
fn place(camera: &Camera, at: [f64; 2], distance: f64) -> DVec3 {
    let basis = camera.basis();
    let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
    let half = match camera.projection {
        Projection::Perspective { fov_y } => distance * (0.5 * fov_y).tan(),
        Projection::Orthographic { height } => 0.5 * height,
    };
    camera.eye
        + distance * basis.forward
        + at[0] * half * aspect * basis.right
        + at[1] * half * basis.up
}

/// Points and boxes at the picture's edges: none that reaches inside is culled, none well outside is kept.
fn culling(case: &Case, frame: &Frame, rng: &mut Rng) -> Row {
    let optics = Optics::new(&View { camera: case.camera, size_px: SIZE_PX });
    let (mut ours, mut single) = (0, 0);
    for count in 0..POINTS {
        let [low, high] = case.distances;
        let distance = 10f64.powf(low + rng.f64() * (high - low));
        let edge =
            |rng: &mut Rng| if rng.bool() { 0.98 + 0.1 * rng.f64() } else { 2.0 * rng.f64() - 1.0 };
        let sign = |rng: &mut Rng| if rng.bool() { 1.0 } else { -1.0 };
        let at = [edge(rng) * sign(rng), edge(rng) * sign(rng)];
        let point = place(&case.camera, at, distance);
        // Every other box has an extent, up to its distance: the point lies anywhere in it.
        let size = if count % 2 == 0 { 0.0 } else { distance * 10f64.powf(-4.0 * rng.f64()) };
        let half = size * DVec3::from(std::array::from_fn(|_| rng.f64()));
        let offset = half * DVec3::from(std::array::from_fn(|_| 2.0 * rng.f64() - 1.0));
        let bounds = WorldBox { center: point + offset, half };
        let Some([x, y]) = frame.on_picture(point) else { continue };
        let reach = x.abs().max(y.abs());
        // Half the picture's height is 450 px: the margin is less than 2 % of it.
        let is_inside = reach <= 1.0;
        let is_far_outside = is_beyond(frame, &bounds, 1.03);
        let wrong = |is_outside: bool| (is_inside && is_outside) || (is_far_outside && !is_outside);
        ours += usize::from(wrong(optics.is_outside(&bounds)));
        single += usize::from(wrong(is_outside_in_f32(&case.camera, point)));
    }
    Row::new(
        format!("culling, {}", case.name),
        (ours as f64, "boxes of 2000"),
        (0.0, MARGIN),
        REFERENCE,
    )
    .beside("world coordinates in single precision", single as f64)
}

/// Whether all corners of a box are beyond the same side of the picture, `reach` halves of it from its middle.
fn is_beyond(frame: &Frame, bounds: &WorldBox, reach: f64) -> bool {
    let corner = |i: u8| {
        let sign = |bit: u8| if i >> bit & 1 == 0 { -1.0 } else { 1.0 };
        frame.on_picture(bounds.center + bounds.half * DVec3::new(sign(0), sign(1), sign(2)))
    };
    let Some(corners) = (0..8).map(corner).collect::<Option<Vec<_>>>() else { return false };
    (0..2)
        .any(|axis| [-1.0, 1.0].iter().any(|side| corners.iter().all(|at| side * at[axis] > reach)))
}

/// The same with world coordinates that are floats, of the point alone.
fn is_outside_in_f32(camera: &Camera, point: DVec3) -> bool {
    let basis = camera.basis();
    let d = point.as_vec3() - camera.eye.as_vec3();
    let [x, y, z] = [basis.right, basis.up, basis.forward].map(|axis| d.dot(axis.as_vec3()));
    let aspect = SIZE_PX[0] as f32 / SIZE_PX[1] as f32;
    let half = match camera.projection {
        Projection::Perspective { fov_y } => z * (0.5 * fov_y as f32).tan(),
        Projection::Orthographic { height } => 0.5 * height as f32,
    };
    // The same margin.
    z < 0.0 || x.abs() > half * aspect * 1.01 || y.abs() > half * 1.018
}

/// The radius at which a sphere appears (Fraiss 2017, eq. 3.2).
fn size(case: &Case, frame: &Frame, fov_y: f64, rng: &mut Rng) -> Row {
    let optics = Optics::new(&View { camera: case.camera, size_px: SIZE_PX });
    let (mut ours, mut single) = (0.0f64, 0.0f64);
    for _ in 0..200 {
        let [low, high] = case.distances;
        let distance = 10f64.powf(low + rng.f64() * (high - low));
        let point = place(&case.camera, [rng.f64() - 0.5, rng.f64() - 0.5], distance);
        let radius = 0.01 * distance;
        let away = length(&minus(&big3(point), &frame.eye));
        let half_height = whole(SIZE_PX[1].into()) / whole(2);
        let exact = half_height / &frame.half[1] * big(radius) / away;
        ours = ours.max(relative(optics.projected_size(point, radius), &exact));
        let away = (point.as_vec3() - case.camera.eye.as_vec3()).length();
        let found = 0.5 * SIZE_PX[1] as f32 / (0.5 * fov_y as f32).tan() * radius as f32 / away;
        single = single.max(relative(f64::from(found), &exact));
    }
    Row::new(
        format!("projected size, {}", case.name),
        (ours, "of the size"),
        (8.0 * f64::EPSILON, ROUNDINGS),
        REFERENCE,
    )
    .beside("world coordinates in single precision", single)
}

/// Whatever the numbers, sizes and priorities are numbers.
fn nonsense() -> Row {
    let numbers = [
        0.0,
        -0.0,
        1.0,
        f64::MAX,
        f64::MIN_POSITIVE,
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        1e9,
    ];
    let mut bad = 0;
    for (i, &a) in numbers.iter().enumerate() {
        for &b in &numbers {
            let eye = DVec3::new(a, b, numbers[(i + 3) % numbers.len()]);
            let center = DVec3::new(b, a, numbers[(i + 5) % numbers.len()]);
            for projection in
                [Projection::Perspective { fov_y: b }, Projection::Orthographic { height: a }]
            {
                let camera = Camera { eye, target: center, up: DVec3::splat(b), projection };
                let optics = Optics::new(&View { camera, size_px: [1, 16_384] });
                let size = optics.projected_size(center, a);
                bad += usize::from(size.is_nan() || optics.priority(center, size).is_nan());
            }
        }
    }
    Row::new(
        "NaN, infinite and denormal cameras, a picture of 1 x 16384",
        (bad as f64, "NaN"),
        (0.0, "no camera and no bounds make an order that contradicts itself"),
        "nothing",
    )
}
