//! What must be seen, by both renderers.

use super::*;

const SPLATS: [Splat; 3] = [Splat::Point, Splat::Square, Splat::Circle];
const SIZES: [SplatSize; 2] = [SplatSize::Pixels(5.0), SplatSize::World(0.35)];
const COLORS: [ColorMode; 4] =
    [ColorMode::Rgb, ColorMode::Elevation, ColorMode::Intensity, ColorMode::Level];

#[test]
fn gpu_and_cpu_draw_the_same_for_every_splat_size_and_colour() {
    let Some(mut gpu) = gpu() else { return };
    let world = small_world();
    let mut pictures: Vec<(String, Picture)> = Vec::new();
    for (splat, size, color) in SPLATS
        .into_iter()
        .flat_map(|splat| SIZES.into_iter().map(move |size| (splat, size)))
        .flat_map(|(splat, size)| COLORS.into_iter().map(move |color| (splat, size, color)))
    {
        let settings =
            RenderSettings { splat, splat_size: size, color, ..settings(looking_at_landscape()) };
        let a = CpuRenderer.render(&world.scene(), &settings).expect("drawn").picture;
        let b = gpu.render(&world.scene(), &settings).expect("drawn").picture;
        let size = if matches!(size, SplatSize::Pixels(_)) { "pixels" } else { "world" };
        let name = format!("{splat:?}-{size}-{color:?}").to_lowercase();
        assert_alike(&name, &a, &b, 0.999);
        // A mode that draws what another one draws would pass unseen above.
        if splat != Splat::Point || size == "pixels" {
            let twin = pictures.iter().find(|(_, other)| equal_share(other, &b) > 0.9);
            assert!(twin.is_none(), "{name} is {:?} again", twin.map(|(name, _)| name));
            pictures.push((name, b));
        }
    }
}

#[test]
fn each_splat_covers_the_pixels_it_should() {
    let (scene, settings) = one_point();
    // 10 away with a field of view of 90 degrees: 21 pixels are 20 units there.
    let cases = [
        (Splat::Point, SplatSize::Pixels(7.0), 1),
        (Splat::Square, SplatSize::Pixels(3.0), 9),
        (Splat::Square, SplatSize::World(4.8), 25),
        (Splat::Circle, SplatSize::Pixels(5.0), 21),
        (Splat::Circle, SplatSize::World(2.9), 9),
        (Splat::Circle, SplatSize::World(0.1), 1),
        (Splat::Square, SplatSize::Pixels(0.2), 1),
    ];
    for (splat, splat_size, count) in cases {
        let settings = RenderSettings { splat, splat_size, ..settings };
        for picture in draw(&scene.scene(), &settings) {
            let drawn = drawn(&picture);
            assert_eq!(drawn.len(), count, "{splat:?} {splat_size:?}");
            assert!(drawn.contains(&(15, 10)), "the middle pixel");
            let middle = drawn.iter().fold((0, 0), |sum, p| (sum.0 + p.0, sum.1 + p.1));
            assert_eq!(middle, (15 * count as u32, 10 * count as u32), "around the middle");
            assert!(drawn.iter().all(|&(x, y)| color_at(&picture, x, y) == [10, 20, 30]));
            assert_eq!(color_at(&picture, 0, 0), BACKGROUND);
            let depth = picture.depth[10 * 31 + 15];
            assert!((depth - 10.0).abs() < 1e-5, "{depth}");
        }
    }
}

#[test]
fn each_colour_mode_shows_its_colour() {
    // Two points, so that heights and intensities have a range.
    let points = [
        Point { q: [2, 2, 4], rgb: [10, 20, 30], intensity: 750 },
        Point { q: [2, 2, 0], rgb: [200, 100, 50], intensity: 0 },
    ];
    let scene = cloud(lattice(1.0, 4), 2, &points);
    let settings = one_point().1;
    let cases = [
        (ColorMode::Rgb, [10, 20, 30], [200, 100, 50]),
        (ColorMode::Elevation, Ramp::Elevation.color(255), Ramp::Elevation.color(0)),
        (ColorMode::Intensity, Ramp::Intensity.color(191), Ramp::Intensity.color(0)),
        (ColorMode::Level, Ramp::Level.color(0), Ramp::Level.color(255)),
    ];
    for (color, upper, lower) in cases {
        for picture in draw(&scene.scene(), &RenderSettings { color, ..settings }) {
            // 2 units above and below the middle, at 1.05 pixels a unit.
            assert_eq!(color_at(&picture, 15, 8), upper, "{color:?}");
            assert_eq!(color_at(&picture, 15, 12), lower, "{color:?}");
        }
    }
}

#[test]
fn a_cloud_far_from_the_origin_gives_the_picture_of_the_same_cloud_at_the_origin() {
    let points = landscape(16, 200_000);
    let at_origin = cloud(lattice(0.001, 16), 3, &points);
    // Close to the ball's surface: a millimetre is several pixels.
    let near = Camera {
        // Exact in f64 with the shift added, not in f32.
        eye: DVec3::new(20.117_187_5, 14.296_875, 27.101_562_5),
        target: DVec3::new(19.664_062_5, 21.0, 26.203_125),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 0.7 },
    };
    let shift = DVec3::new(500_000.0, 5_000_000.0, 300.0);
    let far = Camera { eye: near.eye + shift, target: near.target + shift, ..near };
    // The shift written into the offset, into the origin, and into both.
    let by_offset = Lattice { offset: shift.to_array(), ..at_origin.clouds[0].lattice };
    let by_origin =
        Lattice { origin: [500_000_000, 5_000_000_000, 300_000], ..at_origin.clouds[0].lattice };
    let by_both = Lattice {
        offset: [500_123.0, 4_999_000.0, 0.0],
        origin: [-123_000, 1_000_000, 300_000],
        ..at_origin.clouds[0].lattice
    };
    for splat_size in [SplatSize::Pixels(1.0), SplatSize::World(0.02)] {
        let settings = RenderSettings { splat_size, ..settings(near) };
        let expected = draw(&at_origin.scene(), &settings);
        assert!(expected[0].coverage() > 0.05, "{}", expected[0].coverage());
        for lattice in [by_offset, by_origin, by_both] {
            let scene = cloud(lattice, 3, &points);
            let far = draw(&scene.scene(), &RenderSettings { camera: far, ..settings });
            for (expected, found) in expected.iter().zip(&far) {
                assert_eq!(equal_share(expected, found), 1.0, "{lattice:?} {splat_size:?}");
            }
        }
    }
}

#[test]
fn the_nearer_point_is_seen_at_every_distance_of_a_scene_with_depth_ratio_ten_million() {
    // At 200, 2000 … 2e9 lattice units, each in a direction of its own: a green point, drawn first,
    // 0.1 % (at least one unit) behind a red one.
    let middle = 1 << 30;
    let slope = |exponent: u32| -0.175 + 0.05 * f64::from(exponent);
    // The far corner of the world, beside the view: what is near lies in a very large node.
    let mut points = vec![Point { q: [0, 1, 0], rgb: [0, 0, 255], intensity: 0 }];
    for exponent in 0..8 {
        let near = 200 * 10_u32.pow(exponent);
        for (distance, rgb) in [(near + near.div_ceil(1000), [0, 255, 0]), (near, [255, 0, 0])] {
            let across = (slope(exponent) * f64::from(distance)).round() as i64;
            let x = u32::try_from(i64::from(middle) + across).expect("inside the cube");
            points.push(Point { q: [x, distance, middle], rgb, intensity: 0 });
        }
    }
    let scale = 1e-3;
    let scene = cloud(lattice(scale, 31), 1, &points);
    let eye = DVec3::new(f64::from(middle), 0.0, f64::from(middle)) * scale;
    let camera = Camera {
        eye,
        target: eye + DVec3::Y,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 },
    };
    let settings = RenderSettings { size_px: [161, 161], splat: Splat::Square, ..settings(camera) };
    for picture in draw(&scene.scene(), &settings) {
        for exponent in 0..8 {
            let column = (80.5 + 80.5 * slope(exponent)) as u32;
            let depth = f64::from(picture.depth[(80 * 161 + column) as usize]);
            let expected = scale * 200.0 * 10_f64.powi(exponent as i32);
            assert_eq!(color_at(&picture, column, 80), [255, 0, 0], "at {expected}");
            assert!((depth / expected - 1.0).abs() < 1e-5, "{depth} for {expected}");
        }
    }
}

#[test]
fn the_nearer_point_is_seen_at_every_distance_of_an_orthographic_view() {
    for near in (0..7).map(|exponent| 100 * 10_u32.pow(exponent)) {
        let point = |y, rgb| Point { q: [1 << 30, y, 1 << 30], rgb, intensity: 0 };
        let points = [
            point(near + near.div_ceil(1000), [0, 255, 0]),
            point(near, [255, 0, 0]),
            // The end of the world, beside the view.
            Point { q: [0, u32::MAX >> 1, 0], rgb: [0, 0, 255], intensity: 0 },
        ];
        let scene = cloud(lattice(1.0, 31), 1, &points);
        let eye = DVec3::new(30_f64.exp2(), 0.0, 30_f64.exp2());
        let projection = Projection::Orthographic { height: 10.0 };
        let camera = Camera { eye, target: eye + DVec3::Y, up: DVec3::Z, projection };
        let settings = RenderSettings { size_px: [5, 5], ..settings(camera) };
        for picture in draw(&scene.scene(), &settings) {
            assert_eq!(color_at(&picture, 2, 2), [255, 0, 0], "at {near}");
            let depth = f64::from(picture.depth[12]);
            assert!((depth - f64::from(near)).abs() < 4.0, "{depth} for {near}");
        }
    }
}

#[test]
fn of_equally_near_points_the_first_is_seen_whatever_the_order_of_the_nodes() {
    // All points at one place, in three nodes of different levels and a second cloud.
    let points: Vec<Point> =
        (0..30).map(|i| Point { q: [2, 2, 2], rgb: [i, 2 * i, 3 * i], intensity: 0 }).collect();
    let mut scene = cloud(lattice(1.0, 4), 3, &points);
    scene = scene.and(cloud(lattice(1.0, 4), 3, &[Point { rgb: [99; 3], ..points[0] }]));
    let settings = one_point().1;
    for reversed in [false, true] {
        if reversed {
            scene.nodes.reverse();
        }
        for picture in draw(&scene.scene(), &settings) {
            assert_eq!(color_at(&picture, 15, 10), [0, 0, 0], "the root's first point");
        }
    }
}

#[test]
fn a_camera_inside_the_cloud_sees_what_is_in_front_of_it() {
    let Some(mut gpu) = gpu() else { return };
    let world = small_world();
    let camera = Camera {
        eye: DVec3::new(8.0, 8.0, 2.2),
        target: DVec3::new(4.8, 6.4, 3.0),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 1.3 },
    };
    for splat_size in [SplatSize::Pixels(2.0), SplatSize::World(0.1)] {
        let settings = RenderSettings { splat_size, ..settings(camera) };
        let a = CpuRenderer.render(&world.scene(), &settings).expect("drawn").picture;
        let b = gpu.render(&world.scene(), &settings).expect("drawn").picture;
        let size = if matches!(splat_size, SplatSize::Pixels(_)) { "pixels" } else { "world" };
        assert_alike(&format!("inside-{size}"), &a, &b, 0.999);
        assert!(a.depth.iter().all(|d| *d >= 0.0));
    }
}

#[test]
fn extreme_fields_of_view_are_drawn() {
    let Some(mut gpu) = gpu() else { return };
    let world = small_world();
    let from = DVec3::new(7.0, -900.0, 300.0);
    let narrow = Camera { eye: from, ..looking_at_landscape() };
    let inside = Camera { eye: DVec3::new(8.0, 2.0, 6.0), ..looking_at_landscape() };
    for (name, camera, degrees) in [("narrow", narrow, 0.1_f64), ("wide", inside, 170.0)] {
        let projection = Projection::Perspective { fov_y: degrees.to_radians() };
        let settings = settings(Camera { projection, ..camera });
        let a = CpuRenderer.render(&world.scene(), &settings).expect("drawn").picture;
        let b = gpu.render(&world.scene(), &settings).expect("drawn").picture;
        assert!(a.coverage() > 0.01, "{name}: {} covered", a.coverage());
        assert_alike(&format!("fov-{name}"), &a, &b, 0.99);
    }
}

#[test]
fn orthographic_views_are_alike() {
    let Some(mut gpu) = gpu() else { return };
    let world = small_world();
    let down = Camera {
        eye: DVec3::new(8.0, 8.0, 20.0),
        target: DVec3::new(8.0, 8.0, 0.0),
        up: DVec3::Y,
        projection: Projection::Orthographic { height: 17.0 },
    };
    for splat_size in [SplatSize::Pixels(2.0), SplatSize::World(0.1)] {
        let settings = RenderSettings { splat_size, ..settings(down) };
        let a = CpuRenderer.render(&world.scene(), &settings).expect("drawn").picture;
        let b = gpu.render(&world.scene(), &settings).expect("drawn").picture;
        let size = if matches!(splat_size, SplatSize::Pixels(_)) { "pixels" } else { "world" };
        assert_alike(&format!("orthographic-{size}"), &a, &b, 0.999);
    }
}

#[test]
fn a_picture_of_one_pixel_and_an_empty_scene_are_drawn() {
    let (scene, settings) = one_point();
    let tiny = RenderSettings { size_px: [1, 1], ..settings };
    for picture in draw(&scene.scene(), &tiny) {
        assert_eq!(picture.rgba8, [10, 20, 30, 255]);
    }
    let clouds = [Arc::new(testing::manifest())];
    for clouds in [&clouds[..], &[]] {
        for picture in draw(&Scene { clouds, nodes: &[] }, &settings) {
            assert_eq!(drawn(&picture), []);
            assert_eq!(color_at(&picture, 3, 3), BACKGROUND);
        }
    }
}

#[test]
fn what_lies_behind_the_camera_is_not_drawn() {
    let (scene, settings) = one_point();
    for eye in [DVec3::new(2.0, 3.0, 2.0), DVec3::splat(2.0)] {
        let camera = Camera { eye, target: eye + DVec3::Y, ..settings.camera };
        for picture in draw(&scene.scene(), &RenderSettings { camera, ..settings }) {
            assert_eq!(drawn(&picture), [], "seen from {eye}");
        }
    }
}

#[test]
fn nodes_of_32_bit_lattices_are_drawn() {
    let points: Vec<Point> = landscape(32, 20_000);
    let scene = cloud(lattice(16.0 / 32_f64.exp2(), 32), 3, &points);
    let pictures = draw(&scene.scene(), &settings(looking_at_landscape()));
    let coarse: Vec<Point> = landscape(16, 20_000);
    let coarse = cloud(lattice(1.0 / 4096.0, 16), 3, &coarse);
    let expected = draw(&coarse.scene(), &settings(looking_at_landscape()));
    for (a, b) in pictures.iter().zip(&expected) {
        // The same scene, but for the rounding of its coordinates.
        assert!(equal_share(a, b) > 0.99, "{}", equal_share(a, b));
    }
}

#[test]
fn impossible_settings_and_scenes_are_refused() {
    let (scene, settings) = one_point();
    let refused = |scene: &Scene, settings: &RenderSettings| {
        let cpu = CpuRenderer.render(scene, settings).expect_err("refused").to_string();
        let gpu =
            gpu().map(|mut gpu| gpu.render(scene, settings).expect_err("refused").to_string());
        assert!(gpu.is_none_or(|gpu| gpu == cpu));
        cpu
    };
    let scene = scene.scene();
    let empty = RenderSettings { size_px: [0, 5], ..settings };
    assert!(refused(&scene, &empty).contains("0x5"));
    let flat = RenderSettings { splat_size: SplatSize::World(f64::NAN), ..settings };
    assert!(refused(&scene, &flat).contains("splat size"));
    let nowhere = Camera { target: settings.camera.eye, ..settings.camera };
    assert!(
        refused(&scene, &RenderSettings { camera: nowhere, ..settings }).contains("same place")
    );
    let strayed = [DrawNode { cloud: 3, ..scene.nodes[0].clone() }];
    assert!(refused(&Scene { nodes: &strayed, ..scene }, &settings).contains("cloud 3"));
}

#[test]
fn a_node_is_uploaded_once_and_the_oldest_makes_room() {
    if gpu().is_none() {
        return;
    }
    let mut gpu = open_gpu(0);
    let world = small_world();
    let settings = settings(looking_at_landscape());
    let draw = |gpu: &mut GpuRenderer, nodes: &[DrawNode], color| {
        let scene = Scene { clouds: &world.clouds, nodes };
        gpu.render(&scene, &RenderSettings { color, ..settings }).expect("drawn")
    };
    let first = draw(&mut gpu, &world.nodes, ColorMode::Rgb).statistics;
    assert!(first.uploaded_bytes > 0);
    assert_eq!(first.uploaded_bytes, first.resident_bytes);
    let bytes_per_point = first.resident_bytes as f64 / first.points as f64;
    println!("{bytes_per_point:.2} bytes a point on the GPU, {} draw calls", first.draw_calls);
    assert!(bytes_per_point < 9.5, "{bytes_per_point} (48 bits of position, 24 of colour)");
    assert_eq!(first.draw_calls, 1, "one page, one colour source");
    let second = draw(&mut gpu, &world.nodes, ColorMode::Rgb).statistics;
    assert_eq!(second.uploaded_bytes, 0);
    // Elevation and level share their records, which hold no colour.
    let by_height = draw(&mut gpu, &world.nodes, ColorMode::Elevation).statistics;
    assert!(by_height.uploaded_bytes > 0);
    let by_level = draw(&mut gpu, &world.nodes, ColorMode::Level).statistics;
    assert_eq!(by_level.uploaded_bytes, 0);

    // Fill the one page that the budget allows with other clouds' nodes, until the first is gone.
    let copies = 2 * (32 << 20) / first.resident_bytes;
    for _ in 0..copies {
        let manifest = Manifest::clone(&world.clouds[0]);
        let scene = Scene { clouds: &[Arc::new(manifest)], nodes: &world.nodes };
        let drawn = gpu.render(&scene, &settings).expect("drawn").statistics;
        assert!(drawn.resident_bytes <= 32 << 20, "{drawn:?}");
    }
    let again = draw(&mut gpu, &world.nodes, ColorMode::Rgb);
    assert_eq!(again.statistics.uploaded_bytes, first.resident_bytes, "it had been evicted");
    let expected = CpuRenderer.render(&world.scene(), &settings).expect("drawn").picture;
    assert!(equal_share(&again.picture, &expected) > 0.999);
}

#[test]
fn a_frame_larger_than_the_budget_is_drawn_whole_and_the_pool_shrinks_back() {
    if gpu().is_none() {
        return;
    }
    let mut gpu = open_gpu(0);
    let points = landscape(16, 400_000);
    let world = cloud(lattice(1.0 / 4096.0, 16), 2, &points);
    // Twelve clouds of 3.6 MB, shifted: more than one page of 32 MiB.
    let scenes = (0..12).map(|i| {
        let lattice = Lattice { origin: [i << 16, 0, 0], ..world.clouds[0].lattice };
        let cloud = Manifest { lattice, ..world.clouds[0].as_ref().clone() };
        TestScene { clouds: vec![Arc::new(cloud)], nodes: world.nodes.clone() }
    });
    let all = scenes.reduce(TestScene::and).expect("twelve");
    let overview = Camera::overview(DVec3::ZERO, DVec3::new(192.0, 16.0, 9.0), 1.6);
    let settings = RenderSettings { splat: Splat::Point, ..settings(overview) };
    let frame = gpu.render(&all.scene(), &settings).expect("drawn");
    assert!(frame.statistics.resident_bytes > 32 << 20, "{:?}", frame.statistics);
    let expected = CpuRenderer.render(&all.scene(), &settings).expect("drawn").picture;
    assert_alike("over-budget", &expected, &frame.picture, 0.999);
    let scene = Scene { nodes: &all.nodes[..1], ..all.scene() };
    let small = gpu.render(&scene, &settings).expect("drawn").statistics;
    assert!(small.resident_bytes <= 32 << 20, "{small:?}");
    assert_eq!(small.uploaded_bytes, 0, "the node was there");
}

#[test]
fn a_cloud_without_the_attribute_is_drawn_by_what_it_has() {
    let with = small_world();
    let bare = Manifest { attributes: Vec::new(), ..with.clouds[0].as_ref().clone() };
    let bare = TestScene { clouds: vec![Arc::new(bare)], nodes: with.nodes.clone() };
    let rgb = settings(looking_at_landscape());
    let elevation = RenderSettings { color: ColorMode::Elevation, ..rgb };
    let found = draw(&bare.scene(), &rgb);
    for (found, expected) in found.iter().zip(draw(&with.scene(), &elevation)) {
        assert_eq!(found, &expected);
    }
}

fn truth(scene: &Scene, settings: &RenderSettings, samples: u32) -> Picture {
    let mut truth =
        TruthRenderer::new(settings, scene.clouds, scene.tree(), samples).expect("possible");
    for node in scene.nodes {
        truth.add_node(node.clone()).expect("a node of the scene");
    }
    truth.finish().expect("one pass").picture
}

#[test]
fn the_truth_with_one_sample_is_the_cpu_picture_however_many_batches_it_takes() {
    // 60,000 points many times over: several batches.
    let world = small_world();
    let settings = settings(looking_at_landscape());
    let Frame { picture, .. } = CpuRenderer.render(&world.scene(), &settings).expect("drawn");
    let nodes: Vec<_> = (0..100).flat_map(|_| world.nodes.iter().cloned()).collect();
    assert_eq!(truth(&Scene { nodes: &nodes, ..world.scene() }, &settings, 1), picture);
}

#[test]
fn the_truth_averages_its_samples() {
    let (scene, settings) = one_point();
    // An even number of pixels: the point lies on the corner of four, and covers a quarter of each.
    let settings = RenderSettings {
        size_px: [30, 20],
        splat: Splat::Point,
        background: [110, 120, 130],
        ..settings
    };
    let picture = truth(&scene.scene(), &settings, 4);
    for (x, y) in [(14, 9), (15, 9), (14, 10), (15, 10)] {
        assert_eq!(color_at(&picture, x, y), [85, 95, 105], "3/4 background, 1/4 point");
    }
    let inked = picture.rgba8.chunks_exact(4).filter(|pixel| pixel[..3] != [110, 120, 130]);
    assert_eq!(inked.count(), 4);
    assert_eq!(drawn(&picture), [], "none is covered by half");
}

#[test]
fn the_truth_refuses_sample_counts_that_cannot_be() {
    let (scene, settings) = one_point();
    for samples in [0, 17] {
        assert!(TruthRenderer::new(&settings, &scene.clouds, Default::default(), samples).is_err());
    }
    let large = RenderSettings { size_px: [16_384, 16_384], ..settings };
    assert!(TruthRenderer::new(&large, &scene.clouds, Default::default(), 4).is_err());
}
