//! What the renderer does without: features, limits, room, time, and the device itself.

use lodestream_protocol::NodePoints;

use super::*;
use crate::render::{GpuPath, Renderer, Shading};

#[test]
fn an_adapter_with_nothing_but_the_least_draws_the_same() {
    if !has_gpu() {
        return;
    }
    let world = small_world().with_surface();
    let open = |least_adapter, path| {
        let config = GpuConfig { least_adapter, path, ..GpuConfig::default() };
        GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}"))
    };
    for path in [GpuPath::Raster, GpuPath::Compute] {
        let (mut full, mut least) = (open(false, path), open(true, path));
        for (splat, name) in Splat::ALL {
            let settings = RenderSettings {
                splat,
                splat_size: SplatSize::Pixels(5.0),
                shading: Shading { phong: true, eye_dome: None },
                ..settings(looking_at_landscape())
            };
            let [a, b] = [&mut full, &mut least]
                .map(|gpu| gpu.render(&world.scene(), &settings).expect("drawn").picture);
            let same = equal_share(&a, &b);
            // Sums of half the precision round differently.
            let enough = if splat.is_blended() { ssim(&a, &b).expect("same size") } else { same };
            assert!(enough > 0.999, "{name} by {path:?}: {enough}");
        }
        let settings =
            RenderSettings { color: ColorMode::Density, ..settings(looking_at_landscape()) };
        let [a, b] = [&mut full, &mut least]
            .map(|gpu| gpu.render(&world.scene(), &settings).expect("drawn").picture);
        assert_eq!(a, b);
    }
}

#[test]
fn a_frame_uploads_no_more_than_it_may_until_all_is_there() {
    if !has_gpu() {
        return;
    }
    let world = small_world();
    let settings = settings(looking_at_landscape());
    let whole = open_gpu(64 << 20).render(&world.scene(), &settings).expect("drawn");
    let limit = whole.statistics.uploaded_bytes / 5;
    let config = GpuConfig { upload_bytes_per_frame: limit, ..GpuConfig::default() };
    let mut gpu = GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}"));
    let mut frames = Vec::new();
    loop {
        let frame = gpu.render(&world.scene(), &settings).expect("drawn");
        let largest_node = 30_000 * 16;
        assert!(frame.statistics.uploaded_bytes <= limit.max(largest_node));
        let waiting = frame.statistics.waiting_nodes;
        frames.push(frame);
        if waiting == 0 {
            break;
        }
        assert!(frames.len() < 200, "never complete");
    }
    assert!(frames.len() > 3, "{} frames", frames.len());
    assert!(frames.windows(2).all(|w| w[0].statistics.points <= w[1].statistics.points));
    assert_eq!(frames.last().expect("one").picture, whole.picture);
}

#[test]
fn what_is_placed_more_exactly_replaces_what_was_seen_and_nothing_is_missing_meanwhile() {
    is_replaced(|points| {
        points.cell_bits = 4;
        points.positions.iter_mut().flatten().for_each(|q| *q = *q & !15 | 8);
    });
}

#[test]
fn colours_that_become_exact_replace_coarse_ones_of_points_that_stay_where_they_are() {
    is_replaced(|points| {
        points.has_coarse_colors = true;
        points.columns[0].bytes.iter_mut().for_each(|byte| *byte = *byte & !63 | 32);
    });
}

/// Draws a world roughly and exactly, and roughly again.
fn is_replaced(roughen: impl Fn(&mut NodePoints)) {
    if !has_gpu() {
        return;
    }
    let exact = small_world();
    // A cloud is known by its manifest's address.
    let mut rough = TestScene { clouds: exact.clouds.clone(), ..small_world() };
    for node in &mut rough.nodes {
        let mut points = node.points.as_ref().clone();
        roughen(&mut points);
        node.points = Arc::new(points);
    }
    let settings = settings(looking_at_landscape());
    let [roughly, exactly] = [&rough, &exact]
        .map(|world| open_gpu(64 << 20).render(&world.scene(), &settings).expect("drawn"));
    assert_ne!(roughly.picture, exactly.picture);
    // A node a frame.
    let config = GpuConfig { upload_bytes_per_frame: 1, ..GpuConfig::default() };
    let mut gpu = GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}"));
    let mut complete = |world: &TestScene, least_points: u64| {
        for frames in 1..200 {
            let frame = gpu.render(&world.scene(), &settings).expect("drawn");
            assert!(frame.statistics.points >= least_points, "frame {frames} lacks points");
            if frame.statistics.waiting_nodes == 0 {
                return (frames, frame);
            }
        }
        panic!("never complete");
    };
    let all = exactly.statistics.points;
    assert_eq!(complete(&rough, 0).1.picture, roughly.picture);
    let (frames, refined) = complete(&exact, all);
    assert_eq!(refined.picture, exactly.picture);
    assert_eq!(frames, exact.nodes.len());
    assert_eq!(refined.statistics.resident_bytes, exactly.statistics.resident_bytes);
    assert_eq!(complete(&rough, all).1.picture, roughly.picture, "and back");
}

#[test]
fn a_lost_gpu_is_opened_anew_and_draws_the_same() {
    if !has_gpu() {
        return;
    }
    let world = small_world();
    let settings = settings(looking_at_landscape());
    let mut told = Vec::new();
    let mut renderer = Renderer::open(GpuConfig::default(), &mut |e| told.push(e.to_string()));
    let mut tell = |e: &crate::render::RenderError| told.push(e.to_string());
    let before = renderer.render(&world.scene(), &settings, &mut tell).expect("drawn");
    let Renderer::Gpu { gpu, .. } = &renderer else { panic!("there is a GPU") };
    gpu.lose();
    let after = renderer.render(&world.scene(), &settings, &mut tell).expect("drawn");
    assert_eq!(before.picture, after.picture);
    assert!(matches!(renderer, Renderer::Gpu { .. }), "on the GPU again");
    assert_eq!(told.len(), 1, "{told:?}");
}

#[test]
fn a_picture_that_the_compute_path_cannot_hold_is_rasterised() {
    if !has_gpu() {
        return;
    }
    let config = GpuConfig { least_adapter: true, path: GpuPath::Compute, ..GpuConfig::default() };
    let mut gpu = GpuRenderer::new(config).unwrap_or_else(|e| panic!("{e}"));
    let (scene, settings) = one_point();
    // 8 bytes a pixel are more than the 128 MiB that every adapter binds.
    let large = RenderSettings { size_px: [8192, 4096], ..settings };
    assert_eq!(gpu.draw(&scene.scene(), &large).expect("drawn").path, Some(GpuPath::Raster));
    let counted = RenderSettings { color: ColorMode::Density, ..large };
    let refused = gpu.draw(&scene.scene(), &counted).expect_err("refused").to_string();
    assert!(refused.contains("smaller picture"), "{refused}");
    let small = RenderSettings { size_px: [64, 64], ..settings };
    assert_eq!(gpu.draw(&scene.scene(), &small).expect("drawn").path, Some(GpuPath::Compute));
}
