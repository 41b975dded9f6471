//! From the lattice to the camera, and distances.

use std::sync::Arc;

use fastrand::Rng;
use glam::DVec3;
use lodestream_protocol::{Lattice, Manifest, NodeKey, NodePoints};

use super::Rows;
use crate::{
    camera::{Camera, Projection},
    render::{CpuRenderer, DrawNode, LARGEST_SIDE_PX, RenderSettings, Scene, Splat, view::View},
    stability::{
        Row, StabilityError,
        dataset::manifest,
        exact::{Big, Big3, apart, big, big3, dot, length, relative, rounded, whole},
    },
};

const REFERENCE: &str = "lattice, eye and axes as they are, in 512-bit floats";
const RELATIVE: &str = "roundings of the difference's own size, not of the coordinates'";
const SINGLE: &str = "half an ulp of the single precision that depths are kept in";

/// Bits of the side of the nodes that points are placed by way of.
const NODE_BITS: u8 = 12;

/// A lattice and an eye in it.
struct Case {
    name: &'static str,
    lattice: Lattice,
    eye: [f64; 3],
    /// Steps around the eye that points are within.
    reach: i64,
}

fn views() -> Vec<Case> {
    let lattice =
        |scale, offset: [f64; 3]| Lattice { scale, offset, origin: [0; 3], side_bits: 32 };
    let mut ecef = lattice(0.001, [0.0; 3]);
    // As in files whose scale is all there is: large integers instead of an offset.
    ecef.origin = [4_026_000_000, 305_000_000, 4_918_000_000];
    vec![
        Case {
            name: "offset of 10^7 m, 1 mm detail, eye among the points",
            lattice: lattice(0.001, [1e7 + 0.1, -1e7 - 0.3, 1000.7]),
            eye: [1e7 + 1000.1234, -1e7 + 999.8765, 2000.111],
            reach: 50,
        },
        Case {
            name: "earth-centred (ECEF), 1 mm detail",
            lattice: ecef,
            eye: [4_027_881.628, 306_998.785, 4_919_498.981],
            reach: 5000,
        },
        Case {
            name: "cloud at 10^9 m",
            lattice: lattice(0.001, [1e9, 1e9, -1e9]),
            eye: [1e9 + 100.000_5, 1e9 + 200.25, -1e9 + 50.125],
            reach: 2000,
        },
        Case {
            name: "scale of 10^-9 m",
            lattice: lattice(1e-9, [12.345_678_901; 3]),
            eye: [12.845_678_901_2, 12.945_678_901_7, 13.345_678_9],
            reach: 100,
        },
        Case {
            name: "extent of 10^-6 m",
            lattice: lattice(1e-10, [0.0; 3]),
            eye: [1e-6, 1.1e-6, 0.9e-6],
            reach: 8000,
        },
        Case {
            name: "extent of 10^9 m",
            lattice: lattice(1.0, [-5e8; 3]),
            eye: [0.5, 1e8, -1e8],
            reach: 300_000_000,
        },
    ]
}

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(9);
    let mut rows: Vec<Row> = views().iter().flat_map(|case| transform(case, &mut rng)).collect();
    rows.extend(depths()?);
    Ok(rows)
}

fn settings(eye: DVec3, size_px: [u32; 2]) -> RenderSettings {
    let target = eye + DVec3::new(0.6, 0.8, -0.1);
    let projection = Projection::Perspective { fov_y: 1.0 };
    RenderSettings::new(size_px, Camera { eye, target, up: DVec3::Z, projection })
}

/// View space places of points near the eye: of lattice points themselves, as anchors are placed, and
/// by way of their node's corner.
fn transform(case: &Case, rng: &mut Rng) -> [Row; 2] {
    let lattice = &case.lattice;
    let eye = DVec3::from(case.eye);
    let settings = settings(eye, [100, 100]);
    let view = View::new(&settings, 1, 1.0);
    let basis = settings.camera.basis();
    // The axes are those that the product has: what is measured is the difference.
    let axes = [basis.right, basis.up, basis.forward].map(big3);
    let [mut ours, mut by_corner, mut single, mut double] = [0.0f64; 4];
    for _ in 0..300 {
        let q: [u32; 3] = std::array::from_fn(|a| {
            let steps = ((case.eye[a] - lattice.offset[a]) / lattice.scale) as i64;
            let near = steps - lattice.origin[a] + rng.i64(-case.reach..=case.reach);
            u32::try_from(near.clamp(0, u32::MAX.into())).unwrap_or(u32::MAX)
        });
        let exact: Big3 = std::array::from_fn(|a| {
            let steps = whole(i128::from(lattice.origin[a]) + i128::from(q[a]));
            big(lattice.scale) * steps + big(lattice.offset[a]) - big(case.eye[a])
        });
        let distance = rounded(&length(&exact));
        let place: Big3 = std::array::from_fn(|a| dot(&axes[a], &exact));
        let error = |found: DVec3| {
            let found = found.to_array().into_iter().zip(&place);
            found.map(|(found, exact)| apart(found, exact)).fold(0.0, f64::max) / distance
        };
        ours = ours.max(error(view.node(lattice, NodeKey::ROOT, q).origin));
        let key = NodeKey::new(lattice.side_bits - NODE_BITS, q.map(|c| c >> NODE_BITS));
        by_corner = by_corner.max(key.map_or(f64::INFINITY, |key| {
            let node = view.node(lattice, key, [0; 3]);
            let corner = lattice.node_min(key);
            let local = std::array::from_fn(|a| f64::from(q[a] - corner[a]));
            let side = lattice.node_side_world(key.level());
            error(node.origin + node.step * DVec3::from(local)) * distance / (distance + side)
        }));
        let world = DVec3::from(lattice.world(q));
        let turn = |d: DVec3| DVec3::new(d.dot(basis.right), d.dot(basis.up), d.dot(basis.forward));
        single = single.max(error(turn((world.as_vec3() - eye.as_vec3()).as_dvec3())));
        double = double.max(error(turn(world - eye)));
    }
    let itself =
        Row::new(case.name, (ours, "of the distance"), (8.0 * f64::EPSILON, RELATIVE), REFERENCE)
            .beside("world coordinates in single precision", single)
            .beside("world coordinates in double precision", double);
    let by_corner = Row::new(
        format!("by way of the node's corner: {}", case.name),
        (by_corner, "of distance and node"),
        (8.0 * f64::EPSILON, "roundings of the size of the node and its distance"),
        REFERENCE,
    );
    [itself, by_corner]
}

/// Distances that a picture holds, from a thousandth to ten million.
fn depths() -> Rows {
    let mut rows = Vec::new();
    for (case, decades) in
        [("depths in one view, 1 : 10^6", 0..=6), ("depths in one view, 1 : 10^10", -3..=7)]
    {
        rows.push(depth_row(case, decades)?);
    }
    for (case, size_px) in [
        ("a picture of 1 x 1", [1, 1]),
        ("a picture of 16384 x 1", [LARGEST_SIDE_PX, 1]),
        ("a picture of 1 x 16384", [1, LARGEST_SIDE_PX]),
    ] {
        rows.push(extreme_picture(case, size_px)?);
    }
    Ok(rows)
}

/// A point for every power of ten of distance, each drawn in a cloud of its own lattice; all in one
/// picture. Distances are read back from it.
fn depth_row(
    case: &'static str,
    decades: std::ops::RangeInclusive<i32>,
) -> Result<Row, StabilityError> {
    let distances: Vec<f64> = decades.map(|decade| 1.37 * 10f64.powi(decade)).collect();
    let size_px = [64 * distances.len() as u32, 64];
    let eye = DVec3::new(500_000.0, 5_300_000.0, 400.0);
    let mut settings = settings(eye, size_px);
    settings.splat = Splat::Point;
    let basis = settings.camera.basis();
    let (mut clouds, mut nodes, mut exact): (Vec<Arc<Manifest>>, Vec<DrawNode>, Vec<Big>) =
        (Vec::new(), Vec::new(), Vec::new());
    let half_width = 0.5 * settings.aspect();
    for (i, &distance) in distances.iter().enumerate() {
        // Side by side over the picture.
        let share = (i as f64 + 0.5) / distances.len() as f64 * 2.0 - 1.0;
        let slope = (0.5f64).tan() * 2.0 * half_width * share * 0.98;
        let place = eye + distance * (basis.forward + slope * basis.right);
        let lattice = Lattice { scale: 1.0, offset: place.into(), origin: [0; 3], side_bits: 0 };
        let d = crate::stability::exact::minus(&big3(place), &big3(eye));
        exact.push(dot(&d, &big3(basis.forward)));
        clouds.push(Arc::new(manifest(lattice)));
        nodes.push(point_of(i));
    }
    let frame = CpuRenderer.render(&Scene { clouds: &clouds, nodes: &nodes }, &settings)?;
    let mut found: Vec<f64> =
        frame.picture.depth.iter().filter(|d| d.is_finite()).map(|&d| f64::from(d)).collect();
    found.sort_by(f64::total_cmp);
    let error = if found.len() == exact.len() {
        found.iter().zip(&exact).map(|(&found, exact)| relative(found, exact)).fold(0.0, f64::max)
    } else {
        f64::INFINITY
    };
    // What a depth buffer of the usual direction tells of the same distances: near plane at the
    // nearest point, far plane at the farthest.
    let (near, far) = (distances[0] * 0.5, distances[distances.len() - 1] * 2.0);
    let forward = distances.iter().map(|&distance| {
        let depth = ((far / (far - near)) * (1.0 - near / distance)) as f32;
        let back = near / (1.0 - f64::from(depth) * (far - near) / far);
        relative(back, &big(distance))
    });
    Ok(Row::new(
        case,
        (error, "of the distance"),
        (0.5 * f64::from(f32::EPSILON), SINGLE),
        "the distances of the points, in 512-bit floats",
    )
    .beside("depth from 0 near to 1 far, single precision", forward.fold(0.0, f64::max)))
}

/// One point straight ahead, in a picture of an extreme size.
fn extreme_picture(case: &'static str, size_px: [u32; 2]) -> Result<Row, StabilityError> {
    let eye = DVec3::new(500_000.0, 5_300_000.0, 400.0);
    let settings = settings(eye, size_px);
    let place = eye + 12.5 * settings.camera.basis().forward;
    let lattice = Lattice { scale: 1.0, offset: place.into(), origin: [0; 3], side_bits: 0 };
    let (clouds, nodes) = ([Arc::new(manifest(lattice))], [point_of(0)]);
    let frame = CpuRenderer.render(&Scene { clouds: &clouds, nodes: &nodes }, &settings)?;
    let nearest = frame.picture.depth.iter().copied().fold(f32::INFINITY, f32::min);
    // The eye's own rounding at these coordinates is a part in 10^10 of the distance.
    Ok(Row::new(
        case,
        (relative(f64::from(nearest), &big(12.5)), "of the distance"),
        (f64::from(f32::EPSILON), SINGLE),
        "the distance of the one point in it",
    ))
}

/// The one point of a cloud.
fn point_of(cloud: usize) -> DrawNode {
    let points = NodePoints { positions: vec![[0; 3]], ..NodePoints::new(NodeKey::ROOT) };
    DrawNode { cloud, key: NodeKey::ROOT, spacing: 1.0, points: Arc::new(points), part: 0 }
}
