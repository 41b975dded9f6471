//! `demo`: the whole way in one command: build, serve, stream along a path, draw, and tell.

use std::{
    fmt::Write as _,
    net::{Ipv4Addr, SocketAddr},
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::{Duration, Instant},
};

use anyhow::Context;
use clap::Args;
use glam::DVec3;
use lodestream_preprocess::{self as preprocess, BuildConfig, BuildReport, sim};
use lodestream_protocol::Manifest;
use lodestream_server::{
    ServeConfig,
    commands::{TerminalProgress, cancel_on_interrupt, print, write_report},
    spawn,
};
use serde::Serialize;

use crate::{
    camera::{Camera, Projection},
    engine::{Engine, EngineConfig, View},
    render::{ColorMode, GpuConfig, RenderError, RenderSettings, Renderer, Scene},
    source::Source,
};

/// What is built where no file is given.
const DEFAULT_INPUT: &str = "sim:courtyard?points=2M&seed=1";
/// Width and height of the pictures.
const SIZE_PX: [u32; 2] = [1280, 720];

/// Longest wait for a picture to be complete.
const PATIENCE: Duration = Duration::from_secs(60);

/// Build a dataset, serve it, stream it along a short camera path, write pictures and a summary
#[derive(Debug, Clone, Args)]
pub struct DemoArgs {
    /// Scans to build from [default: a simulated courtyard of 2 million points]
    #[arg(value_name = "FILE")]
    pub files: Vec<String>,
    /// Folder for the dataset, the pictures and the summary
    #[arg(short, long, default_value = "demo-out")]
    pub output: PathBuf,
}

/// One stop of the path. Also in `summary.json`.
#[derive(Debug, Serialize)]
struct Stop {
    name: String,
    picture: String,
    points: u64,
    nodes: u64,
    requests: u64,
    bytes: u64,
    first_ms: Option<f64>,
    settled_ms: Option<f64>,
    draw_ms: f64,
    not_fetched: LeftOut,
}

/// Points that the view did not need, by reason.
#[derive(Debug, Serialize)]
struct LeftOut {
    outside_points: u64,
    too_small_points: u64,
    over_budget_points: u64,
}

#[derive(Debug, Serialize)]
struct Summary<'a> {
    input: &'a [String],
    url: String,
    renderer: String,
    build: &'a BuildReport,
    stops: &'a [Stop],
}

/// Runs the demo.
///
/// # Errors
/// What building, serving, streaming, drawing or writing say.
pub fn run(args: DemoArgs) -> anyhow::Result<ExitCode> {
    let begun = Instant::now();
    let inputs =
        if args.files.is_empty() { vec![DEFAULT_INPUT.to_owned()] } else { args.files.clone() };
    let data = args.output.join("data");
    std::fs::create_dir_all(&data).with_context(|| format!("{}: cannot make", data.display()))?;
    let name = dataset_name(&inputs[0]);
    let file = data.join(format!("{name}.lods"));

    print(&format!("building {} from {}\n", file.display(), inputs.join(", ")))?;
    let progress = TerminalProgress::default();
    let build = preprocess::build(
        &BuildConfig {
            inputs: inputs.clone(),
            output: file.clone(),
            method: preprocess::Method::default(),
            grid: 128,
            memory_bytes: 4 << 30,
            threads: None,
            drop_attributes: Vec::new(),
            columns: None,
            scale: None,
            cells_per_spacing: lodestream_preprocess::CELLS_PER_SPACING,
            cancel: cancel_on_interrupt()?,
        },
        &progress,
    )?;
    progress.finish();
    anyhow::ensure!(
        build.points_written > 0,
        "{}: no points, so there is nothing to see",
        inputs.join(", ")
    );
    print(&format!(
        "  {} points, {:.2} bytes each, in {:.2} s\n",
        build.points_written,
        build.file_bytes as f64 / build.points_written as f64,
        build.total_seconds
    ))?;

    let server = spawn(ServeConfig::new(&data, SocketAddr::from((Ipv4Addr::LOCALHOST, 0))))?;
    let url = format!("{}/datasets/{name}.lods", server.url());
    print(&format!("serving {url}\n"))?;
    let mut renderer = Renderer::open(GpuConfig::default(), &mut tell_fallback);
    print(&format!("drawing with {}\n", renderer.name()))?;
    let engine = Engine::start(vec![Source::parse(&url)?], EngineConfig::default())?;
    let boots = engine.wait_open(PATIENCE)?;
    let clouds: Vec<Arc<Manifest>> =
        boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
    let mut stops = Vec::new();
    for (name, camera) in path(&inputs, &clouds[0]) {
        let stop = visit(&engine, &clouds, &mut renderer, name, camera, &args.output)?;
        print(&format!(
            "  {:<12} {:>9} points, {:>3} requests, {:>6.2} MB, complete after {:>5.0} ms\n",
            stop.name,
            stop.points,
            stop.requests,
            stop.bytes as f64 / 1e6,
            stop.settled_ms.unwrap_or(f64::NAN),
        ))?;
        stops.push(stop);
    }
    drop(engine);
    server.stop()?;
    let summary =
        Summary { input: &inputs, url, renderer: renderer.name(), build: &build, stops: &stops };
    write_report(&args.output.join("summary.json"), &summary)?;
    let page = args.output.join("index.html");
    std::fs::write(&page, html(&summary))
        .with_context(|| format!("{}: cannot write", page.display()))?;
    print(&format!("{} ({:.1} s)\n", page.display(), begun.elapsed().as_secs_f64()))?;
    Ok(ExitCode::SUCCESS)
}

/// A name for the dataset's file and URL.
fn dataset_name(input: &str) -> String {
    let stem = match input.strip_prefix("sim:") {
        Some(scene) => scene.split('?').next().unwrap_or(scene).to_owned(),
        None => Path::new(input)
            .file_stem()
            .map_or_else(String::new, |stem| stem.to_string_lossy().into_owned()),
    };
    let safe = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let name: String = stem.chars().map(safe).collect();
    if name.is_empty() { "demo".into() } else { name }
}

/// Where the camera goes: the simulated scan's own views, or once around any other cloud.
fn path(inputs: &[String], cloud: &Manifest) -> Vec<(String, Camera)> {
    if matches!(inputs, [only] if only == DEFAULT_INPUT) {
        return sim::VIEWS.iter().map(|view| (view.name.to_owned(), simulated(view))).collect();
    }
    let Some((min, max)) = cloud.bounds_world() else { return Vec::new() };
    let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
    let overview = Camera::overview(DVec3::from(min), DVec3::from(max), aspect);
    let moved = |closer: f64, turn: f64, lower: f64| {
        let arm = (overview.eye - overview.target) * closer;
        let (sin, cos) = turn.to_radians().sin_cos();
        let turned =
            DVec3::new(arm.x * cos - arm.y * sin, arm.x * sin + arm.y * cos, arm.z * lower);
        Camera { eye: overview.target + turned, ..overview }
    };
    vec![
        ("overview".into(), overview),
        ("closer".into(), moved(0.5, 40.0, 0.8)),
        ("low".into(), moved(0.3, 110.0, 0.5)),
        ("near".into(), moved(0.12, 160.0, 0.8)),
        ("back".into(), moved(0.9, 230.0, 1.0)),
    ]
}

fn simulated(view: &sim::View) -> Camera {
    Camera {
        eye: view.eye.into(),
        target: view.target.into(),
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y: view.fov_y_degrees.to_radians() },
    }
}

fn visit(
    engine: &Engine,
    clouds: &[Arc<Manifest>],
    renderer: &mut Renderer,
    name: String,
    camera: Camera,
    folder: &Path,
) -> anyhow::Result<Stop> {
    engine.set_view(View { camera, size_px: SIZE_PX });
    let plan = engine.wait_settled(PATIENCE)?;
    let phase = engine.stats().since_view;
    let color =
        if clouds[0].attribute("color").is_some() { ColorMode::Rgb } else { ColorMode::Elevation };
    let settings = RenderSettings { color, ..RenderSettings::new(SIZE_PX, camera) };
    let started = Instant::now();
    let frame = renderer.render(
        &Scene { clouds: &plan.clouds, nodes: &plan.nodes },
        &settings,
        &mut tell_fallback,
    )?;
    let draw_ms = started.elapsed().as_secs_f64() * 1e3;
    let picture = format!("{}.png", name.replace(' ', "-"));
    frame.picture.write_png(&folder.join(&picture))?;
    Ok(Stop {
        name,
        picture,
        points: frame.statistics.points,
        nodes: frame.statistics.nodes,
        requests: phase.totals.requests,
        bytes: phase.totals.bytes,
        first_ms: phase.first_points_ms,
        settled_ms: phase.settled_ms,
        draw_ms,
        not_fetched: LeftOut {
            outside_points: plan.left_out.outside.points,
            too_small_points: plan.left_out.small.points,
            over_budget_points: plan.left_out.over_budget.points,
        },
    })
}

fn tell_fallback(why: &RenderError) {
    eprintln!("note: {why}; drawing on the CPU");
}

/// The summary as one page beside its pictures.
fn html(summary: &Summary) -> String {
    let build = summary.build;
    let mut page = String::from(
        "<!doctype html><meta charset=utf-8><meta name=viewport content='width=device-width'>\
         <title>lodestream demo</title><style>\
         body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;\
         color:#222;background:#fafaf8}h1{margin-bottom:0}p{margin:.3rem 0 1rem}\
         .stops{display:grid;grid-template-columns:repeat(auto-fill,minmax(22rem,1fr));gap:1.2rem}\
         figure{margin:0;background:#fff;border:1px solid #ddd;border-radius:6px;overflow:hidden}\
         img{width:100%;display:block}figcaption{padding:.5rem .8rem;font-size:.9rem}\
         b{text-transform:capitalize}table{border-collapse:collapse;margin:1rem 0}\
         td{padding:.15rem 1.2rem .15rem 0;font-variant-numeric:tabular-nums}</style>\
         <h1>lodestream demo</h1>",
    );
    // Writing to a String cannot fail.
    let _ = write!(
        page,
        "<p>{} &rarr; {}<br>drawn with {}</p><table>\
         <tr><td>points<td>{}<tr><td>built in<td>{:.2} s<tr><td>file<td>{:.2} MB, {:.2} bytes a \
         point<tr><td>nodes, levels<td>{}, {}<tr><td>largest coordinate error<td>{}</table>\
         <div class=stops>",
        escape(&summary.input.join(", ")),
        escape(&summary.url),
        escape(&summary.renderer),
        build.points_written,
        build.total_seconds,
        build.file_bytes as f64 / 1e6,
        build.file_bytes as f64 / build.points_written as f64,
        build.nodes,
        build.levels,
        build.largest_coordinate_error,
    );
    for stop in summary.stops {
        let ms = |ms: Option<f64>| ms.map_or("already there".into(), |ms| format!("{ms:.0} ms"));
        let _ = write!(
            page,
            "<figure><img src='{}' alt='{}'><figcaption><b>{}</b>: {} points in {} nodes; {} \
             requests, {:.2} MB; first picture {}, complete {}; drawn in {:.0} ms. Left out: {} \
             points outside the view, {} too small to see, {} over the budget.</figcaption>\
             </figure>",
            stop.picture,
            escape(&stop.name),
            escape(&stop.name),
            stop.points,
            stop.nodes,
            stop.requests,
            stop.bytes as f64 / 1e6,
            ms(stop.first_ms),
            ms(stop.settled_ms),
            stop.draw_ms,
            stop.not_fetched.outside_points,
            stop.not_fetched.too_small_points,
            stop.not_fetched.over_budget_points,
        );
    }
    page.push_str("</div>");
    page
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('\'', "&#39;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_fit_for_files_and_urls() {
        assert_eq!(dataset_name("sim:courtyard?points=2M&seed=1"), "courtyard");
        assert_eq!(dataset_name("/some where/my scan #1.laz"), "my-scan--1");
        assert_eq!(dataset_name("/"), "demo");
    }
}
