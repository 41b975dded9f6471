//! Normals and curvatures: the plane that fits what is around each point.

use rayon::prelude::*;

use super::{Moments, Neighbours, NoPlane, Plane, neighbours::difference};

/// Who counts as being around a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Neighbourhood {
    /// So many points nearest to it, itself among them.
    Nearest(usize),
    /// All points within so many lattice units.
    Within(u32),
    /// So many points nearest to it, but no farther than so many lattice units: holes stay holes, and
    /// dense places cost no more than others.
    NearestWithin(usize, u32),
}

/// Points that one task takes.
const TASK_POINTS: usize = 1024;

/// The plane around each of `points`, which are in Morton order; the same for any number of threads.
#[must_use]
pub fn surfaces(points: &[[u32; 3]], neighbourhood: Neighbourhood) -> Vec<Result<Plane, NoPlane>> {
    let index = Neighbours::new(points);
    let index = match neighbourhood {
        Neighbourhood::Within(_) => index.with_sums(),
        Neighbourhood::Nearest(_) | Neighbourhood::NearestWithin(..) => index,
    };
    let planes = points.par_iter().with_min_len(TASK_POINTS).map_init(Vec::new, |found, &q| {
        let moments = match neighbourhood {
            Neighbourhood::Within(radius) => index.moments_within(q, radius),
            Neighbourhood::Nearest(k) => around(&index, q, k, u32::MAX, found),
            Neighbourhood::NearestWithin(k, radius) => around(&index, q, k, radius, found),
        };
        Plane::fit(&moments.covariance().ok_or(NoPlane::Empty)?)
    });
    planes.collect()
}

/// Sums over the nearest points, about `q`.
fn around(
    index: &Neighbours<'_>,
    q: [u32; 3],
    k: usize,
    reach: u32,
    found: &mut Vec<(u128, u32)>,
) -> Moments {
    index.nearest(q, k, reach, found);
    let mut moments = Moments::default();
    for &(_, point) in found.iter() {
        moments.add(difference(index.points()[point as usize], q));
    }
    moments
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use lodestream_protocol::MortonCode;

    use super::*;

    /// A roof: two planes that meet in a ridge.
    fn roof(corner: [u32; 3]) -> Vec<[u32; 3]> {
        let mut points: Vec<[u32; 3]> = (0..40 * 40)
            .map(|i| [i % 40, i / 40])
            .map(|[x, y]| [corner[0] + 10 * x, corner[1] + 10 * y, corner[2] + 10 * x.min(39 - x)])
            .collect();
        points.sort_by_key(|&q| u128::encode(q));
        points
    }

    #[test]
    fn normals_of_a_roof_are_those_of_its_sides_wherever_it_stands() {
        let kinds = [
            Neighbourhood::Nearest(12),
            Neighbourhood::Within(35),
            Neighbourhood::NearestWithin(12, 35),
        ];
        for (corner, kind) in
            [[0; 3], [4_294_000_000; 3]].into_iter().flat_map(|c| kinds.map(|k| (c, k)))
        {
            let points = roof(corner);
            for (q, plane) in points.iter().zip(surfaces(&points, kind)) {
                let x = (q[0] - corner[0]) / 10;
                let plane = plane.expect("a surface");
                let slope = if x < 20 { -1.0 } else { 1.0 };
                let side = DVec3::new(slope, 0.0, 1.0).normalize();
                // 1 : 1, so that the signs of the normals are those of equally large components.
                let sine = plane.normal.cross(side).length();
                if !(15..25).contains(&x) {
                    assert!(sine < 1e-14 && plane.curvature < 1e-14, "{q:?} {plane:?}");
                } else if (19..21).contains(&x) {
                    assert!(plane.curvature > 1e-3, "{q:?} {plane:?}");
                }
            }
        }
    }

    #[test]
    fn points_without_a_surface_say_why() {
        let points = [[0; 3], [1, 0, 0], [1_000_000, 0, 0]];
        let planes = surfaces(&points, Neighbourhood::NearestWithin(3, 10));
        assert_eq!(planes, [Err(NoPlane::Line), Err(NoPlane::Line), Err(NoPlane::Point)]);
        assert_eq!(surfaces(&points, Neighbourhood::Nearest(0)), [Err(NoPlane::Empty); 3]);
        assert!(surfaces(&[], Neighbourhood::Nearest(3)).is_empty());
    }
}
