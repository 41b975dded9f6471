//! Planes, normals, curvatures.

use glam::DVec3;
use lodestream_preprocess::numerics::{
    Covariance, Moments, Neighbourhood, NoPlane, Plane, Symmetric3, surfaces,
};

use super::Rows;
use crate::stability::{
    Row,
    clouds::{self, Cloud},
    exact::{cross, length, rounded, unit, whole},
    naive,
};

const REFERENCE: &str = "the normal of the integers, in 512-bit floats";
const CONDITION: &str = "the rounding of the covariance over the share of the second variance";

pub(super) fn cases() -> Rows {
    let mut rows = Vec::new();
    for cloud in clouds::all() {
        match cloud.normal {
            Some(normal) => {
                rows.push(whole_plane(&cloud, normal));
                rows.push(two_ways(&cloud));
                rows.push(flat(&cloud));
                rows.extend(around(&cloud, normal));
            }
            None => rows.extend(named(&cloud)),
        }
    }
    Ok(rows)
}

/// Sine of the angle between a normal and the exact one: the angle itself where it is small.
fn angle(found: DVec3, normal: [i32; 3]) -> f64 {
    if !found.is_finite() || found == DVec3::ZERO {
        return f64::INFINITY;
    }
    let exact = normal.map(|c| whole(c.into()));
    rounded(&length(&cross(
        &unit(&found.to_array().map(crate::stability::exact::big)),
        &unit(&exact),
    )))
}

/// Rounding of the covariance over the relative size of the second variance.
fn tolerance(points: &[[u32; 3]]) -> f64 {
    let Some(covariance) = Moments::of(points).covariance() else { return 0.0 };
    let [_, middle, most] = covariance.principal().values;
    8.0 * f64::EPSILON * most / middle
}

fn fit(points: &[[u32; 3]]) -> Result<Plane, NoPlane> {
    Plane::fit(&Moments::of(points).covariance().ok_or(NoPlane::Empty)?)
}

fn whole_plane(cloud: &Cloud, normal: [i32; 3]) -> Row {
    let ours = fit(&cloud.points).map_or(f64::INFINITY, |plane| angle(plane.normal, normal));
    let world = cloud.world();
    // The product's own solver, so that the difference is that of the sums.
    let of = |entries: [f64; 6]| {
        let covariance = Covariance {
            count: 1,
            center: [0; 3],
            offset: DVec3::ZERO,
            matrix: Symmetric3::new(entries),
        };
        Plane::fit(&covariance).map_or(f64::INFINITY, |plane| angle(plane.normal, normal))
    };
    Row::new(
        format!("normal of all points: {}", cloud.name),
        (ours, "rad"),
        (tolerance(&cloud.points), CONDITION),
        REFERENCE,
    )
    .beside("single precision", of(naive::covariance_f32(&world)))
    .beside("double precision", of(naive::covariance_f64(&world)))
    .beside("shifted by the first point", of(naive::covariance_shifted(&world)))
}

/// The normal of the same points by two ways: all sums about one origin, or merged from parts about
/// their own.
fn two_ways(cloud: &Cloud) -> Row {
    let mut merged = Moments::default();
    for part in cloud.points.chunks(100) {
        let origin = part[0].map(i64::from);
        let mut moments = Moments::default();
        part.iter().for_each(|q| {
            moments.add(std::array::from_fn(|a| i64::from(q[a]) - origin[a]));
        });
        merged.merge(&moments.moved(origin));
    }
    let normal = |covariance: Option<Covariance>| {
        covariance.and_then(|c| Plane::fit(&c).ok()).map(|plane| plane.normal)
    };
    let apart = |a: Option<DVec3>, b: Option<DVec3>| match (a, b) {
        (Some(a), Some(b)) => a.cross(b).length().atan2(a.dot(b).abs()),
        _ => f64::INFINITY,
    };
    let ours = apart(normal(Moments::of(&cloud.points).covariance()), normal(merged.covariance()));
    let world = cloud.world();
    let of = |entries: [f64; 6]| {
        let matrix = Symmetric3::new(entries);
        normal(Some(Covariance { count: 1, center: [0; 3], offset: DVec3::ZERO, matrix }))
    };
    let shifted = of(naive::covariance_shifted(&world));
    Row::new(
        format!("one plane, two ways (73 degrees apart in PCL #2184): {}", cloud.name),
        (ours, "rad"),
        (0.0, "the same integers"),
        "the other way",
    )
    .beside("single precision, unshifted", apart(of(naive::covariance_f32(&world)), shifted))
    .beside("double precision, unshifted", apart(of(naive::covariance_f64(&world)), shifted))
}

fn flat(cloud: &Cloud) -> Row {
    let curvature = fit(&cloud.points).map_or(f64::INFINITY, |plane| plane.curvature);
    let world = cloud.world();
    let [xx, xy, xz, yy, yz, zz] = naive::covariance_f64(&world);
    let values = naive::eigenvalues_closed_form([xx, xy, xz, yy, yz, zz]);
    Row::new(
        format!("curvature of all points: {}", cloud.name),
        (curvature, "of the sum of variances"),
        (8.0 * f64::EPSILON, "the rounding of the covariance"),
        "zero: the points lie in one plane",
    )
    .beside("double precision, closed form", (values[0] / (xx + yy + zz)).abs())
}

/// The normals around points, over k nearest, a radius, and both.
fn around(cloud: &Cloud, normal: [i32; 3]) -> Vec<Row> {
    let extent = cloud.points.iter().flatten().max().unwrap_or(&0)
        - cloud.points.iter().flatten().min().unwrap_or(&0);
    // Some steps of the grid.
    let radius = extent / 12;
    let kinds = [
        ("16 nearest", Neighbourhood::Nearest(16)),
        ("within a radius", Neighbourhood::Within(radius)),
        ("16 nearest within a radius", Neighbourhood::NearestWithin(16, radius)),
    ];
    let rows = kinds.into_iter().map(|(kind, neighbourhood)| {
        let planes = surfaces(&cloud.points, neighbourhood);
        let found = planes.iter().filter_map(|plane| plane.as_ref().ok());
        let worst = found.map(|plane| angle(plane.normal, normal)).fold(0.0, f64::max);
        // At corners and in sparse places what is near can be on a line; it says so.
        let refused = planes.iter().filter(|plane| plane.is_err()).count();
        let worst = if 10 * refused > planes.len() { f64::INFINITY } else { worst };
        Row::new(
            format!("normals, {kind}: {}", cloud.name),
            (worst, "rad"),
            (1e-13, "the rounding of the covariance over a second variance of 1/50 of the first"),
            REFERENCE,
        )
    });
    rows.collect()
}

/// What has no plane.
fn named(cloud: &Cloud) -> Option<Row> {
    let expected = match cloud.name {
        "a million duplicates" | "one point" => NoPlane::Point,
        "no point" => NoPlane::Empty,
        "collinear" => NoPlane::Line,
        "repeated eigenvalues (a cube)" => NoPlane::Round,
        _ => return None,
    };
    Some(Row::holds(
        format!("no plane: {}", cloud.name),
        fit(&cloud.points) == Err(expected),
        "what does not tell a normal says why",
        "the shape of the points",
    ))
}
