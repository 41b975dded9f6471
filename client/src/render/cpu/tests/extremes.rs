//! Every splat where numbers are hard.

use proptest::prelude::*;

use super::*;
use crate::render::{ColorMode, EyeDome, Scene, Shading, SizeLimits, testing::Random};

pub(in crate::render) const ALL: [&str; 4] = ["normal", "axis_u", "axis_v", "radius"];

/// A cloud around a place, of surfels that lie in all directions.
pub(in crate::render) fn ball(center: DVec3, radius: f64, count: usize) -> Vec<Surfel> {
    let mut random = Random::new(11);
    let mut direction = || {
        let unit = [0; 3].map(|_| 2.0 * random.unit() - 1.0);
        DVec3::from(unit).normalize_or(DVec3::X)
    };
    let surfel = |index: usize| {
        let [normal, other] = [direction(), direction()];
        let u = normal.cross(other).normalize_or(DVec3::Y);
        let v = 0.5 * normal.cross(u);
        Surfel {
            rgb: [index as u8, (index >> 4) as u8, 200],
            normal: normal.as_vec3().to_array(),
            axes: [u, v].map(|axis| (0.03 * radius * axis).as_vec3().to_array()),
            radius: (0.04 * radius) as f32,
            ..Surfel::at(center.x, center.z, center.y)
        }
    };
    let mut surfels: Vec<_> = (0..count).map(surfel).collect();
    for surfel in &mut surfels {
        surfel.place += radius * direction();
    }
    surfels
}

pub(in crate::render) fn shading() -> Shading {
    Shading { phong: true, eye_dome: Some(EyeDome::default()) }
}

#[test]
fn every_splat_far_from_the_origin_is_the_picture_at_the_origin() {
    let surfels = ball(DVec3::new(0.0, 30.0, 0.0), 12.0, 800);
    // UTM: metres north and east.
    let shift = DVec3::new(500_000.0, 5_000_000.0, 300.0);
    let (here, far) = (scene(&surfels, &ALL), scene_at(shift, &surfels, &ALL));
    for (splat, _) in Splat::ALL {
        for size in [SplatSize::Pixels(6.0), SplatSize::Own] {
            let settings = perspective([80, 60]);
            let settings =
                RenderSettings { splat, splat_size: size, shading: shading(), ..settings };
            let expected = render(&here, &settings);
            assert!(expected.picture.coverage() > 0.05, "{splat:?}");
            let camera = Camera {
                eye: settings.camera.eye + shift,
                target: settings.camera.target + shift,
                ..settings.camera
            };
            let found = render(&far, &RenderSettings { camera, ..settings });
            assert!(found == expected, "{splat:?} {size}");
        }
    }
}

#[test]
fn every_picture_is_the_same_on_any_number_of_threads() {
    let scene = scene(&ball(DVec3::new(0.0, 30.0, 0.0), 12.0, 20_000), &ALL);
    for (splat, _) in Splat::ALL {
        let settings = RenderSettings { splat, shading: shading(), ..perspective([80, 60]) };
        let [one, many] = [1, 5].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            pool.expect("threads").install(|| render(&scene, &settings))
        });
        assert!(one == many, "{splat:?}");
    }
}

#[test]
fn pictures_of_a_pixel_and_of_a_row_are_drawn() {
    let surfels = ball(DVec3::new(0.0, 30.0, 0.0), 12.0, 500);
    for (splat, _) in Splat::ALL {
        for (size, least) in [
            ([1, 1], 1.0),
            ([8192, 1], 1e-4),
            ([1, 8192], if splat == Splat::Point { 0.0 } else { 0.01 }),
        ] {
            let settings = RenderSettings {
                splat,
                splat_size: SplatSize::Own,
                shading: shading(),
                ..perspective(size)
            };
            let picture = draw(&surfels, &ALL, &settings);
            assert!(picture.coverage() >= least, "{splat:?} {size:?}: {}", picture.coverage());
        }
    }
}

#[test]
fn without_points_there_is_the_background_and_with_one_there_is_the_point() {
    let one = scene(&[Surfel::at(0.0, 0.0, 10.0)], &ALL);
    for (splat, _) in Splat::ALL {
        for color in [ColorMode::Rgb, ColorMode::Density] {
            let settings = with(splat, 3.0, orthographic([9, 7]));
            let settings = RenderSettings { shading: shading(), color, ..settings };
            for clouds in [&one.clouds[..], &[]] {
                let none = Scene { clouds, nodes: &[] };
                let frame = CpuRenderer.render(&none, &settings).expect("drawn");
                assert_eq!(frame.picture.coverage(), 0.0);
                assert!(frame.picture.rgba8.chunks(4).all(|p| p[..3] == BACKGROUND));
            }
            let found = drawn(&render(&one, &settings).picture);
            assert!(found.contains(&(4, 3, 10.0)), "{splat:?} {color:?}: {found:?}");
        }
    }
}

#[test]
fn extreme_fields_of_view_are_drawn() {
    for (degrees, away, radius) in [(0.1_f64, 1500.0, 1.0), (170.0, 3.0, 25.0)] {
        let surfels = ball(DVec3::new(0.0, away, 0.0), radius, 3000);
        for (splat, _) in Splat::ALL {
            let mut settings = RenderSettings { splat, ..perspective([64, 48]) };
            settings.camera.projection = Projection::Perspective { fov_y: degrees.to_radians() };
            settings.splat_size = SplatSize::Own;
            let picture = draw(&surfels, &ALL, &settings);
            assert!(picture.coverage() > 0.1, "{splat:?} {degrees}: {}", picture.coverage());
            let in_reach = |d: f64| d > 0.0 && (d - away).abs() < 1.05 * radius;
            assert!(drawn(&picture).iter().all(|d| in_reach(d.2)), "{splat:?} {degrees}");
        }
    }
}

/// At 0.0002, 0.002 … 2000 units, each in a direction of its own: a red splat, and a green one 0.1 %
/// behind it, which is drawn after it.
pub(in crate::render) fn ladder() -> Vec<Surfel> {
    let mut surfels = Vec::new();
    for exponent in 0..8 {
        let distance = 0.0002 * 10_f64.powi(exponent);
        let slope = -0.7 + 0.2 * f64::from(exponent);
        for (times, rgb) in [(1.001, [0, 255, 0]), (1.0, [255, 0, 0])] {
            // To the lattice, which is coarse for the nearest.
            let away = distance * times + if distance < 0.01 && times > 1.0 { SCALE } else { 0.0 };
            let axes = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
            let normal = [0.0, -1.0, 0.0];
            surfels.push(Surfel { rgb, normal, axes, ..Surfel::at(slope * away, 0.0, away) });
        }
    }
    surfels
}

/// The column of a picture of 161 pixels at which a pair of the ladder is seen.
pub(in crate::render) fn column_of(exponent: i32) -> u32 {
    (80.5 + 80.5 * (-0.7 + 0.2 * f64::from(exponent))) as u32
}

#[test]
fn the_nearer_splat_is_seen_at_every_distance_of_a_scene_with_depth_ratio_ten_million() {
    let surfels = ladder();
    for (splat, _) in Splat::ALL.into_iter().filter(|(splat, _)| !splat.is_blended()) {
        let settings = with(splat, 3.0, perspective([161, 161]));
        let picture = draw(&surfels, &ALL, &settings);
        for exponent in 0..8 {
            let column = column_of(exponent);
            assert_eq!(color_at(&picture, column, 80), [255, 0, 0], "{splat:?} {exponent}");
        }
    }
}

#[test]
fn a_near_plane_inside_the_cloud_hides_what_is_behind_it() {
    let surfels = ball(DVec3::ZERO, 8.0, 4000);
    for (splat, _) in Splat::ALL {
        let settings =
            RenderSettings { splat, splat_size: SplatSize::Own, ..perspective([64, 48]) };
        let picture = draw(&surfels, &ALL, &settings);
        assert!(picture.coverage() > 0.2, "{splat:?}: {}", picture.coverage());
        assert!(drawn(&picture).iter().all(|d| d.2 > 0.0 && d.2 < 9.0), "{splat:?}");
    }
}

/// Numbers of every magnitude, both signs, and 0.
fn number() -> impl Strategy<Value = f64> {
    let magnitude = (-30.0..30.0, any::<bool>());
    let wild =
        magnitude.prop_map(|(e, minus): (f64, bool)| if minus { -e.exp2() } else { e.exp2() });
    prop_oneof![3 => wild, 1 => -40.0..40.0, 1 => Just(0.0)]
}

fn vector() -> impl Strategy<Value = DVec3> {
    (number(), number(), number()).prop_map(DVec3::from)
}

/// What files may hold.
fn any_f32() -> impl Strategy<Value = f32> {
    prop_oneof![4 => -1.0f32..1.0, 1 => any::<f32>(), 1 => Just(0.0), 1 => Just(f32::NAN)]
}

fn any_surfel() -> impl Strategy<Value = Surfel> {
    let place = [-40.0..40.0, -40.0..40.0, -40.0..40.0_f64].prop_map(DVec3::from);
    let numbers = proptest::array::uniform10(any_f32());
    (place, any::<[u8; 3]>(), numbers).prop_map(|(place, rgb, n)| Surfel {
        place,
        rgb,
        normal: [n[0], n[1], n[2]],
        axes: [[n[3], n[4], n[5]], [n[6], n[7], n[8]]],
        radius: n[9],
    })
}

fn any_settings() -> impl Strategy<Value = RenderSettings> {
    let projection = prop_oneof![
        (-300.0..0.49_f64).prop_map(|e| Projection::Perspective { fov_y: e.exp2() * 2.2 }),
        (1e-9..1e-3_f64)
            .prop_map(|less| Projection::Perspective { fov_y: std::f64::consts::PI - less }),
        (-200.0..200.0_f64).prop_map(|e| Projection::Orthographic { height: e.exp2() }),
    ];
    // Anywhere and to anywhere; and more often to the points, from among them or not.
    let inside = [-40.0..40.0, -40.0..40.0, -40.0..40.0_f64].prop_map(DVec3::from);
    let anywhere = (vector(), vector()).prop_map(|(eye, to)| (eye, eye + to));
    let from_inside = (inside.clone(), inside.clone());
    let sight = prop_oneof![anywhere, (vector(), inside), from_inside];
    let camera = (sight, vector(), projection).prop_map(|((eye, target), up, projection)| Camera {
        eye,
        target,
        up,
        projection,
    });
    let size = prop_oneof![
        (-3.0..11.0_f32).prop_map(|e| SplatSize::Pixels(e.exp2())),
        (-100.0..100.0_f64).prop_map(|e| SplatSize::World(e.exp2())),
        Just(SplatSize::Own),
        (-20.0..20.0_f64).prop_map(|e| SplatSize::Adaptive(e.exp2())),
    ];
    let limits = prop_oneof![Just((1.0, 1024.0)), Just((1.0, 9.0)), Just((50.0, 50.0))];
    let limits = limits.prop_map(|(min_px, max_px)| SizeLimits { min_px, max_px });
    let shading = (any::<bool>(), any::<bool>()).prop_map(|(phong, edl)| Shading {
        phong,
        eye_dome: edl.then_some(EyeDome { strength: 1.0, radius_px: 2.0 }),
    });
    let splat = (0..Splat::ALL.len()).prop_map(|i| Splat::ALL[i].0);
    (camera, splat, size, limits, shading).prop_filter_map(
        "a camera",
        |(camera, splat, splat_size, size_limits, shading)| {
            camera.check().is_ok().then(|| RenderSettings {
                splat,
                splat_size,
                size_limits,
                shading,
                camera,
                ..orthographic([17, 13])
            })
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

    #[test]
    fn whatever_the_view_depths_are_numbers_and_no_splat_falls_between_pixels(
        surfels in prop::collection::vec(any_surfel(), 1..12),
        settings in any_settings(),
        with_attributes in any::<bool>(),
    ) {
        let attributes = if with_attributes { &ALL[..] } else { &[] };
        let scene = scene(&surfels, attributes);
        let picture = render(&scene, &settings).picture;
        prop_assert!(picture.depth.iter().all(|d| *d >= 0.0), "{:?}", picture.depth);
        let points = RenderSettings { splat: Splat::Point, ..settings };
        let points = render(&scene, &points).picture;
        for (splat, point) in picture.depth.iter().zip(&points.depth) {
            prop_assert!(splat.is_finite() || !point.is_finite());
        }
    }
}
