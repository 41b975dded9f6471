//! An evaluation from inputs to a report.

use std::{
    collections::HashMap,
    io::Write,
    path::{Path, PathBuf},
    process::Command,
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use anyhow::Context;
use lodestream_protocol::{BOOT_SPECULATIVE_BYTES, Header};
use serde::Deserialize;
use wait4::Wait4;

use super::{
    along, frame, left_out,
    report::{BuildRow, NoiseRow, Report, SubjectReport},
    stream::{Stop, Streaming},
    subject::Subject,
    views::ViewSize,
};
use crate::{
    camera::Camera,
    engine::{EngineConfig, Policy},
    interrupt::go_on,
    metrics::{PictureError, ssim_map},
    path::{Extent, PathSource},
    render::{Picture, RenderSettings, Splat, SplatSize},
    report::machine,
    source::{BlockingSource, LinkSpec, Source},
};

/// What truths are drawn with, and what streams in: closed surfaces, each splat as large as the points
/// around it are apart.
const LOOK: (Splat, SplatSize) = (Splat::Circle, SplatSize::Adaptive(1.6));

/// Behind the points.
const BACKGROUND: [u8; 3] = [18, 18, 24];

/// A view from beside it, in picture heights: where a visitor jumps to.
const JUMP_HEIGHTS: f64 = 0.75;

/// A request's, of a dataset that is fetched whole.
const FETCH_BYTES: u64 = 8 << 20;

/// What is evaluated, and how.
#[derive(Debug, Clone)]
pub struct EvalConfig {
    /// Datasets, or what they are built from.
    pub inputs: Vec<String>,
    /// Methods to build with, of inputs that are no datasets.
    pub methods: Vec<String>,
    /// Most points drawn.
    pub budgets: Vec<u64>,
    /// Ways to draw.
    pub splats: Vec<(Splat, SplatSize)>,
    /// Ways to fetch.
    pub policies: Vec<Policy>,
    /// Links to fetch by.
    pub links: Vec<LinkSpec>,
    /// Camera paths to follow: files or generators, as `shot --path` takes them.
    pub paths: Vec<String>,
    /// Instants of a path at which pictures are compared.
    pub path_frames: u32,
    /// Distances to look from.
    pub views: Vec<ViewSize>,
    /// Of the pictures.
    pub size_px: [u32; 2],
    /// Samples along each side of a pixel, of truths and of what streams in.
    pub samples: u32,
    /// Frames timed for each way to draw.
    pub runs: u32,
    /// Most points while streaming.
    pub stream_budget: u64,
    /// Of links and samples.
    pub seed: u64,
    /// The command line that does the same.
    pub command: String,
}

/// A picture for the page.
#[derive(Debug, Clone)]
pub struct Exhibit {
    /// Dataset, view, way, and its error.
    pub caption: String,
    /// The picture, or a map of where it is wrong.
    pub picture: Picture,
}

/// Evaluates. `say` is told what is being done.
///
/// # Errors
/// Where an input cannot be built or read, a picture cannot be drawn, or `cancel` is set.
pub fn run(
    config: &EvalConfig,
    cancel: &AtomicBool,
    say: &dyn Fn(&str),
) -> anyhow::Result<(Report, Vec<Exhibit>)> {
    let scratch = tempfile::tempdir().context("cannot make a temporary folder")?;
    // All of them first: a wrong one is told before the long work begins.
    let mut opened: Vec<(Subject, Option<BuildRow>)> = Vec::new();
    for input in &config.inputs {
        for (path, build) in datasets(input, config, scratch.path(), opened.len(), cancel, say)? {
            let mut subject = Subject::open(&path)?;
            if let Some(build) = build.as_ref().filter(|_| config.methods.len() > 1) {
                subject.name = format!("{} {}", subject.name, build.method);
            }
            subject.name = unique(&subject.name, opened.iter().map(|(other, _)| &*other.name));
            let folder = tempfile::tempdir_in(scratch.path());
            let folder = folder.context("cannot make a temporary folder")?.keep();
            // What is fetched hangs on the look, not on the view.
            let camera = Camera::overview(subject.bounds[0], subject.bounds[1], 1.0);
            let shown = RenderSettings::new(config.size_px, camera).groups(subject.manifest());
            subject.prepare_rivals(&folder, &config.policies, &shown)?;
            opened.push((subject, build));
        }
    }
    let (mut subjects, mut exhibits) = (Vec::new(), Vec::new());
    for (subject, build) in opened {
        subjects.push(evaluate(&subject, build, config, cancel, say, &mut exhibits)?);
    }
    let report = Report {
        format: "lodestream-eval".into(),
        version: 1,
        lodestream: env!("CARGO_PKG_VERSION").into(),
        machine: machine(),
        command: config.command.clone(),
        seed: config.seed,
        size_px: config.size_px,
        samples: config.samples,
        subjects,
    };
    Ok((report, exhibits))
}

/// What `build --report` writes, as far as it is told here.
#[derive(Deserialize)]
struct BuildReport {
    points_read: u64,
    points_written: u64,
    file_bytes: u64,
}

/// The name, with a number behind it where another is so named.
fn unique<'a>(name: &str, others: impl Iterator<Item = &'a str> + Clone) -> String {
    let numbered = (2_u32..).map(|number| format!("{name} {number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    let free = names.find(|name| others.clone().all(|other| other != name));
    free.unwrap_or_else(|| name.to_owned())
}

/// The dataset that `input` is, wherever it lies, or those that are built from it, one for each method.
fn datasets(
    input: &str,
    config: &EvalConfig,
    scratch: &Path,
    first: usize,
    cancel: &AtomicBool,
    say: &dyn Fn(&str),
) -> anyhow::Result<Vec<(PathBuf, Option<BuildRow>)>> {
    let folder = |index: usize| -> anyhow::Result<PathBuf> {
        // Inputs of one name lie apart.
        let folder = scratch.join(index.to_string());
        std::fs::create_dir(&folder).context("cannot make a temporary folder")?;
        Ok(folder)
    };
    let path = Path::new(input);
    if Source::names_url(input) {
        say(&format!("{input}: fetch"));
        return Ok(vec![(fetch(input, &folder(first)?, cancel)?, None)]);
    }
    if path.extension().is_some_and(|ending| ending == "lods") {
        return Ok(vec![(path.to_owned(), None)]);
    }
    let stem = match input.strip_prefix("sim:") {
        Some(scene) => scene.split('?').next().unwrap_or(scene).into(),
        None => path.file_stem().map_or("dataset".into(), |stem| stem.to_string_lossy()),
    };
    let build_one = |(index, method): (usize, &String)| {
        let folder = folder(first + index)?;
        say(&format!("{input}: build, {method}"));
        let output = folder.join(format!("{stem}.lods"));
        let row = build(input, method, &output, &folder.join("build.json"))?;
        Ok((output, Some(row)))
    };
    config.methods.iter().enumerate().map(build_one).collect()
}

/// Fetches a hosted dataset whole: truths take every point of it, many times over.
fn fetch(address: &str, folder: &Path, cancel: &AtomicBool) -> anyhow::Result<PathBuf> {
    let url = Source::parse_url(address)?;
    let name = url.path_segments().and_then(|mut segments| segments.next_back());
    let name = name.filter(|name| !name.is_empty()).unwrap_or("dataset.lods");
    let path = folder.join(name);
    let source = BlockingSource::new(Source::parse(address)?)?;
    // The size that the dataset says itself: hosts need not tell.
    let mut piece = source.read_prefix(BOOT_SPECULATIVE_BYTES)?.bytes;
    let bytes = Header::parse(&piece).with_context(|| address.to_owned())?.file_bytes;
    let unwritten = || format!("{}: cannot write", path.display());
    let mut file = std::fs::File::create(&path).with_context(unwritten)?;
    let mut offset = 0;
    loop {
        file.write_all(&piece).with_context(unwritten)?;
        offset += piece.len() as u64;
        if offset >= bytes {
            return Ok(path);
        }
        go_on(cancel)?;
        piece = source.read_range(offset, FETCH_BYTES.min(bytes - offset))?;
    }
}

/// Builds by the program itself, in a process of its own: whose memory is the build's.
fn build(input: &str, method: &str, output: &Path, report: &Path) -> anyhow::Result<BuildRow> {
    let program = std::env::current_exe().context("this program cannot be found again")?;
    let mut command = Command::new(program);
    command.arg("build").arg(input).arg("-o").arg(output).args(["--method", method]);
    command.arg("--report").arg(report).stdin(std::process::Stdio::null());
    command.stdout(std::process::Stdio::null()).stderr(std::process::Stdio::piped());
    let start = Instant::now();
    let mut child = command.spawn().context("the build cannot be started")?;
    let mut told = child.stderr.take();
    let mut text = String::new();
    if let Some(told) = &mut told {
        std::io::Read::read_to_string(told, &mut text).ok();
    }
    let ended = child.wait4().context("the build cannot be waited for")?;
    let seconds = start.elapsed().as_secs_f64();
    if !ended.status.success() {
        let last = text.lines().last().unwrap_or("it says nothing").trim_start_matches("error: ");
        anyhow::bail!("{last}");
    }
    let json = std::fs::read_to_string(report).context("the build's report cannot be read")?;
    let told: BuildReport =
        serde_json::from_str(&json).context("the build's report cannot be read")?;
    let row = BuildRow {
        method: method.into(),
        seconds,
        points_per_second: told.points_written as f64 / seconds,
        peak_bytes: Some(ended.rusage.maxrss).filter(|bytes| *bytes > 0),
        bytes_per_point: told.file_bytes as f64 / told.points_written.max(1) as f64,
        points_in: told.points_read,
        points_out: told.points_written,
    };
    Ok(row)
}

fn evaluate(
    subject: &Subject,
    build: Option<BuildRow>,
    config: &EvalConfig,
    cancel: &AtomicBool,
    say: &dyn Fn(&str),
    exhibits: &mut Vec<Exhibit>,
) -> anyhow::Result<SubjectReport> {
    let name = &subject.name;
    let [width, height] = config.size_px.map(f64::from);
    let aspect = width / height;
    let (bounds, middle) = (subject.bounds, subject.middle);
    let stop = |size: &ViewSize| Stop {
        name: size.name().into(),
        camera: size.camera(bounds, middle, aspect),
    };
    let stops: Vec<_> = config.views.iter().map(stop).collect();
    let (splat, splat_size) = LOOK;
    let settings = |camera| RenderSettings {
        splat,
        splat_size,
        background: BACKGROUND,
        ..RenderSettings::new(config.size_px, camera)
    };
    let Some(first) = stops.first() else { anyhow::bail!("no view to look from") };
    let base = settings(first.camera);

    let (mut truths, mut noise) = (HashMap::new(), Vec::new());
    for stop in &stops {
        say(&format!("{name}: truth of the {} view", stop.name));
        let settings = settings(stop.camera);
        let truth = subject.truth(&settings, config.samples, config.seed, cancel)?;
        let other =
            subject.truth(&settings, config.samples, config.seed.wrapping_add(1), cancel)?;
        let error = PictureError::between(&other, &truth)?;
        noise.push(NoiseRow {
            view: stop.name.clone(),
            ssim: error.ssim.unwrap_or(f64::NAN),
            mse: error.mse.unwrap_or(f64::NAN),
            coverage: truth.coverage(),
        });
        truths.insert(stop.name.clone(), truth);
    }

    say(&format!("{name}: frames"));
    let largest = config.budgets.iter().copied().max().unwrap_or(0);
    let mut shown = Vec::new();
    let frames = frame::frames(
        subject,
        &base,
        &stops,
        &truths,
        &config.budgets,
        &config.splats,
        config.runs,
        cancel,
        |row, picture, truth| {
            if row.budget == largest
                && Some(&row.splat) == config.splats.last().map(|s| s.0.name().to_owned()).as_ref()
            {
                let ssim = row.error.ssim.unwrap_or(f64::NAN);
                let caption = format!("{name}, {}", row.view);
                shown.push((format!("{caption}: the truth"), truth.clone()));
                let way = format!(
                    "{caption}: {} {}, {} points, SSIM {ssim:.3}",
                    row.splat, row.size, row.points
                );
                shown.push((way, picture.clone()));
                if let Ok(map) = ssim_map(picture, truth) {
                    shown.push((format!("{caption}: where it differs"), map));
                }
            }
        },
    )?;
    exhibits.extend(shown.into_iter().map(|(caption, picture)| Exhibit { caption, picture }));

    let streaming = Streaming {
        subject,
        settings: base,
        config: EngineConfig {
            point_budget: config.stream_budget,
            attributes: base.attribute_names(subject.manifest()),
            ..EngineConfig::default()
        },
        step: Duration::from_millis(50),
        patience: Duration::from_secs(120),
        seed: config.seed,
        samples: config.samples,
        cancel,
    };
    let mut streams = Vec::new();
    // From cold starts, and from the nearest view (which has most to fetch) to beside it.
    let jump = config.views.first().map(|size| Stop {
        name: format!("beside {}", size.name()),
        camera: size.jumped(bounds, middle, aspect, JUMP_HEIGHTS),
    });
    if let Some(jump) = &jump {
        say(&format!("{name}: truth after a jump"));
        let truth = subject.truth(&settings(jump.camera), config.samples, config.seed, cancel)?;
        truths.insert(jump.name.clone(), truth);
    }
    for &link in &config.links {
        for &policy in &config.policies {
            say(&format!("{name}: stream by {link}, {}", policy.name()));
            for (index, stop) in stops.iter().enumerate() {
                let mut tour = vec![stop.clone()];
                if index == 0 {
                    tour.extend(jump.clone());
                }
                streams.extend(streaming.run(&tour, &truths, link, policy)?);
            }
        }
    }

    let mut paths = Vec::new();
    for text in &config.paths {
        let path = PathSource::open(text)?.path(&Extent::of(&subject.clouds)?)?;
        let mut seen = Vec::new();
        for (seconds, camera) in along::instants(&path, config.path_frames) {
            say(&format!("{name}: truth along {text}, {seconds:.1} s"));
            let truth = subject.truth(&settings(camera), config.samples, config.seed, cancel)?;
            seen.push(along::Instant { seconds, camera, truth });
        }
        for &link in &config.links {
            for &policy in &config.policies {
                say(&format!("{name}: along {text} by {link}, {}", policy.name()));
                paths.push(streaming.follow(text, &path, &seen, link, policy)?);
            }
        }
    }

    say(&format!("{name}: what is left out"));
    let link = config.links.first().copied();
    let saved = match link {
        Some(link) => {
            let (engine, seed) = (&streaming.config, config.seed);
            left_out::savings(subject, &base, engine, &stops, link, seed, cancel)?
        }
        None => Vec::new(),
    };
    Ok(SubjectReport {
        name: name.clone(),
        points: subject.manifest().points,
        bytes: std::fs::metadata(&subject.path).map_or(0, |file| file.len()),
        potree_bytes: subject.potree_bytes(),
        potree_shown_bytes: subject.potree_shown_bytes(),
        build,
        noise,
        frames,
        streams,
        paths,
        not_stored: left_out::not_stored(subject, &base),
        left_out: saved,
    })
}
