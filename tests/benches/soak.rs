//! Minutes of a wild walk on a bad line: what the caller's thread feels, and what is left in the end
//!
//! `./dev bench soak [INPUT] [--minutes N] [--link LINK] [--seed N]`. Ten minutes, 8 Mbit/s and 60 ms
//! without more said. INPUT is a dataset or anything that `lodestream build` takes; without one, a simulated
//! courtyard of 4 million points. Two clouds, real sockets; their hosts answer one request in six with
//! failures, cuts, wrong ranges, damage or silence, and one of them dies every few seconds and comes
//! back with another dataset. The camera walks and, every second or so, jumps; each second another
//! point budget is set, and at times another cache size, clip box, least size, or whether a cloud is seen.
//! Every frame is drawn by the CPU. Then a part of the frames is drawn again, of the same nodes, with
//! no engine there: what streaming costs a frame. Fails where the engine does not settle, keeps more than its
//! cache's limit, or ends with another picture than a cold start from files.

use std::{
    collections::HashMap,
    env,
    error::Error,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use lodestream_client::{
    engine::{DrawNode, FramePlan},
    render::{CpuRenderer, RenderSettings, Scene},
};
use lodestream_preprocess::FileSource;
use lodestream_protocol::{Dataset, Manifest, Node, NodeKey, NodePoints};

#[path = "../../client/tests/common/drawn.rs"]
mod drawn;
#[path = "../../client/tests/common/host.rs"]
#[allow(dead_code)]
mod host;
#[path = "support/overview.rs"]
#[allow(dead_code)]
mod overview;
#[path = "support/process.rs"]
#[allow(dead_code)]
mod process;
#[path = "../../client/tests/common/soak.rs"]
mod soak;

use soak::{Outcome, Seen, Soak};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A frame that streaming holds up longer than that is a stall.
const STALL_MS: f64 = 50.0;

/// Frames that are drawn again.
const REPEATED: usize = 1000;

const USAGE: &str = "usage: soak [INPUT] [--minutes N] [--link LINK] [--seed N]";

fn main() -> Result<()> {
    let mut input = "sim:courtyard?points=4M&seed=1".into();
    let (mut minutes, mut link, mut seed) = (10.0, "8mbit/60ms".to_owned(), 1);
    let mut arguments = env::args_os().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().and_then(|v| v.into_string().ok()).ok_or(USAGE);
        match argument.to_str() {
            Some("--bench") => {}
            Some("--minutes") => minutes = value()?.parse()?,
            Some("--link") => link = value()?,
            Some("--seed") => seed = value()?.parse()?,
            Some(option) if option.starts_with('-') => return Err(USAGE.into()),
            _ => input = argument,
        }
    }
    let clouds = [
        overview::dataset(&input, "bench_soak.lods")?,
        overview::dataset("sim:courtyard?points=400k&seed=2".as_ref(), "bench_soak_beside.lods")?,
    ];
    let other =
        overview::dataset("sim:courtyard?points=1M&seed=3".as_ref(), "bench_soak_other.lods")?;
    let soak = Soak {
        clouds,
        other,
        length: Duration::from_secs_f64(60.0 * minutes),
        seed,
        link: link.parse()?,
        size_px: [320, 200],
        budgets: [50_000, 1_000_000],
        cache_bytes: 64 << 20,
        step: Duration::from_secs(1),
        death: Duration::from_secs(7),
    };
    println!("{minutes} minutes, {link}, {} x {} pixels\n", soak.size_px[0], soak.size_px[1]);
    let before = process::resident_mib();
    let (mut calls, mut on, mut kept) = (Vec::new(), Vec::new(), Kept::new(&soak));
    let mut peak = before;
    let outcome = soak.run(|seen| {
        calls.push(seen.call_ms);
        on.push(seen.draw_ms);
        kept.look(&seen);
        if calls.len().is_multiple_of(64) {
            peak = peak.max(process::resident_mib());
        }
    })?;
    let after = process::resident_mib();
    tell(&outcome, &soak);
    println!("\nresident MiB: {before:.0} before, {peak:.0} at most, {after:.0} after\n");
    let (again, first) = kept.draw_again(&soak)?;
    println!("| milliseconds | 50 % | 90 % | 99 % | 99.9 % | most | over {STALL_MS} |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    row("set view, take plan", &calls);
    row("draw, streaming", &on);
    row("the same nodes, streaming", &first);
    row("the same nodes, no engine", &again);
    let more: Vec<_> = first.iter().zip(&again).map(|(on, off)| on - off).collect();
    row("by how much longer", &more);
    let stalls = calls.iter().filter(|&&ms| ms > STALL_MS).count();
    if stalls > 0 {
        return Err(format!("the caller stalled {stalls} times").into());
    }
    Ok(())
}

fn tell(outcome: &Outcome, soak: &Soak) {
    let totals = outcome.stats.since_start.totals;
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    println!(
        "{} frames, {} jumps, {} deaths of a host, {} times another dataset in its place",
        outcome.frames, outcome.teleports, outcome.deaths, outcome.replaced
    );
    println!(
        "{} requests ({} failed, {} broken off), {:.1} MB, of these {:.1} % in vain; {} pieces damaged",
        totals.requests,
        totals.retries,
        totals.cancelled,
        totals.bytes as f64 / 1e6,
        100.0 * totals.wasted_bytes() as f64 / totals.bytes.max(1) as f64,
        totals.damaged
    );
    println!(
        "decoded nodes: {:.0} MiB at most; in the end, looking away, {:.1} MiB of at most {:.1} MiB",
        mib(outcome.most_bytes),
        mib(outcome.cached_bytes),
        mib(outcome.cache_limit)
    );
    assert!(outcome.cached_bytes <= outcome.cache_limit, "more is kept than the limit");
    assert!(outcome.picture == outcome.expected, "another picture than after a cold start");
    assert_eq!((outcome.stats.queued, outcome.stats.in_flight), (0, 0), "something is left over");
    println!(
        "settled on the picture of a cold start: {} nodes of {} datasets",
        outcome.picture.len(),
        soak.clouds.len()
    );
}

fn row(name: &str, values: &[f64]) {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| match sorted.len() {
        0 => f64::NAN,
        len => sorted[((len - 1) as f64 * share).round() as usize],
    };
    let over = sorted.iter().filter(|&&ms| ms > STALL_MS).count();
    println!(
        "| {name} | {:.2} | {:.2} | {:.2} | {:.2} | {:.2} | {over} of {} |",
        at(0.5),
        at(0.9),
        at(0.99),
        at(0.999),
        at(1.0),
        sorted.len()
    );
}

/// A frame, without its points.
struct Kept {
    frames: Vec<Frame>,
    every: usize,
    seen: usize,
}

struct Frame {
    draw_ms: f64,
    clouds: Arc<[Arc<Manifest>]>,
    nodes: Vec<(usize, NodeKey, f32)>,
    settings: RenderSettings,
}

impl Kept {
    fn new(soak: &Soak) -> Self {
        // No more than the screen's 60 a second.
        let most = (60.0 * soak.length.as_secs_f64()) as usize;
        Self { frames: Vec::new(), every: (most / REPEATED).max(1), seen: 0 }
    }

    fn look(&mut self, seen: &Seen) {
        self.seen += 1;
        if self.seen.is_multiple_of(self.every) {
            let plan: &FramePlan = &seen.plan;
            let nodes = plan.nodes.iter().map(|node| (node.cloud, node.key, node.spacing));
            self.frames.push(Frame {
                draw_ms: seen.draw_ms,
                clouds: Arc::clone(&plan.clouds),
                nodes: nodes.collect(),
                settings: seen.settings,
            });
        }
    }

    /// Draws all of them; milliseconds now and then.
    fn draw_again(&self, soak: &Soak) -> Result<(Vec<f64>, Vec<f64>)> {
        let files = [&soak.clouds[0], &soak.clouds[1], &soak.other];
        let mut datasets =
            files.iter().map(|path| Version::open(path)).collect::<Result<Vec<_>>>()?;
        let (mut now, mut then) = (Vec::new(), Vec::new());
        for frame in &self.frames {
            let mut nodes = Vec::new();
            for &(cloud, key, spacing) in &frame.nodes {
                let manifest = &*frame.clouds[cloud];
                let of = datasets.iter_mut().find(|dataset| dataset.dataset.manifest() == manifest);
                let points = of.ok_or("a dataset that is not known")?.points(key)?;
                nodes.push(DrawNode { cloud, key, spacing, points, part: 0 });
            }
            let scene = Scene { clouds: &frame.clouds, nodes: &nodes };
            let begin = Instant::now();
            CpuRenderer.render(&scene, &frame.settings)?;
            now.push(begin.elapsed().as_secs_f64() * 1e3);
            then.push(frame.draw_ms);
        }
        Ok((now, then))
    }
}

/// A dataset in memory, as far as it was looked at.
struct Version {
    dataset: Dataset<FileSource>,
    nodes: HashMap<NodeKey, Node>,
    points: HashMap<NodeKey, Arc<NodePoints>>,
}

impl Version {
    fn open(path: &Path) -> Result<Self> {
        let dataset = Dataset::open(FileSource::open(path)?)?;
        let nodes = dataset.hierarchy()?.into_iter().map(|node| (node.key, node)).collect();
        Ok(Self { dataset, nodes, points: HashMap::new() })
    }

    fn points(&mut self, key: NodeKey) -> Result<Arc<NodePoints>> {
        if let Some(points) = self.points.get(&key) {
            return Ok(Arc::clone(points));
        }
        let node = self.nodes.get(&key).ok_or("a node that is not known")?;
        let points = Arc::new(self.dataset.read_node(node, &[])?);
        self.points.insert(key, Arc::clone(&points));
        Ok(points)
    }
}
