//! A tour: pictures along a camera path, all by one engine and one renderer, so that what is
//! loaded and uploaded for one picture is there for the next, as in a viewer.

use std::{
    path::Path,
    process::ExitCode,
    sync::{Arc, atomic::AtomicBool},
    time::{Duration, Instant},
};

use anyhow::Context;
use lodestream_preprocess::Progress;
use lodestream_protocol::Manifest;
use lodestream_server::commands::{TerminalProgress, cancel_on_interrupt, print, write_report};

use super::{
    MAX_FRAMES, RendererName, ShotArgs, patience,
    stream::Stream,
    tell_problems,
    tour_report::{Arrival, FrameReport, PathReport, TourReport},
    truth::Truth,
};
use crate::{
    engine::EngineStats,
    path::{CameraPath, Extent, PathSource},
    render::{Frame, Picture, RenderSettings},
};

/// Digits of a picture's number at least: `frame_0000.png`.
const LEAST_DIGITS: usize = 4;

/// Draws along a path; says on standard output what came of it.
///
/// # Errors
/// Where there is no such path, a source cannot be read, a view cannot be drawn or a file cannot
/// be written; where the user interrupts. The pictures that are there by then are whole.
pub(super) fn run(args: &ShotArgs, path: &str) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let source = PathSource::open(path)?;
    let cancel = cancel_on_interrupt()?;
    let mut drawer = match args.renderer {
        RendererName::Truth => Drawer::Truth(Truth::open(args)?),
        RendererName::Gpu | RendererName::Cpu => Drawer::Stream(Stream::open(args, &cancel)?),
    };
    let clouds = drawer.clouds();
    let path = source.path(&Extent::of(clouds)?)?;
    let settings = args.settings(Some(path.at(path.start())), clouds)?;
    if let Some(file) = &args.write_path {
        path.write(file)?;
    }
    let opened_ms = milliseconds(start.elapsed());
    let mut tour = Tour {
        args,
        cancel: &cancel,
        times: times(&path, args.frames, args.time_step)?,
        path: &path,
        settings,
        frames: Vec::new(),
    };
    tour.make_folder()?;
    match &mut drawer {
        Drawer::Truth(truth) => tour.draw_truth(truth)?,
        Drawer::Stream(stream) => match args.time_step {
            None => tour.draw_settled(stream)?,
            Some(step) => tour.draw_in_real_time(stream, step)?,
        },
    }

    let frames = tour.frames;
    let total_ms = milliseconds(start.elapsed());
    let (requests, bytes, engine) = drawer.totals();
    let report = TourReport {
        sources: args.sources.clone(),
        folder: args.output.clone(),
        size_px: args.size,
        path: PathReport::of(&path),
        time_step_seconds: args.time_step.map(|step| step.as_secs_f64()),
        renderer: drawer.renderer_name(),
        fallback: drawer.fallback(),
        colors: drawer.color_names(),
        requests,
        bytes,
        opened_ms,
        total_ms,
        problems: engine.as_ref().map(|stats| stats.problems.clone()).unwrap_or_default(),
        engine,
        frames,
    };
    if let Some(file) = &args.report {
        write_report(file, &report)?;
    }
    print(&report.summary())?;
    Ok(tell_problems(&report.problems))
}

/// What draws.
enum Drawer {
    Stream(Stream),
    Truth(Truth),
}

impl Drawer {
    fn clouds(&self) -> &[Arc<Manifest>] {
        match self {
            Self::Stream(stream) => &stream.clouds,
            Self::Truth(truth) => &truth.clouds,
        }
    }

    fn renderer_name(&self) -> String {
        match self {
            Self::Stream(stream) => stream.renderer_name(),
            Self::Truth(_) => "truth".into(),
        }
    }

    fn fallback(&self) -> Option<String> {
        match self {
            Self::Stream(stream) => stream.fallback(),
            Self::Truth(_) => None,
        }
    }

    fn color_names(&self) -> Vec<&'static str> {
        match self {
            Self::Stream(stream) => stream.color_names(),
            Self::Truth(truth) => truth.color_names(),
        }
    }

    /// Requests and bytes from the start, and the engine's figures if there is one.
    fn totals(&self) -> (u64, u64, Option<EngineStats>) {
        match self {
            Self::Stream(stream) => {
                let stats = stream.engine.stats();
                let totals = stats.since_start.totals;
                (totals.requests, totals.bytes, Some(stats))
            }
            Self::Truth(truth) => {
                let (requests, bytes) = truth.read_so_far();
                (requests, bytes, None)
            }
        }
    }
}

/// The times of the pictures: evenly spread, or in steps of real time.
fn times(
    path: &CameraPath,
    frames: Option<u32>,
    step: Option<Duration>,
) -> anyhow::Result<Vec<f64>> {
    let Some(step) = step.map(|step| step.as_secs_f64()) else {
        return Ok(path.times(frames.unwrap_or(1)).collect());
    };
    let frames = match frames {
        Some(frames) => f64::from(frames),
        // The end of a loop is its start.
        None if path.is_loop() => (path.duration() / step).ceil(),
        None => (path.duration() / step).floor() + 1.0,
    };
    anyhow::ensure!(
        frames <= f64::from(MAX_FRAMES),
        "a picture each {step} s makes {frames} of this path, more than {MAX_FRAMES}: take a larger \
         --time-step, or give --frames"
    );
    Ok((0..frames as u32).map(|k| path.start() + f64::from(k) * step).collect())
}

/// A tour under way.
struct Tour<'a> {
    args: &'a ShotArgs,
    cancel: &'a AtomicBool,
    path: &'a CameraPath,
    /// Of the pictures.
    times: Vec<f64>,
    /// Of all pictures but for their cameras.
    settings: RenderSettings,
    frames: Vec<FrameReport>,
}

impl Tour<'_> {
    fn make_folder(&self) -> anyhow::Result<()> {
        let folder = &self.args.output;
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        let next = self.name(self.times.len());
        if folder.join(&next).exists() {
            let folder = folder.display();
            eprintln!("note: {folder} has {next} of an earlier run, which is not written again");
        }
        Ok(())
    }

    fn name(&self, number: usize) -> String {
        let digits = self.times.len().saturating_sub(1).to_string().len().max(LEAST_DIGITS);
        format!("frame_{number:0digits$}.png")
    }

    fn settings(&self, number: usize) -> RenderSettings {
        RenderSettings { camera: self.path.at(self.times[number]), ..self.settings }
    }

    /// Where something has failed.
    fn place(&self, number: usize) -> String {
        format!("{} (at {} s)", self.name(number), self.times[number])
    }

    /// Each picture once it is complete.
    fn draw_settled(&mut self, stream: &mut Stream) -> anyhow::Result<()> {
        let progress = TerminalProgress::default();
        progress.phase("draw", self.times.len() as u64, "pictures");
        stream.set_attributes(&self.settings);
        let mut view = 0;
        for number in 0..self.times.len() {
            let settings = self.settings(number);
            let before = stream.engine.stats();
            let last_view = std::mem::replace(&mut view, stream.set_view(&settings));
            let timeout = self.args.timeout;
            let plan =
                patience::wait(self.cancel, timeout, |turn| stream.engine.wait_settled(turn))
                    .with_context(|| self.place(number))?;
            let stats = stream.engine.stats();
            let mut arrival = Arrival::between(&before, &stats, &plan, view);
            if last_view == view {
                // The camera has not moved: all was there before.
                (arrival.first_ms, arrival.settled_ms) = (Some(0.0), Some(0.0));
            }
            let begun = Instant::now();
            let frame = stream.draw(&plan, &settings).with_context(|| self.place(number))?;
            self.keep(number, &settings, frame, milliseconds(begun.elapsed()), arrival)?;
            progress.advance(1);
        }
        progress.finish();
        Ok(())
    }

    /// As a viewer does: the camera moves on by the clock, and each picture shows what is there one
    /// step after the camera has come to its place. While it is drawn, the next is loaded.
    fn draw_in_real_time(&mut self, stream: &mut Stream, step: Duration) -> anyhow::Result<()> {
        let progress = TerminalProgress::default();
        progress.phase("draw", self.times.len() as u64, "pictures");
        stream.set_attributes(&self.settings);
        let mut before = stream.engine.stats();
        let mut view = stream.set_view(&self.settings(0));
        let mut due = Instant::now();
        for number in 0..self.times.len() {
            due += step;
            patience::wait_until(due, self.cancel, &stream.engine)
                .with_context(|| self.place(number))?;
            let late = due.elapsed();
            let settings = self.settings(number);
            let plan = stream.engine.plan();
            let stats = stream.engine.stats();
            let mut arrival = Arrival::between(&before, &stats, &plan, view);
            arrival.late_ms = Some(milliseconds(late));
            before = stats;
            if number + 1 < self.times.len() {
                view = stream.set_view(&self.settings(number + 1));
            }
            let begun = Instant::now();
            let frame = stream.draw(&plan, &settings).with_context(|| self.place(number))?;
            self.keep(number, &settings, frame, milliseconds(begun.elapsed()), arrival)?;
            progress.advance(1);
        }
        progress.finish();
        Ok(())
    }

    /// Each picture of every point.
    fn draw_truth(&mut self, truth: &Truth) -> anyhow::Result<()> {
        let (pictures, points) = (self.times.len(), truth.points());
        eprintln!(
            "note: each of the {pictures} pictures reads all {points} points: this takes long"
        );
        for number in 0..pictures {
            let settings = self.settings(number);
            let (requests, bytes) = truth.read_so_far();
            let begun = Instant::now();
            let frame = truth
                .draw(self.args, &settings, &self.name(number), self.cancel)
                .with_context(|| self.place(number))?;
            let draw_ms = milliseconds(begun.elapsed());
            let now = truth.read_so_far();
            let (requests, bytes) = (now.0 - requests, now.1 - bytes);
            let arrival = Arrival {
                requests,
                bytes,
                is_settled: true,
                is_current: true,
                ..Arrival::default()
            };
            self.keep(number, &settings, frame, draw_ms, arrival)?;
        }
        Ok(())
    }

    /// Writes a picture and notes what it took.
    fn keep(
        &mut self,
        number: usize,
        settings: &RenderSettings,
        frame: Frame,
        draw_ms: f64,
        arrival: Arrival,
    ) -> anyhow::Result<()> {
        let name = self.name(number);
        write_whole(&frame.picture, &self.args.output, &name)?;
        self.frames.push(FrameReport {
            picture: name,
            time: self.times[number],
            camera: serde_json::from_str(&settings.camera.to_json())?,
            points: frame.statistics.points,
            nodes: frame.statistics.nodes,
            arrival,
            draw_ms,
            coverage: frame.picture.coverage(),
            frame: frame.statistics,
        });
        Ok(())
    }
}

/// Writes under another name first, so that a picture is either whole or not there.
fn write_whole(picture: &Picture, folder: &Path, name: &str) -> anyhow::Result<()> {
    let part = folder.join(format!("{name}.part"));
    let whole = folder.join(name);
    let written = picture.write_png(&part).map_err(anyhow::Error::from).and_then(|()| {
        std::fs::rename(&part, &whole).with_context(|| format!("{}: cannot write", whole.display()))
    });
    if written.is_err() {
        // What is left of it is of no use; if it cannot be removed either, the first error says why.
        let _ = std::fs::remove_file(&part);
    }
    written
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(line: &str) -> CameraPath {
        let extent = Extent::new([0.0; 3], [1.0; 3]).expect("finite");
        PathSource::open(line).expect("a generator").path(&extent).expect("a path")
    }

    #[test]
    fn steps_of_real_time_cover_the_path_once() {
        let of = |line, frames, seconds| {
            times(&path(line), frames, Some(Duration::from_secs_f64(seconds))).expect("few")
        };
        assert_eq!(of("flythrough?seconds=2", None, 0.5), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(of("orbit?seconds=2", None, 0.5), [0.0, 0.5, 1.0, 1.5]);
        assert_eq!(of("orbit?seconds=2", Some(2), 0.25), [0.0, 0.25]);
        let error = times(&path("orbit"), None, Some(Duration::from_nanos(1))).expect_err("many");
        assert!(error.to_string().contains("--time-step"), "{error}");
    }

    #[test]
    fn a_picture_that_cannot_be_written_leaves_nothing() {
        let folder = tempfile::tempdir().expect("temporary folder");
        // A folder stands where the picture should be.
        std::fs::create_dir(folder.path().join("frame.png")).expect("made");
        let picture =
            Picture { width: 1, height: 1, rgba8: vec![0; 4], depth: vec![f32::INFINITY] };
        write_whole(&picture, folder.path(), "frame.png").expect_err("in the way");
        assert_eq!(std::fs::read_dir(folder.path()).expect("listed").count(), 1);
        write_whole(&picture, folder.path(), "other.png").expect("written");
        assert!(folder.path().join("other.png").is_file());
    }
}
