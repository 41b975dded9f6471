//! Every splat on the GPU, by either path, where numbers are hard.

use super::*;
use crate::render::{
    GpuPath,
    cpu::tests::{
        Surfel,
        extremes::{ALL, ball, column_of, ladder, shading},
        orthographic, perspective, scene, scene_at, with,
    },
};

/// The GPU's two ways. Empty where there is no GPU.
fn both_paths() -> Vec<(GpuPath, GpuRenderer)> {
    if !has_gpu() {
        return Vec::new();
    }
    let open = |path| {
        let config = GpuConfig { path, ..GpuConfig::default() };
        (path, GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}")))
    };
    [GpuPath::Raster, GpuPath::Compute].map(open).into()
}

fn picture(gpu: &mut GpuRenderer, scene: &TestScene, settings: &RenderSettings) -> Picture {
    gpu.render(&scene.scene(), settings).expect("drawn").picture
}

/// Fails where the GPU's picture is not the CPU's: distances may differ by a part, `close`.
fn assert_as_cpu_within(
    close: f32,
    gpu: &mut GpuRenderer,
    scene: &TestScene,
    settings: &RenderSettings,
    what: &str,
) {
    let found = picture(gpu, scene, settings);
    let expected = CpuRenderer.render(&scene.scene(), settings).expect("drawn").picture;
    let covers = |(a, b): (&f32, &f32)| a.is_finite() == b.is_finite();
    let pairs = || expected.depth.iter().zip(&found.depth);
    let covered = pairs().filter(|&pair| covers(pair)).count() as f64;
    let covered = covered / found.depth.len() as f64;
    assert!(covered >= 0.99, "{what}: only {covered} of the pixels covered alike");
    let close = |(a, b): (&f32, &f32)| a == b || (a - b).abs() <= close * a.abs();
    let depths = pairs().filter(|&pair| close(pair)).count() as f64 / found.depth.len() as f64;
    let worst = pairs().find(|&pair| !close(pair));
    assert!(depths >= 0.98, "{what}: only {depths} of the depths alike, {worst:?} are not");
    assert!(found.depth.iter().all(|depth| *depth >= 0.0), "{what}");
}

/// Within what rounding to f32, and normals to 24 bits, move.
fn assert_as_cpu(gpu: &mut GpuRenderer, scene: &TestScene, settings: &RenderSettings, what: &str) {
    assert_as_cpu_within(1e-3, gpu, scene, settings, what);
}

#[test]
fn every_splat_far_from_the_origin_is_the_picture_at_the_origin() {
    let surfels = ball(DVec3::new(0.0, 30.0, 0.0), 12.0, 800);
    // UTM: metres north and east.
    let shift = DVec3::new(500_000.0, 5_000_000.0, 300.0);
    let (here, far) = (scene(&surfels, &ALL), scene_at(shift, &surfels, &ALL));
    for (path, mut gpu) in both_paths() {
        for (splat, name) in Splat::ALL {
            for splat_size in [SplatSize::Pixels(6.0), SplatSize::Own] {
                let settings = perspective([80, 60]);
                let settings = RenderSettings { splat, splat_size, shading: shading(), ..settings };
                let expected = picture(&mut gpu, &here, &settings);
                assert!(expected.coverage() > 0.05, "{name} by {path:?}");
                let mut camera = settings.camera;
                camera.eye += shift;
                camera.target += shift;
                let found = picture(&mut gpu, &far, &RenderSettings { camera, ..settings });
                assert!(found == expected, "{name} of {splat_size} by {path:?}");
            }
        }
    }
}

#[test]
fn every_splat_is_the_cpus_under_extreme_fields_of_view() {
    for (path, mut gpu) in both_paths() {
        for (degrees, away, radius) in [(0.1_f64, 1500.0, 1.0), (170.0, 3.0, 25.0)] {
            let scene = scene(&ball(DVec3::new(0.0, away, 0.0), radius, 3000), &ALL);
            for (splat, name) in Splat::ALL {
                let settings = perspective([64, 48]);
                let mut settings = RenderSettings { splat, splat_size: SplatSize::Own, ..settings };
                settings.camera.projection =
                    Projection::Perspective { fov_y: degrees.to_radians() };
                let what = format!("{name}, {degrees} degrees, by {path:?}");
                assert_as_cpu(&mut gpu, &scene, &settings, &what);
            }
        }
    }
}

#[test]
fn every_splat_is_the_cpus_where_the_near_plane_is_inside_the_cloud() {
    let scene = scene(&ball(DVec3::ZERO, 8.0, 4000), &ALL);
    for (path, mut gpu) in both_paths() {
        for (splat, name) in Splat::ALL {
            let settings =
                RenderSettings { splat, splat_size: SplatSize::Own, ..perspective([64, 48]) };
            assert_as_cpu(&mut gpu, &scene, &settings, &format!("{name} by {path:?}"));
        }
    }
}

#[test]
fn the_nearer_splat_is_seen_at_every_distance_of_a_scene_with_depth_ratio_ten_million() {
    let scene = scene(&ladder(), &ALL);
    for (path, mut gpu) in both_paths() {
        for (splat, name) in Splat::ALL.into_iter().filter(|(splat, _)| !splat.is_blended()) {
            let picture = picture(&mut gpu, &scene, &with(splat, 3.0, perspective([161, 161])));
            for exponent in 0..8 {
                let color = color_at(&picture, column_of(exponent), 80);
                assert_eq!(color, [255, 0, 0], "{name} {exponent} by {path:?}");
            }
        }
    }
}

#[test]
fn pictures_of_a_pixel_and_of_a_row_are_the_cpus() {
    let scene = scene(&ball(DVec3::new(0.0, 30.0, 0.0), 12.0, 500), &ALL);
    for (path, mut gpu) in both_paths() {
        for (splat, name) in Splat::ALL {
            for size in [[1, 1], [8192, 1], [1, 8192]] {
                let settings = RenderSettings {
                    splat,
                    splat_size: SplatSize::Own,
                    shading: shading(),
                    ..perspective(size)
                };
                let what = format!("{name} {size:?} by {path:?}");
                // Discs of a pixel are larger than the ball, and seen edge-on: a normal's last bit is
                // a hundredth of the distance.
                assert_as_cpu_within(0.02, &mut gpu, &scene, &settings, &what);
            }
        }
    }
}

#[test]
fn without_points_there_is_the_background_and_with_one_there_is_the_point() {
    let (none, one) = (scene(&[], &ALL), scene(&[Surfel::at(0.0, 0.0, 10.0)], &ALL));
    for (path, mut gpu) in both_paths() {
        for (splat, name) in Splat::ALL {
            let settings = with(splat, 3.0, orthographic([9, 7]));
            let settings = RenderSettings { shading: shading(), ..settings };
            let empty = picture(&mut gpu, &none, &settings);
            assert_eq!(empty.coverage(), 0.0, "{name} by {path:?}");
            assert!(empty.rgba8.chunks(4).all(|p| p[..3] == BACKGROUND), "{name} by {path:?}");
            let found = picture(&mut gpu, &one, &settings);
            assert!(drawn(&found).contains(&(4, 3)), "{name} by {path:?}");
            assert!((found.depth[3 * 9 + 4] - 10.0).abs() < 1e-4, "{name} by {path:?}");
        }
    }
}
