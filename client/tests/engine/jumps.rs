//! Random camera jumps: what must hold of every plan, and that each jump settles.

use std::{collections::HashSet, time::Duration};

use fastrand::Rng;
use glam::DVec3;
use lodestream_client::{
    camera::{Camera, Projection},
    engine::{Engine, EngineConfig, FramePlan, View},
};
use lodestream_protocol::{Boot, Dataset, NodeKey, Refinement};

use crate::{
    common::{
        dataset::{Recipe, dataset, write},
        host::{Answer, Host},
    },
    picture::{LONG, config, file_source, http_source, overview, picture},
};

/// What must hold of every plan, settled or not.
fn check(plan: &FramePlan, clouds: &[std::sync::Arc<Boot>], config: &EngineConfig) {
    let drawn: HashSet<(usize, NodeKey)> = picture(plan).into_keys().collect();
    let points: usize = plan.nodes.iter().map(|node| node.points.positions.len()).sum();
    assert_eq!(points as u64, plan.points);
    assert!(plan.points <= plan.points_wanted && plan.points_wanted <= config.point_budget);
    assert!(plan.cached_bytes <= config.cache_bytes, "{} bytes cached", plan.cached_bytes);
    for &(cloud, key) in &drawn {
        let mut ancestors = (0..key.level()).filter_map(|level| key.ancestor(level));
        match clouds[cloud].manifest.refinement {
            Refinement::Additive => {
                assert!(ancestors.all(|a| drawn.contains(&(cloud, a))), "{key} without ancestors");
            }
            Refinement::Replace => {
                assert!(!ancestors.any(|a| drawn.contains(&(cloud, a))), "{key} and an ancestor");
            }
        }
    }
}

fn random_view(rng: &mut Rng, corner: [f64; 3]) -> View {
    let mut within = |least: f64, most: f64| least + (most - least) * rng.f64();
    let mut place = |reach: f64| {
        let offset =
            DVec3::new(within(-reach, reach), within(-reach, reach), within(-reach, reach));
        DVec3::from(corner) + 32.0 + offset
    };
    let (target, near, far) = (place(32.0), place(40.0), place(300.0));
    let eye = if rng.bool() { near } else { far };
    let projection = if rng.u8(0..4) == 0 {
        Projection::Orthographic { height: 1.0 + 100.0 * rng.f64() }
    } else {
        Projection::Perspective { fov_y: 0.1 + 2.5 * rng.f64() }
    };
    let camera = Camera { eye, target, up: DVec3::Z, projection };
    View { camera, size_px: [rng.u32(1..2000), rng.u32(1..1500)] }
}

/// Jumps about, looking at plans all the while; every few jumps, waits until it settles.
fn jump_about(engine: &Engine, config: &EngineConfig, corner: [f64; 3], seed: u64, jumps: usize) {
    let clouds = engine.wait_open(LONG).expect("opens");
    let mut rng = Rng::with_seed(seed);
    for _ in 0..jumps {
        let generation = engine.set_view(random_view(&mut rng, corner));
        let mut sequence = 0;
        for _ in 0..rng.usize(0..6) {
            let Some(plan) = engine.wait_plan(sequence, Duration::from_millis(20)) else { break };
            assert!(plan.sequence > sequence && plan.view_generation <= generation);
            check(&plan, &clouds, config);
            sequence = plan.sequence;
        }
        if rng.u8(0..4) == 0 {
            let plan = engine.wait_settled(LONG).expect("settles");
            assert_eq!(plan.view_generation, generation);
            assert_eq!(plan.left_out.loading.nodes + plan.pages_loading, 0);
            check(&plan, &clouds, config);
        }
    }
}

fn two_clouds() -> [Recipe; 2] {
    let replacing = Recipe { seed: 2, refinement: Refinement::Replace, ..Recipe::default() };
    [Recipe::default(), replacing]
}

#[test]
fn jumps_over_files_with_a_small_cache_and_budget() {
    let recipes = two_clouds();
    let files: Vec<_> = recipes.iter().map(|&recipe| write(&dataset(recipe))).collect();
    for (seed, cache_bytes) in [(1, 0), (2, 100_000), (3, 512 << 20)] {
        let config = EngineConfig { cache_bytes, point_budget: 20_000, ..config() };
        let sources = files.iter().map(|(_, path)| file_source(path)).collect();
        let engine = Engine::start(sources, config.clone()).expect("starts");
        jump_about(&engine, &config, recipes[0].corner, seed, 60);
    }
}

#[test]
fn jumps_over_hosts_that_misbehave() {
    let recipes = two_clouds();
    let mut rng = Rng::with_seed(7);
    let hosts = recipes.map(|recipe| {
        let mut rng = Rng::with_seed(rng.u64(..));
        Host::start(dataset(recipe), move |_| match rng.u8(0..12) {
            0 => Answer::Status(503),
            1 => Answer::CutShort { share: rng.f64() },
            2 => Answer::Close,
            3 => Answer::WrongRange,
            4 => Answer::Late(Duration::from_millis(3)),
            _ => Answer::Good,
        })
    });
    let config = EngineConfig { cache_bytes: 200_000, point_budget: 30_000, ..config() };
    let sources = hosts.iter().map(http_source).collect();
    let engine = Engine::start(sources, config.clone()).expect("starts");
    jump_about(&engine, &config, recipes[0].corner, 8, 30);
}

#[test]
fn a_view_without_limits_shows_every_point_exactly() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let (_folder, path) = write(&bytes);
    let reference = Dataset::open(bytes).expect("opens");
    let config = EngineConfig {
        point_budget: u64::MAX,
        min_size_px: 0.0,
        attributes: vec!["color".into(), "intensity".into()],
        ..config()
    };
    let engine = Engine::start(vec![file_source(&path)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    assert_eq!(plan.points, reference.manifest().points);
    let nodes = reference.hierarchy().expect("reads");
    assert_eq!(plan.nodes.len(), nodes.len());
    for node in &nodes {
        let drawn = plan.nodes.iter().find(|drawn| drawn.key == node.key).expect("drawn");
        assert_eq!(*drawn.points, reference.read_node(node, &[1]).expect("decodes"));
    }
}

#[test]
fn the_same_view_again_is_no_news() {
    let recipe = Recipe::default();
    let (_folder, path) = write(&dataset(recipe));
    let engine = Engine::start(vec![file_source(&path)], config()).expect("starts");
    let generation = engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    assert_eq!(engine.set_view(overview(recipe.corner)), generation);
    assert!(engine.wait_plan(plan.sequence, Duration::from_millis(50)).is_none(), "all asleep");
}
