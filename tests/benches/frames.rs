//! Milliseconds per frame for every splat, by points drawn, on the GPU by either path and on the CPU
//!
//! `./dev bench frames [INPUT] [--runs N]`. INPUT is a dataset or anything that `lodestream build`
//! takes; without one, a simulated courtyard of 12 million points. What the overview of 1280 x 720
//! pixels needs within each budget is loaded first; then the same frame is drawn N times, ways
//! taking turns. Times are medians from the call to the finished picture on the GPU, without reading
//! it back. (The like of Fraiss 2017, tables 4.1, 4.2 and figures 4.1, 4.2)

use std::{error::Error, time::Instant};

use lodestream_client::render::{
    CpuRenderer, GpuConfig, GpuPath, GpuRenderer, RenderSettings, Scene, Splat, SplatSize,
};
use lodestream_tests::{Options, median};

#[path = "support/overview.rs"]
mod overview;

use overview::{SIZE_PX, camera, dataset, load};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Fraiss's budgets.
const BUDGETS: [u64; 5] = [500_000, 1_000_000, 2_500_000, 5_000_000, 10_000_000];

/// Points that are drawn as meshes.
const MOST_MESHES: u64 = 1_000_000;

/// Splats and their sizes: each at the size at which its kind is used.
const SPLATS: [(Splat, SplatSize); 15] = [
    (Splat::Point, SplatSize::Pixels(1.0)),
    (Splat::Square, SplatSize::Pixels(1.0)),
    (Splat::Square, SplatSize::Pixels(2.0)),
    (Splat::Square, SplatSize::Pixels(5.0)),
    (Splat::Circle, SplatSize::Pixels(2.0)),
    (Splat::Circle, SplatSize::Pixels(5.0)),
    (Splat::Circle, SplatSize::Adaptive(1.6)),
    (Splat::Cone, SplatSize::Pixels(5.0)),
    (Splat::Paraboloid, SplatSize::Pixels(5.0)),
    (Splat::Paraboloid8, SplatSize::Pixels(5.0)),
    (Splat::Paraboloid16, SplatSize::Pixels(5.0)),
    (Splat::Paraboloid48, SplatSize::Pixels(5.0)),
    (Splat::Disc, SplatSize::Pixels(5.0)),
    (Splat::Blended, SplatSize::Pixels(5.0)),
    (Splat::BlendedDisc, SplatSize::Pixels(5.0)),
];

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse("sim:courtyard?points=12M&seed=1")?;
    let dataset = dataset(&input, "bench_frames.lods")?;
    let open = |path| GpuRenderer::new(GpuConfig { path, ..GpuConfig::default() });
    let adapter = open(GpuPath::Raster)?;
    println!("{}; {}x{} pixels; {runs} runs", adapter.adapter(), SIZE_PX[0], SIZE_PX[1]);
    for budget in BUDGETS {
        let (clouds, plan) = load(&dataset, budget)?;
        let scene = Scene { clouds: &clouds, nodes: &plan.nodes };
        let camera = camera(&clouds);
        println!("\n{} points in {} nodes\n", plan.points, plan.nodes.len());
        println!(
            "| splat | size | raster ms | compute ms | raster/compute | cpu ms | bytes/point |"
        );
        println!("| --- | --- | --- | --- | --- | --- | --- |");
        for (splat, splat_size) in SPLATS {
            // Without a real GPU, minutes a frame; what they cost shows with fewer points too.
            if splat.footprint().is_mesh() && budget > MOST_MESHES {
                continue;
            }
            let settings =
                RenderSettings { splat, splat_size, ..RenderSettings::new(SIZE_PX, camera) };
            // Of their own, so that what is resident is what this way to draw needs.
            let (mut raster, mut compute) = (open(GpuPath::Raster)?, open(GpuPath::Compute)?);
            // Uploads and compiles.
            let first = raster.draw(&scene, &settings)?;
            let by_compute = compute.draw(&scene, &settings)?.path == Some(GpuPath::Compute);
            let [mut of_raster, mut of_compute, mut of_cpu] = [const { Vec::new() }; 3];
            for _ in 0..runs {
                time(&mut of_raster, || raster.draw(&scene, &settings).map(drop))?;
                if by_compute {
                    time(&mut of_compute, || compute.draw(&scene, &settings).map(drop))?;
                }
                time(&mut of_cpu, || CpuRenderer.render(&scene, &settings).map(drop))?;
            }
            let raster_ms = median(&mut of_raster);
            let (compute_ms, ratio) = if by_compute {
                let ms = median(&mut of_compute);
                (format!("{ms:.1}"), format!("{:.1}", raster_ms / ms))
            } else {
                ("-".into(), "-".into())
            };
            println!(
                "| {} | {splat_size} | {raster_ms:.1} | {compute_ms} | {ratio} | {:.1} | {:.2} |",
                splat.name(),
                median(&mut of_cpu),
                first.resident_bytes as f64 / first.points.max(1) as f64,
            );
        }
    }
    Ok(())
}

/// Runs and notes the milliseconds.
fn time<E>(
    milliseconds: &mut Vec<f64>,
    run: impl FnOnce() -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let start = Instant::now();
    run()?;
    milliseconds.push(start.elapsed().as_secs_f64() * 1e3);
    Ok(())
}
