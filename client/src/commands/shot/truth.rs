//! A shot of every point: read from front to back, whatever its size, drawn as it passes.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::Instant,
};

use anyhow::Context;
use lodestream_preprocess::Progress;
use lodestream_protocol::{Dataset, Manifest, Node, ReadAt};
use lodestream_server::commands::TerminalProgress;

use super::{Shot, ShotArgs, ShotReport};
use crate::{
    camera::Camera,
    full_resolution,
    interrupt::go_on,
    render::{Coloring, Frame, RenderSettings, TruthRenderer, VisibleTree},
    source::{BlockingSource, Source},
};

/// Samples along each side of a pixel.
const SAMPLES: u32 = 4;

/// The sources, open, with all of their nodes known.
pub(super) struct Truth {
    pub clouds: Vec<Arc<Manifest>>,
    /// How each cloud is coloured.
    pub colorings: Vec<Coloring>,
    datasets: Vec<Dataset<Metered>>,
    /// Of each cloud, the nodes that hold every point once.
    hierarchies: Vec<Vec<Node>>,
    progress: TerminalProgress,
}

impl Truth {
    /// Opens the sources.
    ///
    /// # Errors
    /// Where one cannot be read.
    pub fn open(args: &ShotArgs) -> anyhow::Result<Self> {
        let datasets = args.sources.iter().map(|text| open(text));
        let datasets = datasets.collect::<anyhow::Result<Vec<_>>>()?;
        let clouds: Vec<_> = datasets.iter().map(|d| Arc::new(d.manifest().clone())).collect();
        let colorings = args.colorings(&clouds);
        let mut hierarchies = Vec::new();
        for (dataset, text) in datasets.iter().zip(&args.sources) {
            let nodes = dataset.hierarchy().with_context(|| text.clone())?;
            hierarchies.push(full_resolution::nodes(dataset.manifest().refinement, nodes));
        }
        let progress = TerminalProgress::default();
        Ok(Self { clouds, colorings, datasets, hierarchies, progress })
    }

    /// Draws all points; `what` is being drawn, for the user.
    ///
    /// # Errors
    /// Where a source cannot be read or the view cannot be drawn; where `cancel` is set.
    pub fn draw(
        &self,
        args: &ShotArgs,
        settings: &RenderSettings,
        what: &str,
        cancel: &AtomicBool,
    ) -> anyhow::Result<Frame> {
        let drawn = |(cloud, nodes): (usize, &Vec<Node>)| {
            nodes.iter().map(|n| (cloud, n.key, n.spacing)).collect::<Vec<_>>()
        };
        let tree = VisibleTree::of(self.hierarchies.iter().enumerate().flat_map(drawn));
        let mut renderer = TruthRenderer::new(settings, &self.clouds, tree, SAMPLES)?;
        self.progress.phase(what, self.points() * u64::from(renderer.passes()), "points");
        for pass in 0..renderer.passes() {
            if pass > 0 {
                renderer.next_pass()?;
            }
            for (cloud, (dataset, text)) in self.datasets.iter().zip(&args.sources).enumerate() {
                let (nodes, groups) =
                    (&self.hierarchies[cloud], settings.groups(&self.clouds[cloud]));
                let done = |points| {
                    self.progress.advance(points);
                    go_on(cancel)
                };
                full_resolution::draw(&mut renderer, cloud, dataset, nodes, &groups, done)
                    .with_context(|| text.clone())?;
            }
        }
        let frame = renderer.finish()?;
        self.progress.finish();
        Ok(frame)
    }

    /// Points of all clouds.
    pub fn points(&self) -> u64 {
        self.clouds.iter().map(|cloud| cloud.points).sum()
    }

    /// Requests sent and bytes asked for so far.
    pub fn read_so_far(&self) -> (u64, u64) {
        let sum = |count: fn(&Metered) -> &AtomicU64| {
            self.datasets.iter().map(|d| count(d.source()).load(Ordering::Relaxed)).sum()
        };
        (sum(|source| &source.requests), sum(|source| &source.bytes))
    }

    /// As a report names the colours.
    pub fn color_names(&self) -> Vec<&'static str> {
        self.colorings.iter().map(Coloring::name).collect()
    }
}

/// Draws all points of the sources.
///
/// # Errors
/// Where a source cannot be read or the view cannot be drawn.
pub(super) fn draw(args: &ShotArgs, camera: Option<Camera>) -> anyhow::Result<Shot> {
    let start = Instant::now();
    let truth = Truth::open(args)?;
    let settings = args.settings(camera, &truth.clouds)?;
    // Nothing is lost where an interrupt simply ends the program.
    let Frame { picture, statistics, points_per_pixel } =
        truth.draw(args, &settings, "draw", &AtomicBool::new(false))?;
    let milliseconds = start.elapsed().as_secs_f64() * 1e3;
    let (requests, bytes) = truth.read_so_far();
    let report = ShotReport {
        sources: args.sources.clone(),
        picture: args.output.clone(),
        size_px: args.size,
        camera: serde_json::from_str(&settings.camera.to_json())?,
        renderer: "truth".into(),
        fallback: None,
        colors: truth.color_names(),
        points: statistics.points,
        nodes: statistics.nodes,
        requests,
        bytes,
        first_picture_ms: milliseconds,
        settled_picture_ms: milliseconds,
        coverage: picture.coverage(),
        left_out: Default::default(),
        engine: None,
        frame: statistics,
        ssim: None,
        points_per_pixel,
        problems: Vec::new(),
    };
    Ok(Shot { picture, report })
}

fn open(text: &str) -> anyhow::Result<Dataset<Metered>> {
    let source = BlockingSource::new(Source::parse(text)?)?;
    let source = Metered { source, requests: AtomicU64::new(0), bytes: AtomicU64::new(0) };
    Dataset::open(source).with_context(|| text.to_owned())
}

/// A source that counts what is read.
struct Metered {
    source: BlockingSource,
    requests: AtomicU64,
    bytes: AtomicU64,
}

impl ReadAt for Metered {
    fn read_at(&self, offset: u64, len: usize) -> lodestream_protocol::Result<Vec<u8>> {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.bytes.fetch_add(len as u64, Ordering::Relaxed);
        self.source.read_at(offset, len)
    }

    fn size(&self) -> lodestream_protocol::Result<u64> {
        self.requests.fetch_add(1, Ordering::Relaxed);
        self.source.size()
    }
}
