//! What holds of every path.

use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::camera::Projection;

fn vector(reach: f64) -> impl Strategy<Value = DVec3> {
    [-reach..=reach, -reach..=reach, -reach..=reach].prop_map(|v: [f64; 3]| v.into())
}

/// Places within 1, often the same or nearly so.
fn place() -> impl Strategy<Value = DVec3> {
    prop_oneof![
        vector(1.0),
        vector(1e-3),
        vector(1e-6).prop_map(|v| (v + DVec3::X) / 1.001),
        Just(DVec3::ZERO),
        Just(DVec3::X)
    ]
}

/// Where a path is, and its size.
fn frame() -> impl Strategy<Value = (DVec3, f64)> {
    prop_oneof![
        (-12.0..15.0).prop_map(|exponent: f64| (DVec3::ZERO, 10f64.powf(exponent))),
        (-1.0..7.0).prop_map(|exponent: f64| (DVec3::new(5e5, 5e6, 1e2), 10f64.powf(exponent))),
    ]
}

fn up() -> impl Strategy<Value = DVec3> {
    prop_oneof![
        Just(DVec3::Z),
        Just(DVec3::NEG_Z),
        Just(1e-9 * DVec3::X),
        vector(1.0),
        vector(LARGEST_COORDINATE),
    ]
}

/// Number of the lens by a share in (0, 1): the whole range that is allowed.
fn lens(is_perspective: bool, share: f64) -> Lens {
    if is_perspective {
        Lens::FovYDegrees(180.0 * share)
    } else {
        Lens::OrthographicHeight(1e-12 * 1e24f64.powf(share))
    }
}

/// Steps of time from a microsecond to years.
fn step() -> impl Strategy<Value = f64> {
    prop_oneof![0.1..10.0, (-5.9..7.0).prop_map(|exponent: f64| 10f64.powf(exponent))]
}

prop_compose! {
    fn draft()(
        step in step(), position in place(), target in place(), up in up(),
        share in prop_oneof![0.01..0.99, Just(1e-12), Just(1.0 - 1e-12)], jump in prop::bool::weighted(0.2),
    ) -> (f64, KeyFrame, f64) {
        let lens = Lens::FovYDegrees(1.0);
        (step, KeyFrame { time: 0.0, position, target, up, lens, jump }, share)
    }
}

/// Keys that come in order; whether they are possible is for [`CameraPath::new`] to tell.
fn keys() -> impl Strategy<Value = (Vec<KeyFrame>, bool)> {
    let drafts = prop::collection::vec(draft(), 1..8);
    let parts = (drafts, frame(), any::<bool>(), any::<bool>());
    parts.prop_map(|(drafts, (origin, size), is_perspective, is_loop)| {
        let mut time = -3.0;
        let mut keys = Vec::new();
        for (index, (step, key, share)) in drafts.into_iter().enumerate() {
            let jump = key.jump && index > 0;
            let [position, target] = [key.position, key.target].map(|v| origin + size * v);
            let lens = lens(is_perspective, share);
            keys.push(KeyFrame { time, jump, lens, position, target, ..key });
            time += step;
        }
        if is_loop {
            keys.push(KeyFrame { time, ..keys[0] });
        }
        (keys, is_loop)
    })
}

fn path() -> impl Strategy<Value = CameraPath> {
    keys().prop_filter_map("a path", |(keys, is_loop)| CameraPath::new(keys, is_loop).ok())
}

/// Paths whose derivatives can be told by differences.
fn tame_path() -> impl Strategy<Value = CameraPath> {
    let key = (vector(10.0), vector(10.0), 0.1..3.0, 0.05..0.9);
    (prop::collection::vec(key, 3..8), any::<bool>(), any::<bool>()).prop_filter_map(
        "a path",
        |(drafts, is_perspective, is_loop)| {
            let mut time = 0.0;
            let mut keys = Vec::new();
            for (position, target, step, share) in drafts {
                let (up, lens) = (DVec3::Z, lens(is_perspective, share));
                keys.push(KeyFrame { time, position, target, up, lens, jump: false });
                time += step;
            }
            if is_loop {
                keys.push(KeyFrame { time, ..keys[0] });
            }
            CameraPath::new(keys, is_loop).ok()
        },
    )
}

fn number(projection: Projection) -> f64 {
    match projection {
        Projection::Perspective { fov_y } => fov_y,
        Projection::Orthographic { height } => height,
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn every_camera_of_every_path_is_possible(path in path(), share in -0.5..1.5, time in any::<f64>()) {
        let camera = path.at(path.start() + share * path.duration());
        prop_assert_eq!(camera.check(), Ok(()));
        prop_assert_eq!(path.at(time).check(), Ok(()));
        for pair in path.keys().windows(2) {
            // Where position and target are likely to meet, and close to the keys.
            for s in [1e-9, 0.25, 0.5, 0.75, 1.0 - 1e-9] {
                let time = pair[0].time + s * (pair[1].time - pair[0].time);
                prop_assert_eq!(path.at(time).check(), Ok(()));
            }
        }
    }

    #[test]
    fn every_path_passes_through_its_keys_exactly(path in path()) {
        for key in path.keys() {
            prop_assert_eq!(path.at(key.time), key.camera());
        }
        let end = path.start() + path.duration();
        prop_assert_eq!(path.at(f64::NEG_INFINITY).eye.is_finite(), true);
        if !path.is_loop() {
            prop_assert_eq!(path.at(path.start() - 1.0), path.keys()[0].camera());
            prop_assert_eq!(path.at(end + 1.0), path.keys()[path.keys().len() - 1].camera());
        }
    }

    #[test]
    fn every_path_comes_back_from_its_file(path in path(), name in any::<Option<String>>()) {
        let path = match name {
            Some(name) => path.with_name(name),
            None => path,
        };
        prop_assert_eq!(CameraPath::from_json(&path.to_json()), Ok(path));
    }

    #[test]
    fn a_curve_stays_near_its_chord_and_the_lens_between_its_keys(path in path(), s in 0.0..1.0) {
        for pair in path.keys().windows(2) {
            let time = pair[0].time + s * (pair[1].time - pair[0].time);
            let camera = path.at(time);
            let (from, chord) = (pair[0].position, pair[1].position - pair[0].position);
            let along = ((camera.eye - from).dot(chord) / chord.length_squared()).clamp(0.0, 1.0);
            let along = if along.is_nan() { 0.0 } else { along };
            let off = (camera.eye - from - along * chord).length();
            let rounding = 1e-14 * (pair[0].reach() + pair[1].reach());
            prop_assert!(off <= 0.75 * chord.length() + rounding, "{} off {}", off, chord);
            let values = [number(pair[0].camera().projection), number(pair[1].camera().projection)];
            let between = number(camera.projection);
            let (low, high) = (values[0].min(values[1]), values[0].max(values[1]));
            prop_assert!(low <= between && between <= high);
        }
    }

    #[test]
    fn the_velocity_has_no_step_at_a_key(path in tame_path()) {
        let keys = path.keys();
        let inner = keys.len() - usize::from(!path.is_loop());
        for key in &keys[1..inner] {
            let delta = 1e-6;
            let [before, at, after] = [-delta, 0.0, delta].map(|d| path.at(key.time + d));
            let jerk = |place: fn(&crate::camera::Camera) -> DVec3| {
                ((place(&after) - place(&at)) - (place(&at) - place(&before))).length() / delta
            };
            // Accelerations reach 6 · 20 / 0.1² + 4 · 3 · 20 / 0.1².
            prop_assert!(jerk(|camera| camera.eye) < 0.1);
            // Where the key's target is very near, the direction of the view is another.
            if key.view().length() > 0.1 {
                prop_assert!(jerk(|camera| camera.target) < 0.1);
            }
            let ln = |camera: &crate::camera::Camera| number(camera.projection).ln();
            prop_assert!(((ln(&after) - ln(&at)) - (ln(&at) - ln(&before))).abs() / delta < 0.1);
        }
    }

    #[test]
    fn no_text_makes_the_reader_panic(text in ".*", cut in any::<prop::sample::Index>(), path in path()) {
        let _ = CameraPath::from_json(&text);
        let whole = path.to_json();
        let mut end = cut.index(whole.len());
        while !whole.is_char_boundary(end) {
            end -= 1;
        }
        // All but the line end is needed.
        if end + 1 < whole.len() {
            prop_assert!(CameraPath::from_json(&whole[..end]).is_err());
        }
    }
}

fn key(time: f64, position: [f64; 3], target: [f64; 3]) -> KeyFrame {
    KeyFrame {
        time,
        position: position.into(),
        target: target.into(),
        up: DVec3::Z,
        lens: Lens::FovYDegrees(60.0),
        jump: false,
    }
}

fn through(keys: &[KeyFrame]) -> CameraPath {
    CameraPath::new(keys.to_vec(), false).expect("a path")
}

#[test]
fn two_keys_are_a_straight_line_at_constant_speed() {
    let path = through(&[key(1.0, [0.0; 3], [9.0; 3]), key(3.0, [4.0, 0.0, 0.0], [9.0; 3])]);
    for (time, x) in [(0.0, 0.0), (1.5, 1.0), (2.0, 2.0), (2.5, 3.0), (7.0, 4.0)] {
        assert!((path.at(time).eye - DVec3::new(x, 0.0, 0.0)).length() < 1e-15);
    }
    assert_eq!((path.start(), path.duration()), (1.0, 2.0));
}

#[test]
fn uneven_times_change_the_speed_without_a_detour() {
    // A hundred metres in a millisecond, before and after a slow minute.
    let at = |time: f64, x: f64| key(time, [x, 0.0, 0.0], [x, 1.0, 0.0]);
    let path = through(&[at(0.0, 0.0), at(0.001, 100.0), at(60.0, 101.0), at(60.001, 201.0)]);
    for step in 0..1000 {
        let x = path.at(0.001 + 59.999 * f64::from(step) / 1000.0).eye.x;
        assert!((100.0..=101.0).contains(&x), "{x}");
    }
}

#[test]
fn a_camera_that_rests_at_two_keys_rests_between_them() {
    let rest = [5.0, 5.0, 5.0];
    let path = through(&[
        key(0.0, [0.0; 3], [9.0; 3]),
        key(1.0, rest, [9.0; 3]),
        key(2.0, rest, [9.0; 3]),
        key(3.0, [7.0, 0.0, 0.0], [9.0; 3]),
    ]);
    assert_eq!(path.at(1.3), path.at(1.7));
    assert_eq!(path.at(1.3).eye, DVec3::from(rest));
}

#[test]
fn a_jump_is_neither_foreseen_nor_remembered() {
    let far = KeyFrame { jump: true, ..key(2.0, [1e6, 0.0, 0.0], [0.0; 3]) };
    let before = [key(0.0, [1.0, 0.0, 0.0], [9.0; 3]), key(1.0, [2.0, 0.0, 0.0], [9.0; 3])];
    let path = through(&[before[0], before[1], far, key(3.0, [1e6, 1.0, 0.0], [0.0; 3])]);
    assert_eq!(path.at(0.7), through(&before).at(0.7), "as if nothing came");
    assert_eq!(path.at(1.0f64.next_up()), before[1].camera());
    assert_eq!(path.at(2.0f64.next_down()), before[1].camera());
    assert_eq!(path.at(2.0), far.camera());
    assert!((path.at(2.5).eye - DVec3::new(1e6, 0.5, 0.0)).length() < 1e-9);
}

#[test]
fn where_eye_and_target_meet_the_nearer_key_tells_the_direction() {
    // They change places, and would meet halfway.
    let path = through(&[
        key(0.0, [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        key(1.0, [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]),
    ]);
    for (time, forward) in [(0.4999, DVec3::X), (0.5, DVec3::NEG_X), (0.5001, DVec3::NEG_X)] {
        let camera = path.at(time);
        assert_eq!(camera.check(), Ok(()));
        assert_eq!(camera.basis().forward, forward, "{time}");
    }
}

#[test]
fn a_field_of_view_halves_in_the_time_in_which_it_halved_before() {
    let at = |time: f64, degrees: f64| KeyFrame {
        lens: Lens::FovYDegrees(degrees),
        ..key(time, [0.0; 3], [1.0; 3])
    };
    let path = through(&[at(0.0, 80.0), at(1.0, 40.0), at(2.0, 20.0)]);
    let degrees = |time: f64| number(path.at(time).projection).to_degrees();
    assert!((degrees(0.5) - 80.0 * 0.5f64.sqrt()).abs() < 1e-12, "{}", degrees(0.5));
    assert!((degrees(1.5) - 40.0 * 0.5f64.sqrt()).abs() < 1e-12, "{}", degrees(1.5));
}

#[test]
fn a_loop_goes_round() {
    let keys = [
        key(1.0, [1.0, 0.0, 0.0], [0.0; 3]),
        key(2.0, [0.0, 1.0, 0.0], [0.0; 3]),
        key(3.0, [-1.0, 0.0, 0.0], [0.0; 3]),
        key(4.0, [0.0, -1.0, 0.0], [0.0; 3]),
        key(5.0, [1.0, 0.0, 0.0], [0.0; 3]),
    ];
    let path = CameraPath::new(keys.to_vec(), true).expect("a loop");
    let near = |a: f64, b: f64| (path.at(a).eye - path.at(b).eye).length() < 1e-12;
    assert!(near(1.5, 5.5) && near(1.5, -2.5) && near(4.75, 4004.75));
    // By symmetry every quarter is the same curve, that through the seam included.
    let radius = |time: f64| path.at(time).eye.length();
    assert!((radius(1.3) - radius(3.3)).abs() < 1e-12);
    assert!((radius(4.7) - radius(2.7)).abs() < 1e-12);
    assert_eq!(path.times(4).collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0]);
    let open = through(&keys);
    assert_eq!(open.times(5).collect::<Vec<_>>(), [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(open.times(1).collect::<Vec<_>>(), [1.0]);
    assert_eq!(open.times(0).count(), 0);
}

#[test]
fn what_is_no_path_is_refused_with_the_number_of_the_key() {
    let good = r#"{"time":0,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#;
    let file =
        |keys: &str| format!(r#"{{"format":"lodestream-path","version":1,"keys":[{good}{keys}]}}"#);
    CameraPath::from_json(&file("")).expect("one key is a path");
    for (key, expected) in [
        (r#"{"time":0,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "not after"),
        (r#"{"time":1e-9,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "microsecond"),
        (r#"{"time":2e9,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "1e9 seconds"),
        (r#"{"time":1,"position":[0,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "same place"),
        (r#"{"time":1,"position":[1,0,1e-13],"target":[1,0,0],"fov_y_degrees":60}"#, "apart"),
        (r#"{"time":1,"position":[1,0,1e16],"target":[0,0,0],"fov_y_degrees":60}"#, "position"),
        (r#"{"time":1,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":180}"#, "below 180"),
        (r#"{"time":1,"position":[1,0,0],"target":[0,0,0],"orthographic_height":0}"#, "above 0"),
        (r#"{"time":1,"position":[1,0,0],"target":[0,0,0],"orthographic_height":9}"#, "one or the"),
        (r#"{"time":1,"position":[1,0,0],"target":[0,0,0]}"#, "give fov_y_degrees or"),
        (
            r#"{"time":1,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":9,"orthographic_height":9}"#,
            "not both",
        ),
        (r#"{"time":1,"position":[1,0,0],"target":[0,0,0],"up":[0,0,0],"fov_y_degrees":9}"#, "up"),
        (r#"{"time":1,"position":[1,0,0],"fov_y_degrees":60}"#, "target"),
        (r#"{"time":1,"position":[1,0],"target":[0,0,0],"fov_y_degrees":60}"#, "length 2"),
        (r#"{"time":"1","position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "string"),
        (r#"{"time":1,"at":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "unknown field `at`"),
        (r#"{"time":1e999,"position":[1,0,0],"target":[0,0,0],"fov_y_degrees":60}"#, "range"),
    ] {
        let error = CameraPath::from_json(&file(&format!(",{key}"))).expect_err(key).to_string();
        assert!(error.contains("key 2: ") && error.contains(expected), "{key}: {error}");
        assert!(!error.contains('\n'), "{error}");
    }
    let refused = |text: &str| CameraPath::from_json(text).expect_err(text).to_string();
    let jump = file("").replace("60}", r#"60,"jump":true}"#);
    assert!(refused(&jump).contains("key 1: nothing comes before it"));
    let whole = |rest: &str| format!(r#"{{"format":"lodestream-path",{rest}}}"#);
    assert!(refused(&whole(r#""version":1,"keys":[]"#)).contains("at least one key"));
    assert!(refused(&whole(r#""version":2,"keys":{}"#)).contains("version 2"));
    assert!(refused(&whole(r#""version":0,"keys":[]"#)).contains("version 0"));
    assert!(refused(&whole(r#""version":1"#)).contains("missing field `keys`"));
    assert!(refused(&whole(r#""version":1,"keys":[],"looped":true"#)).contains("`looped`"));
    assert!(refused(r#"{"format":"gltf","version":1}"#).contains("gltf"));
    assert!(refused(r#"{"eye":[0,0,0]}"#).contains("not a camera path: missing field `format`"));
    let looped = |keys: &str| file(keys).replace(r#""keys""#, r#""loop":true,"keys""#);
    assert!(refused(&looped("")).contains("at least two keys"));
    let open = r#",{"time":1,"position":[2,0,0],"target":[0,0,0],"fov_y_degrees":60}"#;
    assert!(refused(&looped(open)).contains("key 2: a loop ends where it begins"));
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let error = CameraPath::read(std::path::Path::new("no/such.json")).expect_err("not there");
    assert!(error.to_string().starts_with("no/such.json: "), "{error}");
}
