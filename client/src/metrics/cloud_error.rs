//! A set of points against all points.

use glam::DVec3;
use palette::{IntoColor, Lab, Srgb, color_difference::Ciede2000};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{MetricsError, PointSet, Spread, neighbours::Neighbour};

/// Points that one task looks up: the first without a guess, the others from the last one's nearest.
const TASK_POINTS: usize = 4096;

/// How far a set of points of a dataset, such as those drawn, is from all points of it (or all in
/// view).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CloudError {
    /// From each point of all to the nearest of the set, world units: what is missing. `None` where
    /// either has no points.
    pub missing: Option<Spread>,
    /// From each point of the set to the nearest of all, world units: what is made up. 0 throughout
    /// for a set that was chosen from all. `None` where either has no points.
    pub made_up: Option<Spread>,
    /// Angle between the normal of each point of all and that of the nearest of the set, degrees, 0
    /// to 90: of the two normals of a surface, neither is the front. `None` where there are no two
    /// such points with normals.
    pub normal_degrees: Option<Spread>,
    /// Difference between the colour of each point of all and that of the nearest of the set,
    /// CIEDE2000 (about 1 is just noticeable, black to white is 100). `None` where there are no two
    /// such points with colours.
    pub color_ciede2000: Option<Spread>,
}

impl CloudError {
    /// The error of a set of points of the dataset that `all` are of.
    ///
    /// # Errors
    /// [`MetricsError::Lattices`] where the two are not of one dataset.
    pub fn between(set: &PointSet, all: &PointSet) -> Result<Self, MetricsError> {
        if set.lattice() != all.lattice() {
            return Err(MetricsError::Lattices);
        }
        let nearest = find(all, set);
        let pairs =
            || nearest.par_iter().enumerate().map(|(point, near)| (point, near.index as usize));
        let normals = pairs().filter_map(|(point, near)| {
            let (a, b) = (all.normals.get(point)?.as_ref()?, set.normals.get(near)?.as_ref()?);
            Some(degrees(*a, *b))
        });
        let colors = pairs().filter_map(|(point, near)| {
            let (a, b) = (all.colors.get(point)?.as_ref()?, set.colors.get(near)?.as_ref()?);
            Some(ciede2000(*a, *b))
        });
        let scale = all.lattice().scale;
        Ok(Self {
            missing: distances(&nearest, scale),
            made_up: distances(&find(set, all), scale),
            normal_degrees: Spread::of(&mut normals.collect::<Vec<_>>()),
            color_ciede2000: Spread::of(&mut colors.collect::<Vec<_>>()),
        })
    }
}

/// Of each point of one set, the nearest of another; nothing where that is empty.
fn find(of: &PointSet, among: &PointSet) -> Vec<Neighbour> {
    let neighbours = among.neighbours();
    let task = |places: &[[u32; 3]]| {
        let mut last = None;
        let look_up = |place: &[u32; 3]| {
            last = neighbours.nearest(*place, last);
            last
        };
        places.iter().filter_map(look_up).collect::<Vec<_>>()
    };
    of.places.par_chunks(TASK_POINTS).flat_map_iter(task).collect()
}

fn distances(nearest: &[Neighbour], scale: f64) -> Option<Spread> {
    let distances = nearest.par_iter().map(|near| scale * near.squared.sqrt());
    Spread::of(&mut distances.collect::<Vec<_>>())
}

/// The angle between two unoriented directions.
fn degrees(a: [f32; 3], b: [f32; 3]) -> f64 {
    let [a, b] = [a, b].map(|v| DVec3::from_array(v.map(f64::from)));
    // By sine and cosine: the cosine alone cannot tell small angles.
    a.cross(b).length().atan2(a.dot(b).abs()).to_degrees()
}

fn ciede2000(a: [u8; 3], b: [u8; 3]) -> f64 {
    let [a, b] = [a, b].map(|color| -> Lab<palette::white_point::D65, f64> {
        Srgb::from(color).into_linear::<f64>().into_color()
    });
    a.difference(b)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lodestream_protocol::{Lattice, Manifest};

    use super::*;
    use crate::render::testing::{Point, TestScene, cloud, landscape};

    const LATTICE: Lattice =
        Lattice { scale: 0.5, offset: [4e6, 5e5, -1e3], origin: [0; 3], side_bits: 16 };

    fn set(scene: &TestScene) -> PointSet {
        let mut set = PointSet::new(&scene.clouds[0]);
        for node in &scene.nodes {
            set.add(&node.points).expect("few points");
        }
        set
    }

    fn points(points: &[([u32; 3], [u8; 3])]) -> TestScene {
        let point = |(q, rgb): &([u32; 3], [u8; 3])| Point { q: *q, rgb: *rgb, intensity: 0 };
        cloud(LATTICE, 1, &points.iter().map(point).collect::<Vec<_>>())
    }

    fn between(set: &PointSet, all: &PointSet) -> CloudError {
        CloudError::between(set, all).expect("of one dataset")
    }

    #[test]
    fn both_ways_are_measured_in_world_units() {
        let all = set(&points(&[([0; 3], [0; 3]), ([3, 4, 0], [0; 3]), ([300, 400, 0], [0; 3])]));
        let drawn = set(&points(&[([0; 3], [0; 3]), ([0, 0, 12], [0; 3])]));
        let CloudError { missing, made_up, .. } = between(&drawn, &all);
        let missing = missing.expect("points");
        assert_eq!((missing.count, missing.max), (3, 250.0 - 0.0));
        assert_eq!(missing.mean, (0.0 + 2.5 + 250.0) / 3.0);
        let expected = Spread { count: 2, mean: 3.0, p99: 6.0, max: 6.0 };
        assert_eq!(made_up, Some(expected));
    }

    #[test]
    fn a_chosen_set_misses_points_and_makes_up_none() {
        let all = cloud(LATTICE, 3, &landscape(16, 5000)).with_surface();
        let root = TestScene { nodes: all.nodes[..1].to_vec(), clouds: all.clouds.clone() };
        let error = between(&set(&root), &set(&all));
        assert_eq!(error.made_up.expect("points").max, 0.0);
        let missing = error.missing.expect("points");
        assert!(missing.mean > 0.0 && missing.mean <= missing.p99 && missing.p99 <= missing.max);
        assert!(error.normal_degrees.is_some_and(|angle| angle.max > 0.0 && angle.max <= 90.0));
        assert!(error.color_ciede2000.is_some_and(|color| color.max > 0.0 && color.max < 120.0));
        let itself = between(&set(&all), &set(&all));
        assert_eq!(itself.missing.expect("points").max, 0.0);
    }

    #[test]
    fn the_number_of_threads_does_not_matter() {
        let all = cloud(LATTICE, 3, &landscape(16, 30_000)).with_surface();
        let root = TestScene { nodes: all.nodes[..9].to_vec(), clouds: all.clouds.clone() };
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| between(&set(&root), &set(&all)))
        };
        assert_eq!(with(1), with(4));
    }

    #[test]
    fn attributes_that_are_absent_have_no_error() {
        let scene = points(&[([1; 3], [9; 3]), ([2; 3], [9; 3])]);
        let error = between(&set(&scene), &set(&scene));
        assert_eq!(error.normal_degrees, None);
        assert_eq!(error.color_ciede2000, Some(Spread { count: 2, mean: 0.0, p99: 0.0, max: 0.0 }));
        let bare = Manifest { attributes: Vec::new(), ..scene.clouds[0].as_ref().clone() };
        let bare = TestScene { clouds: vec![Arc::new(bare)], nodes: scene.nodes.clone() };
        assert_eq!(between(&set(&bare), &set(&bare)).color_ciede2000, None);
    }

    #[test]
    fn columns_that_have_not_arrived_are_no_error() {
        let scene = points(&[([1; 3], [200, 0, 0])]);
        let mut partial = scene.clone();
        let mut node = partial.nodes[0].points.as_ref().clone();
        node.columns.clear();
        partial.nodes[0].points = Arc::new(node);
        assert_eq!(between(&set(&partial), &set(&scene)).color_ciede2000, None);
    }

    #[test]
    fn of_no_points_there_is_no_distance() {
        let (none, one) = (set(&points(&[])), set(&points(&[([5; 3], [0; 3])])));
        for (a, b) in [(&none, &one), (&one, &none), (&none, &none)] {
            let error = between(a, b);
            assert_eq!((error.missing, error.made_up), (None, None));
            assert_eq!((error.normal_degrees, error.color_ciede2000), (None, None));
        }
        assert!(none.is_empty() && one.len() == 1);
    }

    #[test]
    fn sets_of_different_datasets_are_refused() {
        let here = points(&[([1; 3], [0; 3])]);
        let lattice = Lattice { scale: 0.25, ..LATTICE };
        let there = cloud(lattice, 1, &[Point { q: [1; 3], rgb: [0; 3], intensity: 0 }]);
        let error = CloudError::between(&set(&here), &set(&there));
        assert_eq!(error, Err(MetricsError::Lattices));
    }

    #[test]
    fn small_angles_are_told_and_a_normal_has_no_front() {
        let tilted = [0.0, 1e-6, 1.0];
        assert!((degrees([0.0, 0.0, 1.0], tilted) - 1e-6_f64.to_degrees()).abs() < 1e-11);
        assert!(degrees([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]) < 1e-12);
        assert!((degrees([1.0, 0.0, 0.0], tilted) - 90.0).abs() < 1e-12);
    }

    #[test]
    fn colours_differ_as_the_commission_says() {
        assert!((ciede2000([0; 3], [255; 3]) - 100.0).abs() < 1e-3);
        assert_eq!(ciede2000([12, 200, 7], [12, 200, 7]), 0.0);
        // scikit-image 0.26: deltaE_ciede2000(rgb2lab(a), rgb2lab(b)).
        for (a, b, expected) in RECORDED_COLORS {
            let found = ciede2000(a, b);
            assert!((found - expected).abs() < 0.01, "{a:?} {b:?}: {found} for {expected}");
        }
        let all = [0u8, 1, 127, 128, 254, 255];
        for (r, g, b) in
            all.iter().flat_map(|r| all.iter().flat_map(move |g| all.map(|b| (*r, *g, b))))
        {
            let found = ciede2000([r, g, b], [b, r, g]);
            assert!((0.0..130.0).contains(&found), "{found}");
        }
    }

    const RECORDED_COLORS: [([u8; 3], [u8; 3], f64); 5] = [
        ([200, 30, 40], [190, 60, 30], 7.116_372),
        ([10, 20, 200], [40, 10, 180], 2.881_049),
        ([128, 128, 128], [140, 128, 120], 6.537_299),
        ([255, 255, 0], [0, 0, 255], 103.427_881),
        ([90, 160, 80], [90, 150, 95], 5.491_821),
    ];
}
