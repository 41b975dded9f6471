//! Leaving out what lies behind others changes no pixel: the real engine and the CPU renderer, from
//! random places in a house.

use std::{
    collections::HashMap,
    sync::{Arc, OnceLock},
    time::Duration,
};

use glam::DVec3;
use lodestream_client::{
    camera::{Camera, Projection},
    engine::{EngineConfig, FramePlan, SimulatedEngine, View},
    render::{CpuRenderer, Picture, RenderSettings, Scene, Splat, SplatSize},
    source::{FileSource, Link, Source},
};
use lodestream_preprocess::{BuildConfig, Method, Progress, build};
use lodestream_protocol::{Dataset, Manifest};
use proptest::prelude::*;

const SIZE_PX: [u32; 2] = [160, 120];

/// Pictures of a view, at most, until it is complete.
const MOST_PICTURES: u32 = 200;

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

struct House {
    folder: tempfile::TempDir,
    clouds: Vec<Arc<Manifest>>,
}

impl House {
    /// Many small nodes.
    fn get() -> &'static Self {
        static HOUSE: OnceLock<House> = OnceLock::new();
        HOUSE.get_or_init(|| {
            let folder = tempfile::tempdir().expect("temporary folder");
            let output = folder.path().join("house.lods");
            let config = BuildConfig {
                inputs: vec!["sim:courtyard?points=300k&seed=7".into()],
                output: output.clone(),
                method: Method::Poisson,
                grid: 16,
                memory_bytes: 1 << 30,
                threads: None,
                drop_attributes: Vec::new(),
                columns: None,
                scale: None,
                cells_per_spacing: lodestream_preprocess::CELLS_PER_SPACING,
                cancel: Default::default(),
            };
            build(&config, &Quiet).expect("built");
            let file = lodestream_preprocess::FileSource::open(&output).expect("opens");
            let manifest = Dataset::open(file).expect("a dataset").manifest().clone();
            Self { folder, clouds: vec![Arc::new(manifest)] }
        })
    }

    fn engine(&self, occlusion: bool) -> SimulatedEngine {
        let file = FileSource::open(self.folder.path().join("house.lods")).expect("opens");
        let link = Link::new("100mbit/20ms".parse().expect("a link"), 1);
        let config = EngineConfig {
            point_budget: u64::MAX,
            min_size_px: 8.0,
            occlusion,
            ..Default::default()
        };
        SimulatedEngine::start(vec![Source::linked(file, link)], config).expect("starts")
    }

    fn draw(&self, plan: &FramePlan, settings: &RenderSettings) -> Picture {
        let scene = Scene { clouds: &self.clouds, nodes: &plan.nodes };
        CpuRenderer.render(&scene, settings).expect("draws").picture
    }

    /// Draws and tells of every picture until the view is complete, as a window does.
    fn settle(
        &self,
        engine: &mut SimulatedEngine,
        settings: &RenderSettings,
    ) -> (Picture, Arc<FramePlan>) {
        engine.set_view(View { camera: settings.camera, size_px: settings.size_px });
        let reach = settings.splat_reach().expect("plain splats");
        let mut told = None;
        for _ in 0..MOST_PICTURES {
            let plan = engine.advance(Duration::from_millis(20));
            let picture = self.draw(&plan, settings);
            if plan.settled && told == Some(plan.sequence) {
                return (picture, plan);
            }
            let depth = picture.depth_pyramid().expect("as many depths as pixels");
            engine.set_depth(&plan, depth, reach);
            told = Some(plan.sequence);
        }
        panic!("{MOST_PICTURES} pictures, and no end");
    }
}

fn settings(
    eye: [f64; 3],
    target: [f64; 3],
    fov_y: f64,
    look: (Splat, SplatSize),
) -> RenderSettings {
    let projection = Projection::Perspective { fov_y };
    let camera = Camera { eye: eye.into(), target: target.into(), up: DVec3::Z, projection };
    let (splat, splat_size) = look;
    RenderSettings { splat, splat_size, ..RenderSettings::new(SIZE_PX, camera) }
}

fn looks() -> impl Strategy<Value = (Splat, SplatSize)> {
    let splats = prop_oneof![
        Just(Splat::Square),
        Just(Splat::Circle),
        Just(Splat::Cone),
        Just(Splat::Paraboloid)
    ];
    let sizes = prop_oneof![
        (2.0f32..12.0).prop_map(SplatSize::Pixels),
        (0.02..0.3).prop_map(SplatSize::World),
        (1.0..2.5).prop_map(SplatSize::Level),
        (1.0..2.5).prop_map(SplatSize::Adaptive),
    ];
    (splats, sizes)
}

fn place() -> impl Strategy<Value = [f64; 3]> {
    (0.0..25.0, -3.0..27.0, 0.3..6.0).prop_map(|(x, y, z)| [x, y, z])
}

/// Different pixels, and the distance of the pictures' settled plans in points.
fn compare(settings: &RenderSettings) -> (usize, [u64; 2]) {
    let house = House::get();
    let (all, unculled) = house.settle(&mut house.engine(false), settings);
    let (culled, plan) = house.settle(&mut house.engine(true), settings);
    assert_eq!(unculled.left_out.hidden.nodes, 0);
    let colors = all.rgba8.chunks(4).zip(culled.rgba8.chunks(4));
    let depths = all.depth.iter().zip(&culled.depth);
    let wrong = colors.zip(depths).filter(|((a, b), (c, d))| a != b || c.to_bits() != d.to_bits());
    (wrong.count(), [unculled.points, plan.points])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn what_is_hidden_is_missed_in_no_pixel(
        eye in place(), target in place(), fov_y in 0.4..1.6, look in looks(),
    ) {
        prop_assume!((DVec3::from(eye) - DVec3::from(target)).length() > 0.5);
        let (wrong, points) = compare(&settings(eye, target, fov_y, look));
        prop_assert_eq!(wrong, 0, "{:?}", points);
    }
}

/// Splats of the nodes above may be larger where a node is left out.
#[test]
fn the_bounds_of_a_node_hold_the_points_of_the_nodes_above_in_its_cube() {
    let house = House::get();
    let path = house.folder.path().join("house.lods");
    let file = lodestream_preprocess::FileSource::open(&path).expect("opens");
    let dataset = Dataset::open(file).expect("a dataset");
    let lattice = house.clouds[0].lattice;
    let nodes = dataset.hierarchy().expect("readable");
    let bounds: HashMap<_, _> = nodes.iter().map(|node| (node.key, node.bounds)).collect();
    let mut found = 0;
    for node in nodes.iter().filter(|node| !node.is_leaf()) {
        let corner = lattice.node_min(node.key);
        for q in dataset.read_node(node, &[0]).expect("readable").positions {
            let q: [u32; 3] = std::array::from_fn(|axis| corner[axis] + q[axis]);
            let mut below = node.key;
            loop {
                let bits = u32::from(lattice.node_bits(below.level())) - 1;
                let octant = (0..3).fold(0, |o, axis| o | ((q[axis] >> bits & 1) as u8) << axis);
                let Some(child) = below.child(octant).filter(|key| bounds.contains_key(key)) else {
                    break;
                };
                let tight = bounds[&child];
                let inside = (0..3).all(|a| tight.min[a] <= q[a] && q[a] <= tight.max[a]);
                assert!(inside, "{q:?} of {} beside {child}", node.key);
                (below, found) = (child, found + 1);
            }
        }
    }
    assert!(found > 1000, "{found}");
}

#[test]
fn behind_walls_much_is_left_out() {
    let sizes = [
        (SplatSize::Pixels(6.0), 0.8),
        (SplatSize::Level(1.6), 0.5),
        (SplatSize::Adaptive(1.6), 0.95),
    ];
    for (size, most) in sizes {
        let view = settings([11.0, 17.8, 1.8], [11.3, 23.5, 1.4], 1.3, (Splat::Circle, size));
        let (wrong, [all, culled]) = compare(&view);
        assert_eq!(wrong, 0);
        assert!((culled as f64) < most * all as f64, "{size:?}: {culled} of {all} points");
    }
}

#[test]
fn a_jump_back_brings_back_what_was_hidden() {
    let house = House::get();
    let look = (Splat::Circle, SplatSize::Pixels(6.0));
    let views = [
        settings([11.0, 17.8, 1.8], [11.3, 23.5, 1.4], 1.3, look),
        settings([9.3, 1.6, 1.8], [14.6, 13.0, 2.9], 1.2, look),
    ];
    let (mut with, mut without) = (house.engine(true), house.engine(false));
    for view in [0, 1, 0].map(|index: usize| &views[index]) {
        let (culled, _) = house.settle(&mut with, view);
        let (all, _) = house.settle(&mut without, view);
        assert!(culled == all, "from {:?}", view.camera.eye);
    }
}
