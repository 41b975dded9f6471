//! `shot`: a picture of datasets, or many along a camera path, streamed as a viewer would or drawn
//! from every point.

mod patience;
mod report;
mod stream;
mod tour;
mod tour_report;
mod truth;

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Duration,
};

use anyhow::Context;
use clap::{ArgGroup, Args, ValueEnum, error::ErrorKind, value_parser};
use glam::DVec3;
use lodestream_protocol::Manifest;
use lodestream_server::commands::{print, write_report};

pub use report::ShotReport;
pub use tour_report::{Arrival, FrameReport, PathReport, TourReport};

use crate::{
    camera::Camera,
    commands::appearance::Appearance,
    metrics::ssim,
    render::{Coloring, Picture, RenderSettings},
};

/// Problems that are written out; the report has them all.
const PROBLEMS_SHOWN: usize = 5;

/// Most pictures along a path.
const MAX_FRAMES: u32 = 1_000_000;

/// Longest `--time-step`.
const LONGEST_STEP: Duration = Duration::from_secs(3600);

/// Draw a picture of datasets, or many along a camera path
#[derive(Debug, Clone, Args)]
#[command(group(ArgGroup::new("pace").args(["frames", "time_step"]).multiple(true)))]
pub struct ShotArgs {
    /// Dataset files, URLs of them, or a server's address with a dataset's name
    #[arg(required = true, value_name = "SOURCE")]
    pub sources: Vec<String>,
    /// The picture to write; with --path, the folder for frame_0000.png and so on
    #[arg(short, long, value_name = "OUT.png|DIR")]
    pub output: PathBuf,
    /// Width and height in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1280x720", value_parser = size)]
    pub size: [u32; 2],
    /// Where to look from: a camera file (eye, target, up; fov_y_degrees or orthographic_height), or
    /// 'overview'
    #[arg(long, value_name = "FILE.json|overview", default_value = "overview")]
    pub camera: String,
    /// Draw along a camera path: a path file, or a generator with options, such as
    /// 'orbit?seconds=20&turns=2' (or flythrough, zoom, teleport, random-walk; see PATHS.md)
    #[arg(
        long,
        value_name = "FILE.json|GENERATOR",
        requires = "pace",
        conflicts_with_all = ["camera", "against"]
    )]
    pub path: Option<String>,
    /// How many pictures: evenly spread over the path, each waited for until it is complete
    #[arg(
        long,
        value_name = "N",
        requires = "path",
        value_parser = value_parser!(u32).range(1..=i64::from(MAX_FRAMES))
    )]
    pub frames: Option<u32>,
    /// Wait for no picture: follow the path in real time, and draw every SECONDS what has come by then
    #[arg(long, value_name = "SECONDS", requires = "path", value_parser = time_step)]
    pub time_step: Option<Duration>,
    /// Write the path to this file
    #[arg(long, value_name = "FILE.json", requires = "path")]
    pub write_path: Option<PathBuf>,
    /// Most points to draw (the truth draws all)
    #[arg(long, value_name = "POINTS", default_value_t = 1_000_000)]
    pub budget: u64,
    /// What draws
    #[arg(long, value_enum, default_value_t = RendererName::Gpu)]
    pub renderer: RendererName,
    /// Write what was drawn, and what it took, to this file as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Tell the structural similarity to this picture, such as one of '--renderer truth'
    #[arg(long, value_name = "FILE.png")]
    pub against: Option<PathBuf>,
    /// Give up after this many seconds without a complete picture (along a path: each)
    #[arg(long, value_name = "SECONDS", default_value = "120", value_parser = seconds)]
    pub timeout: Duration,
    /// What it looks like.
    #[command(flatten)]
    pub appearance: Appearance,
}

/// Renderers, as the command line names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RendererName {
    /// The GPU, or the CPU where there is none
    Gpu,
    /// The CPU, in double precision
    Cpu,
    /// The CPU, every point of the datasets, 4 x 4 samples a pixel
    Truth,
}

/// A picture, and what it took.
pub(crate) struct Shot {
    picture: Picture,
    report: ShotReport,
}

/// Draws; says on standard output what came of it.
///
/// # Errors
/// Where a source cannot be read, the view cannot be drawn or a file cannot be written.
pub fn run(args: ShotArgs) -> anyhow::Result<ExitCode> {
    if args.renderer == RendererName::Truth && args.time_step.is_some() {
        let why = "--renderer truth draws complete pictures: give --frames without --time-step";
        clap::Error::raw(ErrorKind::ArgumentConflict, format!("{why}\n")).exit();
    }
    if let Some(path) = &args.path {
        return tour::run(&args, path);
    }
    let camera = match args.camera.as_str() {
        "overview" => None,
        file => Some(read_camera(Path::new(file))?),
    };
    let Shot { picture, mut report } = match args.renderer {
        RendererName::Truth => truth::draw(&args, camera)?,
        RendererName::Gpu | RendererName::Cpu => stream::draw(&args, camera)?,
    };
    picture.write_png(&args.output)?;
    if let Some(path) = &args.against {
        let other = Picture::read_png(path)?;
        report.ssim = Some(ssim(&picture, &other).with_context(|| path.display().to_string())?);
    }
    if let Some(path) = &args.report {
        write_report(path, &report)?;
    }
    print(&report.summary())?;
    Ok(tell_problems(&report.problems))
}

/// Says what a picture lacks: it is there, but not what it should be.
fn tell_problems(problems: &[String]) -> ExitCode {
    for problem in problems.iter().take(PROBLEMS_SHOWN) {
        eprintln!("warning: {problem}");
    }
    if problems.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

impl ShotArgs {
    /// What the picture of these clouds is to look like.
    fn settings(
        &self,
        camera: Option<Camera>,
        clouds: &[Arc<Manifest>],
    ) -> anyhow::Result<RenderSettings> {
        let [width, height] = self.size.map(f64::from);
        let camera = camera.unwrap_or_else(|| overview(clouds, width / height));
        self.appearance.settings(self.size, camera)
    }

    /// How each cloud is coloured; says where that is not what was asked for.
    fn colorings(&self, clouds: &[Arc<Manifest>]) -> Vec<Coloring> {
        let colorings = clouds.iter().zip(&self.sources).map(|(cloud, source)| {
            let coloring = Coloring::of(self.appearance.color, cloud);
            if coloring.falls_back(self.appearance.color) {
                let (asked, found) = (self.appearance.color.name(), coloring.name());
                eprintln!("note: {source} has no {asked}: coloured by {found}");
            }
            coloring
        });
        colorings.collect()
    }
}

fn overview(clouds: &[Arc<Manifest>], aspect: f64) -> Camera {
    let bounds = clouds.iter().filter_map(|cloud| cloud.bounds_world());
    let bounds = bounds.map(|(min, max)| (DVec3::from(min), DVec3::from(max)));
    let bounds = bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (min, max) = bounds.unwrap_or((DVec3::ZERO, DVec3::ONE));
    Camera::overview(min, max, aspect)
}

fn read_camera(path: &Path) -> anyhow::Result<Camera> {
    let name = || path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(name)?;
    Camera::from_json(&text).with_context(name)
}

pub(crate) fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides.ok_or_else(|| "expected a size like 1280x720".into())
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    seconds.filter(|s| !s.is_zero()).ok_or_else(|| "expected seconds above 0".into())
}

fn time_step(text: &str) -> Result<Duration, String> {
    let step = seconds(text)?;
    if step > LONGEST_STEP {
        return Err(format!("expected at most {} seconds", LONGEST_STEP.as_secs()));
    }
    Ok(step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_width_by_height() {
        assert_eq!(size("640x480"), Ok([640, 480]));
        for bad in ["640", "640x", "x480", "-1x5", "640*480"] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }
}
