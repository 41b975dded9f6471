//! What holds of every generator, for clouds of every shape.

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::{
    camera::Projection,
    path::{CameraPath, KeyFrame},
};

fn path(text: &str, extent: &Extent) -> CameraPath {
    PathSpec::parse(text).expect(text).path(extent).expect(text)
}

fn courtyard() -> Extent {
    Extent::new([-2.0, -3.0, -0.5], [30.0, 28.0, 9.0]).expect("finite")
}

/// Clouds that are boxes, sheets, needles and points, near the origin and far from it.
fn extent() -> impl Strategy<Value = Extent> {
    let side = || prop_oneof![Just(0.0), Just(1.0), (-9.0..9.0).prop_map(|e: f64| 10f64.powf(e))];
    let corner = prop_oneof![
        Just([0.0; 3]),
        Just([635_577.0, 8_848_882.0, 406.0]),
        Just([4.2e6, 1.7e5, 4.78e6]),
        Just([-1e13, 1e13, 0.0]),
        [-1e3..1e3, -1e3..1e3, -1e3..1e3],
    ];
    (corner, side(), side(), side()).prop_filter_map("finite", |(min, x, y, z)| {
        Extent::new(min, (DVec3::from(min) + DVec3::new(x, y, z)).to_array()).ok()
    })
}

fn line() -> impl Strategy<Value = String> {
    let options = prop_oneof![
        Just(("orbit", "")),
        Just(("orbit", "&turns=-2.5&elevation=89&distance=0.01")),
        Just(("orbit", "&turns=0.001&elevation=-89&distance=1000")),
        Just(("flythrough", "")),
        Just(("flythrough", "&height=-10")),
        Just(("zoom", "")),
        Just(("zoom", "&factor=1000000")),
        Just(("zoom", "&factor=1000000&by=fov")),
        Just(("teleport", "")),
        Just(("teleport", "&stops=50&factor=1000000")),
        Just(("random-walk", "")),
        Just(("random-walk", "&steps=1")),
        Just(("random-walk", "&steps=300&stride=0.001")),
        Just(("random-walk", "&steps=300&stride=1")),
    ];
    let fov = prop_oneof![Just(1.0), Just(50.0), Just(150.0)];
    (options, prop_oneof![Just(0), any::<u64>()], fov, 1.0..1e6).prop_map(
        |((name, rest), seed, fov, seconds)| {
            format!("{name}?seconds={seconds}&seed={seed}&fov={fov}{rest}")
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn every_generator_makes_a_path_for_every_cloud(line in line(), extent in extent(), s in 0.0..1.0) {
        let made = path(&line, &extent);
        prop_assert_eq!(made.name(), Some(line.as_str()));
        prop_assert_eq!(made.start(), 0.0);
        let asked: f64 = line.split(['=', '&']).nth(1).expect("seconds").parse().expect("a number");
        prop_assert!((made.duration() - asked).abs() <= 1e-9 * asked);
        prop_assert_eq!(made.at(s * asked).check(), Ok(()));
        prop_assert_eq!(&path(&line, &extent), &made, "not the same again");
        prop_assert_eq!(CameraPath::from_json(&made.to_json()), Ok(made));
    }
}

#[test]
fn seeds_make_different_paths() {
    for name in GENERATORS {
        let of = |seed: u32| path(&format!("{name}?seed={seed}"), &courtyard());
        assert_ne!(of(0).keys(), of(1).keys(), "{name}");
        assert_ne!(of(1).keys(), of(2).keys(), "{name}");
    }
}

#[test]
fn an_orbit_keeps_its_distance_and_sees_the_cloud() {
    let extent = courtyard();
    let orbit = path("orbit?seconds=8&turns=2", &extent);
    assert!(orbit.is_loop());
    let distance = |time: f64| (orbit.at(time).eye - extent.center()).length();
    for time in orbit.times(97) {
        assert!((distance(time) / distance(0.0) - 1.0).abs() < 2e-4, "{time}");
        assert!((orbit.at(time).target - extent.center()).length() < 1e-12);
    }
    let radius = distance(0.0);
    assert!(radius > 0.5 * extent.size() && radius < 3.0 * extent.size(), "{radius}");
    let quarter = orbit.at(1.0).eye - extent.center();
    assert!(quarter.x > 0.8 * radius, "counter-clockwise from the south is east: {quarter}");
    assert!(!path("orbit?turns=1.5", &extent).is_loop());
}

#[test]
fn a_flythrough_goes_through_the_cloud_and_looks_at_it() {
    for max in [[30.0, 28.0, 9.0], [30.0, 280.0, 9.0], [30.0, 28.0, 900.0]] {
        let extent = Extent::new([-2.0, -3.0, -0.5], max).expect("finite");
        let flight = path("flythrough", &extent);
        let inside = |time: f64| {
            let off = (flight.at(time).eye - extent.center()).abs() - extent.roomy_half();
            off.max_element() <= 0.0
        };
        assert!(!inside(0.0) && inside(6.0) && inside(10.0));
        for time in flight.times(50) {
            let camera = flight.at(time);
            let ahead = (extent.center() - camera.eye).dot(camera.basis().forward);
            assert!(time > 6.0 || ahead > 0.0, "it has its back to the cloud at {time}");
        }
    }
}

#[test]
fn a_zoom_comes_nearer_by_its_factor_and_back() {
    let extent = courtyard();
    let zoom = path("zoom?factor=100&seconds=10", &extent);
    let distance = |time: f64| (zoom.at(time).eye - zoom.at(time).target).length();
    assert!((distance(0.0) / distance(5.0) - 100.0).abs() < 1e-9);
    assert_eq!(zoom.at(10.0), zoom.at(0.0));
    let by_fov = path("zoom?factor=100&seconds=10&by=fov&fov=60", &extent);
    let tangent = |time: f64| match by_fov.at(time).projection {
        Projection::Perspective { fov_y } => (0.5 * fov_y).tan(),
        Projection::Orthographic { .. } => f64::NAN,
    };
    assert!((tangent(0.0) / tangent(5.0) - 100.0).abs() < 1e-9);
    assert!((tangent(0.0) - 30f64.to_radians().tan()).abs() < 1e-12);
    assert_eq!(by_fov.at(5.0).eye, by_fov.at(0.0).eye);
}

#[test]
fn a_teleport_stays_and_jumps_and_is_elsewhere() {
    let extent = courtyard();
    let path = path("teleport?stops=20&seconds=20&seed=5", &extent);
    assert!(path.keys()[1..20].iter().all(|key| key.jump));
    let stay = |stop: usize| [0.0, 0.3, 0.999].map(|later| path.at(stop as f64 + later));
    let mut unlike = 0.0;
    for stop in 0..20 {
        let [camera, later, last] = stay(stop);
        assert!(camera == later && camera == last);
        let next = path.at(stop as f64 + 1.0);
        let reach = |camera: &crate::camera::Camera| (camera.eye - camera.target).length();
        unlike += (camera.target - next.target).length() / extent.size()
            + (reach(&camera) / reach(&next)).ln().abs() / 100f64.ln();
    }
    assert!(unlike / 19.0 > 0.6, "{unlike}");
}

#[test]
fn a_random_walk_stays_inside() {
    let extent = courtyard();
    let walk = path("random-walk?steps=500&seed=9", &extent);
    let local = |key: &KeyFrame| (key.position - extent.center()) / extent.half();
    assert!(walk.keys().iter().all(|key| local(key).abs().max_element() <= 1.0 + 1e-12));
    let far = |axis: usize, side: f64| {
        walk.keys().iter().map(|key| side * local(key)[axis]).fold(0.0, f64::max)
    };
    for side in [-1.0, 1.0] {
        assert!(far(0, side) > 0.5 && far(1, side) > 0.5, "it does not come about");
    }
}

#[test]
fn lines_that_name_no_generator_say_what_would_be_right() {
    for (line, expected) in [
        ("orbits", "there are orbit, flythrough"),
        ("orbit?turns", "has no value"),
        ("orbit?turns=0", "no movement"),
        ("orbit?turns=x", "turns=x is not a number from -1000 to 1000"),
        ("orbit?elevation=90", "from -89 to 89"),
        ("orbit?seconds=0", "seconds=0"),
        ("orbit?seconds=nan", "seconds=nan"),
        ("orbit?seconds=1&seconds=2", "given twice"),
        ("orbit?seed=-1", "seed=-1 is not a whole number"),
        ("orbit?height=1", "has no option \"height\"; it has seconds, seed, fov, turns"),
        ("flythrough?height=11", "from -10 to 10"),
        ("zoom?by=foot", "distance or fov"),
        ("zoom?factor=1", "factor=1"),
        ("teleport?stops=1", "from 2 to 10000"),
        ("random-walk?stride=0", "stride=0"),
    ] {
        let error = PathSpec::parse(line).expect_err(line).to_string();
        assert!(error.contains(expected), "{line}: {error}");
        assert!(!error.contains('\n'));
    }
}
