//! Positions and colours in two parts: cells and coarse colours first, and where in its cell each point lies and the last
//! bits of its colour for those who look closely.

use std::{path::PathBuf, time::Duration};

use glam::DVec3;
use lodestream_client::{
    camera::{Camera, Projection},
    engine::{DrawNode, EngineConfig, FramePlan, SimulatedEngine, View},
    source::{FileSource, Link, LinkSpec, Source},
};
use lodestream_preprocess::{
    BuildConfig, CELLS_PER_SPACING, FileSource as PositionedFile, Method, Progress, build,
};
use lodestream_protocol::{COARSE_COLOR_BITS, Dataset};

struct Silent;

impl Progress for Silent {
    fn phase(&self, _name: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _amount: u64) {}
    fn warn(&self, _line: &str) {}
}

/// A courtyard on a lattice of such steps, in world units.
fn scene_in_steps(scale: Option<f64>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("courtyard.lods");
    let config = BuildConfig {
        inputs: vec!["sim:courtyard?points=60k&seed=3".into()],
        output: output.clone(),
        method: Method::default(),
        grid: 32,
        memory_bytes: 256 << 20,
        threads: Some(1),
        drop_attributes: Vec::new(),
        columns: None,
        scale,
        cells_per_spacing: CELLS_PER_SPACING,
        cancel: Default::default(),
    };
    build(&config, &Silent).expect("built");
    (folder, output)
}

fn scene() -> (tempfile::TempDir, PathBuf) {
    scene_in_steps(None)
}

/// What a view shows while it comes in, and the bytes that it takes.
fn plans(path: &PathBuf, distance: f64, cell_px: f64) -> (Vec<std::sync::Arc<FramePlan>>, u64) {
    let link: LinkSpec = "20mbit/40ms".parse().expect("a link");
    let source = Source::linked(FileSource::open(path).expect("opens"), Link::new(link, 1));
    let config = EngineConfig { cell_px, min_size_px: 4.0, ..EngineConfig::default() };
    let mut engine = SimulatedEngine::start(vec![source], config).expect("starts");
    let dataset = Dataset::open(PositionedFile::open(path).expect("opens")).expect("a dataset");
    let (min, max) = dataset.manifest().bounds_world().expect("points");
    let target = 0.5 * (DVec3::from(min) + DVec3::from(max));
    let eye = target + distance * DVec3::new(0.3, -0.8, 0.5);
    let projection = Projection::Perspective { fov_y: 1.0 };
    let camera = Camera { eye, target, up: DVec3::Z, projection };
    engine.set_view(View { camera, size_px: [640, 480] });
    let mut plans = Vec::new();
    loop {
        let plan = engine.advance(Duration::from_millis(1));
        assert!(engine.stats().problems.is_empty(), "{:?}", engine.stats().problems);
        assert!(engine.time() < Duration::from_secs(60), "does not settle");
        let is_settled = plan.settled;
        plans.push(plan);
        if is_settled {
            return (plans, engine.stats().since_start.totals.bytes);
        }
    }
}

/// Red, green, blue of every point.
fn colors(node: &DrawNode) -> &[u8] {
    &node.points.columns[0].bytes
}

#[test]
fn from_afar_cells_are_enough_and_every_point_lies_in_its_own() {
    let (_folder, path) = scene();
    let (rough, rough_bytes) = plans(&path, 400.0, 0.5);
    let (exact, exact_bytes) = plans(&path, 400.0, 0.0);
    let (rough, exact) = (&rough.last().expect("plans").nodes, &exact.last().expect("plans").nodes);
    assert!(rough_bytes * 4 < exact_bytes * 3, "{rough_bytes} bytes, exactly {exact_bytes}");
    assert!(rough.len() > 1 && rough.len() == exact.len());
    for (rough, exact) in rough.iter().zip(exact) {
        assert_eq!((rough.key, exact.points.cell_bits), (exact.key, 0));
        let cell_bits = rough.points.cell_bits;
        assert!(cell_bits > 0, "the node {} was told exactly", rough.key);
        for (rough, exact) in rough.points.positions.iter().zip(&exact.points.positions) {
            assert_eq!(rough.map(|c| c >> cell_bits), exact.map(|c| c >> cell_bits));
        }
    }
    // Red and blue are told by their differences from green: half a step of each.
    const LOW_BITS: u32 = 8 - COARSE_COLOR_BITS as u32;
    let apart: Vec<u8> = rough
        .iter()
        .zip(exact)
        .flat_map(|(rough, exact)| colors(rough).iter().zip(colors(exact)))
        .map(|(rough, exact)| rough.abs_diff(*exact))
        .collect();
    let most = *apart.iter().max().expect("colours");
    assert!(most > 0 && u32::from(most) <= 1 << LOW_BITS, "colours are {most} apart");
}

#[test]
fn close_by_positions_become_exact_after_everything_is_there_roughly() {
    let (_folder, path) = scene();
    let dataset = Dataset::open(PositionedFile::open(&path).expect("opens")).expect("a dataset");
    let (plans, _) = plans(&path, 0.5, 0.25);
    let last = &plans.last().expect("plans").nodes;
    let nodes = dataset.hierarchy().expect("a tree");
    let mut refined = 0;
    for drawn in last.iter().filter(|drawn| drawn.points.cell_bits == 0) {
        let node = nodes.iter().find(|node| node.key == drawn.key).expect("in the tree");
        refined += usize::from(dataset.manifest().cell_bits(node.key.level(), node.spacing) > 0);
        let exact = dataset.read_node(node, &[]).expect("reads");
        assert_eq!(drawn.points.positions, exact.positions, "{}", node.key);
        assert_eq!(drawn.points.columns, exact.columns, "{}", node.key);
    }
    assert!(refined > 0, "something is close enough");
    let told_exactly = |plan: &FramePlan| {
        plan.nodes.iter().any(|drawn| {
            let node = nodes.iter().find(|node| node.key == drawn.key).expect("in the tree");
            let cell_bits = dataset.manifest().cell_bits(node.key.level(), node.spacing);
            drawn.points.cell_bits < cell_bits
        })
    };
    let first = plans.iter().find(|plan| told_exactly(plan)).expect("refined in the end");
    assert_eq!(first.nodes.len(), last.len(), "a node was refined before another one was there");
}

#[test]
fn close_by_colours_become_exact_where_positions_are_whole_from_the_start() {
    let (_folder, path) = scene_in_steps(Some(0.5));
    let dataset = Dataset::open(PositionedFile::open(&path).expect("opens")).expect("a dataset");
    let nodes = dataset.hierarchy().expect("a tree");
    let (plans, _) = plans(&path, 0.5, 0.25);
    let mut refined = 0;
    for drawn in &plans.last().expect("plans").nodes {
        let node = nodes.iter().find(|node| node.key == drawn.key).expect("in the tree");
        assert_eq!(dataset.manifest().cell_bits(node.key.level(), node.spacing), 0);
        let exact = dataset.read_node(node, &[]).expect("reads");
        assert_eq!(drawn.points.positions, exact.positions);
        let mut before = plans.iter().flat_map(|plan| &plan.nodes).filter(|n| n.key == drawn.key);
        let first = before.next().expect("drawn in the end");
        if first.points.columns != drawn.points.columns {
            assert_eq!(drawn.points.columns, exact.columns, "{}", drawn.key);
            refined += 1;
        }
    }
    assert!(refined > 0, "something is close enough");
}
