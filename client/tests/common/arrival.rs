//! In which order the nodes of a picture arrive, and what is fetched in vain when the view jumps: recorded
//! in simulated time, so that every run is the same.

use std::{collections::BTreeMap, path::Path, time::Duration};

use glam::DVec3;
use lodestream_client::{
    camera::Projection,
    engine::{EngineConfig, FramePlan, SimulatedEngine, Totals, View},
    path::CameraPath,
    source::{FileSource, Link, LinkSpec, Source},
};
use lodestream_protocol::NodeKey;

/// Between looks at the plan.
const STEP: Duration = Duration::from_millis(2);

/// Of pictures along paths.
const SIZE_PX: [u32; 2] = [960, 540];

/// The last wait, in simulated time.
const PATIENCE: Duration = Duration::from_secs(600);

/// A node of a complete picture.
#[derive(Debug, Clone, Copy)]
pub struct Arrival {
    /// When it was first drawn: milliseconds after the view was set.
    pub at_ms: f64,
    pub level: u8,
    /// Radius in pixels at which the sphere around its cube appears. (Fraiss 2017, eq. 3.2)
    pub size_px: f64,
    /// Distance of its cube's middle from the picture's, in halves of the picture's height.
    pub offset: f64,
}

fn start(dataset: &Path, config: EngineConfig, link: LinkSpec) -> SimulatedEngine {
    let file = FileSource::open(dataset).expect("opens");
    let source = Source::linked(file, Link::new(link, 1));
    SimulatedEngine::start(vec![source], config).expect("starts")
}

/// The nodes that a view settles on from a cold start, in the order of their arrival.
pub fn arrivals(dataset: &Path, config: EngineConfig, link: LinkSpec, view: View) -> Vec<Arrival> {
    let mut engine = start(dataset, config, link);
    engine.set_view(view);
    let mut first = BTreeMap::new();
    let plan = loop {
        let plan = engine.advance(STEP);
        let now = engine.time().as_secs_f64() * 1e3;
        plan.nodes.iter().for_each(|node| _ = first.entry(node.key).or_insert(now));
        if plan.settled {
            break plan;
        }
        assert!(engine.time() < PATIENCE, "does not settle");
    };
    let mut arrivals: Vec<_> =
        plan.nodes.iter().map(|node| arrival(&plan, &view, node.key, first[&node.key])).collect();
    arrivals.sort_by(|a, b| a.at_ms.total_cmp(&b.at_ms));
    arrivals
}

fn arrival(plan: &FramePlan, view: &View, key: NodeKey, at_ms: f64) -> Arrival {
    let lattice = &plan.clouds[0].lattice;
    let side = lattice.node_side_world(key.level());
    let middle = DVec3::from(lattice.world(lattice.node_min(key))) + 0.5 * side;
    let basis = view.camera.basis();
    let to = middle - view.camera.eye;
    let Projection::Perspective { fov_y } = view.camera.projection else {
        panic!("a perspective view");
    };
    let slope = (0.5 * fov_y).tan();
    let depth = to.dot(basis.forward).max(1e-9);
    let offset = DVec3::new(to.dot(basis.right), to.dot(basis.up), 0.0).length() / (depth * slope);
    let radius = 0.5 * 3_f64.sqrt() * side;
    let size_px = 0.5 * f64::from(view.size_px[1]) * radius / (slope * to.length());
    Arrival { at_ms, level: key.level(), size_px, offset }
}

/// Spearman's rank correlation of two rows of numbers: 1 where the one rises with the other, -1 where it
/// falls; ties share their mean rank.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> f64 {
    let [a, b] = [a, b].map(ranks);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(&a), mean(&b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter().zip(&b).map(|(x, y)| f(x - mean_a, y - mean_b)).sum()
    };
    sum(&|x, y| x * y) / (sum(&|x, _| x * x) * sum(&|_, y| y * y)).sqrt()
}

fn ranks(values: &[f64]) -> Vec<f64> {
    let mut order: Vec<_> = (0..values.len()).collect();
    order.sort_by(|&i, &j| values[i].total_cmp(&values[j]));
    let mut ranks = vec![0.0; values.len()];
    for tied in order.chunk_by(|&i, &j| values[i] == values[j]) {
        let first = order.iter().position(|i| i == &tied[0]).expect("one of them");
        let mean = first as f64 + 0.5 * (tied.len() - 1) as f64;
        tied.iter().for_each(|&i| ranks[i] = mean);
    }
    ranks
}

/// How arrival goes with size; and how it goes with the distance from the middle among nodes of a level and
/// a size: rank correlation, and partial rank correlation, which takes out what both have from the size,
/// as the mean over levels, weighted by their nodes. (What is near is large, and out of the middle.)
pub fn correlations(arrivals: &[Arrival]) -> (f64, f64) {
    let row = |of: &[Arrival], f: fn(&Arrival) -> f64| of.iter().map(f).collect::<Vec<_>>();
    let ranked = |of: &[Arrival], f, g| rank_correlation(&row(of, f), &row(of, g));
    let size = ranked(arrivals, |a| a.at_ms, |a| a.size_px);
    let mut levels: BTreeMap<u8, Vec<Arrival>> = BTreeMap::new();
    arrivals.iter().for_each(|a| levels.entry(a.level).or_default().push(*a));
    let (mut sum, mut weight) = (0.0, 0.0);
    for of in levels.values() {
        let at_size = ranked(of, |a| a.at_ms, |a| a.size_px);
        let at_offset = ranked(of, |a| a.at_ms, |a| a.offset);
        let size_offset = ranked(of, |a| a.size_px, |a| a.offset);
        let rest = (1.0 - at_size * at_size) * (1.0 - size_offset * size_offset);
        let partial = (at_offset - at_size * size_offset) / rest.sqrt();
        // A level of few nodes, or one that came at once, tells nothing.
        if of.len() >= 16 && partial.is_finite() {
            sum += partial * of.len() as f64;
            weight += of.len() as f64;
        }
    }
    (size, sum / weight)
}

/// Goes along a path that jumps; returns the figures.
pub fn jump(dataset: &Path, config: EngineConfig, link: LinkSpec, path: &CameraPath) -> Totals {
    let mut engine = start(dataset, config, link);
    let size_px = SIZE_PX;
    let end = Duration::from_secs_f64(path.duration());
    while engine.time() < end {
        let camera = path.at(path.start() + engine.time().as_secs_f64());
        engine.set_view(View { camera, size_px });
        engine.advance(STEP);
    }
    engine.stats().since_start.totals
}
