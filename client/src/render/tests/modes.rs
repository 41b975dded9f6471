//! Every way to draw: the CPU's picture, the rasteriser's and the compute path's.

use super::*;
use crate::render::{EyeDome, GpuPath, Shading, VisibleTree};

/// One renderer for each path.
fn both_paths() -> Option<[GpuRenderer; 2]> {
    has_gpu().then(|| {
        [GpuPath::Raster, GpuPath::Compute].map(|path| {
            let config = GpuConfig { resident_bytes: 64 << 20, path, ..GpuConfig::default() };
            GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}"))
        })
    })
}

/// Share of pixels whose colours differ by at most `tolerance` in each component.
fn close_share(a: &Picture, b: &Picture, tolerance: u8) -> f64 {
    let pixels = a.rgba8.chunks_exact(4).zip(b.rgba8.chunks_exact(4));
    let close = pixels.filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| a.abs_diff(*b) <= tolerance));
    close.count() as f64 / a.depth.len() as f64
}

/// How alike pictures of a mode are: normals have 12 bits an axis on the GPU, meshes are cut at their
/// edges by fixed-function rules, sums are rounded.
struct Likeness {
    tolerance: u8,
    least_close: f64,
}

fn likeness(settings: &RenderSettings) -> Likeness {
    let rounded = settings.splat.is_blended()
        || settings.shading != Shading::default()
        || settings.color == ColorMode::Normal;
    let least_close = match settings.splat.footprint() {
        footprint if footprint.is_mesh() => 0.985,
        footprint if footprint.is_oriented() => 0.995,
        _ => 0.998,
    };
    Likeness { tolerance: if rounded { 3 } else { 0 }, least_close }
}

/// Draws on the CPU and by both paths, and compares.
fn check(
    name: &str,
    scene: &Scene,
    settings: &RenderSettings,
    paths: &mut [GpuRenderer; 2],
) -> Picture {
    let cpu = CpuRenderer.render(scene, settings).expect("drawn").picture;
    let [raster, compute] = paths
        .each_mut()
        .map(|gpu| gpu.render(scene, settings).unwrap_or_else(|e| panic!("{name}: {e}")));
    cpu.write_png(&folder().join(format!("{name}.cpu.png"))).expect("written");
    raster.picture.write_png(&folder().join(format!("{name}.raster.png"))).expect("written");
    compute.picture.write_png(&folder().join(format!("{name}.compute.png"))).expect("written");
    let Likeness { tolerance, least_close } = likeness(settings);
    let similarity = ssim(&cpu, &raster.picture).expect("same size");
    let close = close_share(&cpu, &raster.picture, tolerance);
    let same = equal_share(&raster.picture, &compute.picture);
    println!("{name}: SSIM {similarity:.5}, {close:.5} close; {same:.6} equal by compute");
    assert!(similarity >= 0.985 && close >= least_close, "{name}: {similarity}, {close}");
    assert!(same >= 0.9995, "{name}: the paths differ: {same}");
    let depths = raster.picture.depth.iter().zip(&cpu.depth);
    let alike = |(a, b): &(&f32, &f32)| a == b || (**a - **b).abs() <= 1e-3 * a.abs();
    let depths = depths.filter(alike).count() as f64 / cpu.depth.len() as f64;
    assert!(depths >= least_close, "{name}: only {depths} of the depths are alike");
    cpu
}

/// No two pictures are almost the same: a mode that draws what another one draws is none.
fn assert_all_differ(pictures: &[(String, Picture)]) {
    for (i, (name, picture)) in pictures.iter().enumerate() {
        let twin = pictures[..i].iter().find(|(_, other)| {
            let same_depths = other.depth.iter().zip(&picture.depth).filter(|(a, b)| a == b);
            let depths = same_depths.count() as f64 / picture.depth.len() as f64;
            equal_share(other, picture) > 0.97 && depths > 0.97
        });
        assert!(twin.is_none(), "{name} is {:?} again", twin.map(|(name, _)| name));
    }
}

#[test]
fn every_splat_of_every_size_is_drawn_alike() {
    let Some(mut paths) = both_paths() else { return };
    let world = small_world().with_surface();
    let sizes = [
        SplatSize::Pixels(9.0),
        SplatSize::World(0.3),
        SplatSize::Level(4.0),
        SplatSize::Adaptive(8.0),
        SplatSize::Own,
    ];
    for size in sizes {
        let mut pictures = Vec::new();
        for (splat, name) in Splat::ALL {
            let settings =
                RenderSettings { splat, splat_size: size, ..settings(looking_at_landscape()) };
            let name = format!("{name}-{}", size.to_string().replace(':', ""));
            pictures.push((name.clone(), check(&name, &world.scene(), &settings, &mut paths)));
        }
        assert_all_differ(&pictures);
    }
}

#[test]
fn every_colour_and_shading_is_drawn_alike() {
    let Some(mut paths) = both_paths() else { return };
    let world = small_world().with_surface();
    let eye_dome = Some(EyeDome::default());
    let mut pictures = Vec::new();
    for color in ColorMode::ALL {
        for (shading, name) in [
            (Shading::default(), "unshaded"),
            (Shading { phong: true, eye_dome: None }, "phong"),
            (Shading { phong: false, eye_dome }, "edl"),
            (Shading { phong: true, eye_dome }, "phong-edl"),
        ] {
            // Counts are shown as they are.
            if color == ColorMode::Density && shading != Shading::default() {
                continue;
            }
            let settings = RenderSettings {
                color,
                shading,
                splat_size: SplatSize::Pixels(6.0),
                ..settings(looking_at_landscape())
            };
            let name = format!("{}-{name}", color.name());
            pictures.push((name.clone(), check(&name, &world.scene(), &settings, &mut paths)));
        }
    }
    assert_all_differ(&pictures);
}

#[test]
fn clouds_without_normals_axes_and_radii_are_drawn_alike() {
    let Some(mut paths) = both_paths() else { return };
    let bare = small_world();
    let shading = Shading { phong: true, eye_dome: None };
    for splat in [Splat::Disc, Splat::Ellipse, Splat::BlendedDisc] {
        for splat_size in [SplatSize::Own, SplatSize::Pixels(7.0)] {
            let settings =
                RenderSettings { splat, splat_size, shading, ..settings(looking_at_landscape()) };
            let name = format!("bare-{}-{splat_size}", splat.name());
            check(&name, &bare.scene(), &settings, &mut paths);
        }
    }
}

#[test]
fn orthographic_views_of_every_splat_are_alike() {
    let Some(mut paths) = both_paths() else { return };
    let world = small_world().with_surface();
    let projection = Projection::Orthographic { height: 14.0 };
    let camera = Camera { projection, ..looking_at_landscape() };
    for (splat, name) in Splat::ALL {
        let shading = Shading { phong: true, eye_dome: Some(EyeDome::default()) };
        let splat_size = SplatSize::World(0.4);
        let settings = RenderSettings { splat, splat_size, shading, ..settings(camera) };
        check(&format!("orthographic-{name}"), &world.scene(), &settings, &mut paths);
    }
}

#[test]
fn counts_are_those_of_the_cpu() {
    let Some(mut paths) = both_paths() else { return };
    let world = small_world();
    let color = ColorMode::Density;
    let settings = RenderSettings { color, ..settings(looking_at_landscape()) };
    let expected = CpuRenderer.render(&world.scene(), &settings).expect("drawn");
    let expected = expected.points_per_pixel.expect("counted");
    for gpu in &mut paths {
        let found = gpu.render(&world.scene(), &settings).expect("drawn");
        let found = found.points_per_pixel.expect("counted");
        assert_eq!(found.largest, expected.largest);
        assert!(found.covered_pixels.abs_diff(expected.covered_pixels) < 10);
    }
}

#[test]
fn adaptive_sizes_are_those_of_the_finest_node_drawn_there() {
    // Without its finest level on one side, the cloud is drawn in larger splats there only.
    let world = small_world();
    let settings = RenderSettings {
        splat: Splat::Square,
        splat_size: SplatSize::Adaptive(1.0),
        ..settings(looking_at_landscape())
    };
    let half = |node: &DrawNode| node.key.level() < 2 || node.key.coords()[0] < 2;
    let nodes: Vec<DrawNode> = world.nodes.iter().filter(|n| half(n)).cloned().collect();
    let uneven = TestScene { nodes, ..world.clone() };
    let tree = VisibleTree::of(uneven.nodes.iter().map(|n| (n.cloud, n.key, n.spacing)));
    let root = tree.place(0, lodestream_protocol::NodeKey::ROOT).expect("drawn");
    let (fine, coarse) = (tree.spacing(root, 16, [0; 3]), tree.spacing(root, 16, [65_535, 0, 0]));
    assert_eq!(coarse, 2.0 * fine);
    let [all, uneven] = [&world, &uneven].map(|scene| {
        let pictures = draw(&scene.scene(), &settings);
        if let [cpu, gpu] = pictures.as_slice() {
            assert!(equal_share(cpu, gpu) > 0.998);
        }
        pictures.into_iter().next().expect("the CPU's")
    });
    // The left of the picture is the side of small x.
    let changed = |columns: std::ops::Range<u32>| {
        let pixels = (0..200).flat_map(|row| columns.clone().map(move |column| (column, row)));
        pixels.filter(|&(x, y)| color_at(&all, x, y) != color_at(&uneven, x, y)).count()
    };
    assert!(
        changed(200..320) > 20 * changed(0..80).max(1),
        "{} {}",
        changed(200..320),
        changed(0..80)
    );
}
