//! Both renderers against each other, and both against what must be seen.

mod extremes;
mod fallbacks;
mod modes;
mod pictures;
mod seen;

use std::{
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError},
};

use glam::DVec3;
use lodestream_protocol::{Lattice, Manifest};

use crate::{
    camera::{Camera, Projection},
    engine::DrawNode,
    metrics::ssim,
    render::{
        ColorMode, CpuRenderer, Frame, GpuConfig, GpuRenderer, Picture, RenderSettings, Scene,
        Splat, SplatSize, TruthRenderer,
        ramp::Ramp,
        testing::{self, Point, TestScene, cloud, landscape},
    },
};

pub const BACKGROUND: [u8; 3] = [12, 34, 56];

/// Whether there is a GPU to test: tests fail without an adapter, unless LODESTREAM_NO_GPU=1 says
/// that there is none: then the GPU's part is left out, and that is said.
pub fn has_gpu() -> bool {
    let none = std::env::var_os("LODESTREAM_NO_GPU").is_some_and(|value| value == "1");
    if none {
        println!("LODESTREAM_NO_GPU=1: the GPU part of this test is left out");
    }
    !none
}

/// The GPU renderer of all tests, where there is one.
pub fn gpu() -> Option<MutexGuard<'static, GpuRenderer>> {
    static GPU: OnceLock<Mutex<GpuRenderer>> = OnceLock::new();
    if !has_gpu() {
        return None;
    }
    let gpu = GPU.get_or_init(|| Mutex::new(open_gpu(64 << 20)));
    // Another test that failed while drawing says nothing about this one.
    Some(gpu.lock().unwrap_or_else(PoisonError::into_inner))
}

pub fn open_gpu(resident_bytes: u64) -> GpuRenderer {
    GpuRenderer::new(GpuConfig { resident_bytes, ..GpuConfig::default() }).unwrap_or_else(|e| {
        panic!(
            "{e}. The tests need one: apt-get install mesa-vulkan-drivers, or LODESTREAM_NO_GPU=1"
        )
    })
}

/// Draws with both renderers, where both are there.
pub fn draw(scene: &Scene, settings: &RenderSettings) -> Vec<Picture> {
    let cpu = CpuRenderer.render(scene, settings).expect("drawn on the CPU").picture;
    let gpu = gpu().map(|mut gpu| gpu.render(scene, settings).expect("drawn on the GPU").picture);
    std::iter::once(cpu).chain(gpu).collect()
}

/// Where pictures of this run are written: beside the test binary's folder.
pub fn folder() -> PathBuf {
    let exe = std::env::current_exe().expect("a running test has a path");
    let folder = exe.ancestors().nth(2).expect("target/PROFILE/deps/TEST").join("test-pictures");
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}

pub fn equal_share(a: &Picture, b: &Picture) -> f64 {
    let pixels = a.rgba8.chunks_exact(4).zip(b.rgba8.chunks_exact(4));
    pixels.filter(|(a, b)| a == b).count() as f64 / a.depth.len() as f64
}

/// Writes both pictures and fails where they are not alike.
pub fn assert_alike(name: &str, a: &Picture, b: &Picture, least_equal: f64) {
    let folder = folder();
    for (picture, kind) in [(a, "cpu"), (b, "gpu")] {
        picture.write_png(&folder.join(format!("{name}.{kind}.png"))).expect("written");
    }
    let (similarity, equal) = (ssim(a, b).expect("same size"), equal_share(a, b));
    let folder = folder.display();
    println!("{name}: SSIM {similarity:.6}, {equal:.6} of the pixels equal; see {folder}");
    assert!(similarity >= 0.99, "{name}: SSIM {similarity}; see {folder}");
    assert!(equal >= least_equal, "{name}: only {equal} of the pixels equal; see {folder}");
    let same = |(a, b): &(&f32, &f32)| a == b || (**a - **b).abs() <= 1e-5 * a.abs();
    let same_depth = a.depth.iter().zip(&b.depth).filter(same).count();
    let same_depth = same_depth as f64 / a.depth.len() as f64;
    assert!(same_depth >= least_equal, "{name}: only {same_depth} of the depths equal");
}

pub fn lattice(scale: f64, side_bits: u8) -> Lattice {
    Lattice { scale, offset: [0.0; 3], origin: [0; 3], side_bits }
}

/// A landscape of 16 x 16 x 16 world units on a 16-bit lattice.
pub fn small_world() -> TestScene {
    cloud(lattice(1.0 / 4096.0, 16), 3, &landscape(16, 60_000))
}

pub fn looking_at_landscape() -> Camera {
    Camera {
        eye: DVec3::new(7.0, -9.0, 8.5),
        target: DVec3::new(7.5, 8.0, 2.0),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: 0.9 },
    }
}

pub fn settings(camera: Camera) -> RenderSettings {
    RenderSettings { background: BACKGROUND, ..RenderSettings::new([320, 200], camera) }
}

/// One point at lattice (2, 2, 2) of a lattice of whole units, seen from 10 units away along y.
pub fn one_point() -> (TestScene, RenderSettings) {
    let point = Point { q: [2, 2, 2], rgb: [10, 20, 30], intensity: 750 };
    let camera = Camera {
        eye: DVec3::new(2.0, -8.0, 2.0),
        target: DVec3::splat(2.0),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 },
    };
    // An odd size, so that the point lies in the middle of a pixel.
    let settings = RenderSettings { size_px: [31, 21], ..settings(camera) };
    (cloud(lattice(1.0, 4), 1, &[point]), settings)
}

/// Pixels on which something was drawn, as (column, row).
pub fn drawn(picture: &Picture) -> Vec<(u32, u32)> {
    let drawn = picture.depth.iter().zip(0..).filter(|(d, _)| d.is_finite());
    drawn.map(|(_, i)| (i % picture.width, i / picture.width)).collect()
}

pub fn color_at(picture: &Picture, column: u32, row: u32) -> [u8; 3] {
    let at = 4 * (row * picture.width + column) as usize;
    [picture.rgba8[at], picture.rgba8[at + 1], picture.rgba8[at + 2]]
}
