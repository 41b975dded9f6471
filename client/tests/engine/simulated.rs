//! The engine in simulated time, and the ways to fetch.

use std::{collections::BTreeSet, path::Path, time::Duration};

use glam::DVec3;
use lodestream_client::{
    engine::{EngineConfig, EngineStats, FramePlan, LoadOrder, Policy, SimulatedEngine, View},
    source::{FileSource, Link, LinkSpec, Source},
};
use lodestream_protocol::NodeKey;

use crate::{
    common::dataset::{Recipe, dataset, write},
    picture::{Picture, config, expected, overview, picture},
};

/// The timer's step.
const STEP: Duration = Duration::from_millis(1);

fn link(text: &str) -> LinkSpec {
    text.parse().expect(text)
}

fn engine(path: &Path, config: EngineConfig, link: LinkSpec, seed: u64) -> SimulatedEngine {
    let file = FileSource::open(path).expect("opens");
    SimulatedEngine::start(vec![Source::linked(file, Link::new(link, seed))], config)
        .expect("starts")
}

/// The figures of a run, without those of the machine's clock.
fn figures(engine: &SimulatedEngine) -> EngineStats {
    let mut stats = engine.stats();
    stats.since_start.totals.decode_ms = 0.0;
    stats.since_view.totals.decode_ms = 0.0;
    stats.since_start.totals.plan_ms = 0.0;
    stats.since_view.totals.plan_ms = 0.0;
    stats
}

/// Goes on until the view is complete; shows every moment to `look`.
fn settle(engine: &mut SimulatedEngine, mut look: impl FnMut(&SimulatedEngine, &FramePlan)) {
    let end = engine.time() + Duration::from_secs(600);
    loop {
        let plan = engine.advance(STEP);
        look(engine, &plan);
        if plan.settled {
            assert!(engine.stats().problems.is_empty(), "{:?}", engine.stats().problems);
            return;
        }
        assert!(engine.time() < end, "does not settle: {:?}", engine.stats());
    }
}

/// From beside the middle, along x: what is behind is not seen.
fn aside(corner: [f64; 3]) -> View {
    let mut view = overview(corner);
    let middle = DVec3::from(corner) + 32.5;
    (view.camera.eye, view.camera.target) = (middle, middle + DVec3::X);
    view
}

#[test]
fn settles_on_what_the_engine_in_real_time_settles_on() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let (_folder, path) = write(&bytes);
    for view in [overview(recipe.corner), aside(recipe.corner)] {
        let expected = expected(&bytes, &config(), view);
        assert!(expected.len() > 50, "there is something to fetch");
        let mut engine = engine(&path, config(), link("20mbit/40ms/1%"), 1);
        engine.set_view(view);
        settle(&mut engine, |_, _| {});
        assert_eq!(picture(&engine.plan()), expected);
    }
}

#[test]
fn two_runs_are_equal_in_every_plan_and_figure() {
    type Moment = (u64, Picture, String, EngineStats);
    let recipe = Recipe::default();
    let (_folder, path) = write(&dataset(recipe));
    let run = |policy: Policy, seed| {
        let config = policy.apply(EngineConfig { cache_bytes: 100_000, ..config() });
        let mut engine = engine(&path, config, link("20mbit/40ms/2%"), seed);
        let mut moments: Vec<Moment> = Vec::new();
        let mut look = |engine: &SimulatedEngine, plan: &FramePlan| {
            if moments.last().is_none_or(|last| last.0 != plan.sequence) {
                let tally = format!("{:?} {}", plan.left_out, plan.cached_bytes);
                moments.push((plan.sequence, picture(plan), tally, figures(engine)));
            }
        };
        engine.set_view(overview(recipe.corner));
        // Half of it, then somewhere else: requests are broken off.
        for _ in 0..150 {
            let plan = engine.advance(STEP);
            look(&engine, &plan);
        }
        engine.set_view(aside(recipe.corner));
        settle(&mut engine, look);
        moments
    };
    for policy in Policy::ALL {
        let moments = run(policy, 1);
        assert!(moments.len() > 20, "{} plans", moments.len());
        assert!(run(policy, 1) == moments, "{} differs", policy.name());
        assert!(run(policy, 2) != moments, "the seed loses other packets");
    }
}

/// Most requests in flight, requests sent, and payloads and pages that came with them.
fn requests(path: &Path, view: View, policy: Policy) -> (u64, u64, u64) {
    // Nothing finer than any policy wants.
    let config = EngineConfig { min_size_px: 30.0, ..config() };
    let mut engine = engine(path, policy.apply(config), link("20mbit/40ms"), 1);
    engine.set_view(view);
    let mut most = 0;
    settle(&mut engine, |engine, _| most = most.max(engine.stats().in_flight));
    let totals = engine.stats().since_start.totals;
    (most, totals.requests, totals.decoded_nodes)
}

#[test]
fn policies_send_as_many_requests_as_they_say() {
    let recipe = Recipe::default();
    let (_folder, path) = write(&dataset(recipe));
    let view = overview(recipe.corner);
    let of = |policy| requests(&path, view, policy);
    let (most, potree, pieces) = of(Policy::Potree);
    // The header, then the index; then a range for every piece.
    assert_eq!((most, potree), (4, pieces + 2));
    let (most, fraiss, pieces) = of(Policy::Fraiss);
    assert_eq!((most, fraiss), (1, pieces + 2));
    let (_, ours, _) = of(Policy::Ours);
    assert!(ours * 4 <= potree, "{ours} requests, potree {potree}");
}

fn nodes(plan: &FramePlan) -> impl Iterator<Item = (usize, NodeKey)> {
    plan.nodes.iter().map(|node| (node.cloud, node.key))
}

/// Whether, after a jump, what was wanted before all comes before what is wanted only now.
fn keeps_turns(order: LoadOrder) -> bool {
    // All nodes are known from the start, and all in the picture are wanted.
    let recipe = Recipe { page_levels: 8, ..Recipe::default() };
    let bytes = dataset(recipe);
    let (_folder, path) = write(&bytes);
    let base = EngineConfig { point_budget: u64::MAX, ..config() };
    let config = EngineConfig { order, ..Policy::Fraiss.apply(base) };
    let views = [aside(recipe.corner), overview(recipe.corner)];
    let [before, after] = views.map(|view| {
        let picture = expected(&bytes, &config, view);
        picture.into_keys().collect::<BTreeSet<_>>()
    });
    let both: BTreeSet<_> = before.intersection(&after).copied().collect();
    let mut engine = engine(&path, config, link("20mbit/4ms"), 1);
    engine.set_view(views[0]);
    let plan = engine.advance(Duration::from_millis(200));
    let drawn = nodes(&plan).filter(|node| both.contains(node)).count();
    assert!(0 < drawn && drawn < both.len() && both.len() < after.len(), "a jump in between");
    engine.set_view(views[1]);
    let (mut keeps, mut sequence) = (true, 0);
    settle(&mut engine, |_, plan| {
        if std::mem::replace(&mut sequence, plan.sequence) != plan.sequence {
            let has_new = nodes(plan).any(|node| !before.contains(&node));
            keeps &=
                !has_new || nodes(plan).filter(|node| both.contains(node)).count() == both.len();
        }
    });
    keeps
}

#[test]
fn a_queue_loads_first_what_was_wanted_first() {
    assert!(keeps_turns(LoadOrder::Arrival));
    assert!(!keeps_turns(LoadOrder::Importance), "the test tells them apart");
}

#[test]
fn nothing_is_settled_before_the_link_can_have_carried_it() {
    let recipe = Recipe::default();
    let (_folder, path) = write(&dataset(recipe));
    for text in ["20mbit/40ms", "4mbit/100ms/1%", "100mbit/0ms", "0.5mbit/3ms"] {
        let link = link(text);
        for policy in Policy::ALL {
            let mut engine = engine(&path, policy.apply(config()), link, 1);
            engine.set_view(overview(recipe.corner));
            settle(&mut engine, |_, _| {});
            let phase = engine.stats().since_view;
            let least = (link.bound(phase.totals.bytes) - STEP).as_secs_f64() * 1e3;
            let settled = phase.settled_ms.expect("settled");
            let name = policy.name();
            assert!(settled >= least, "{text}, {name}: {settled} ms, less than {least} ms");
            assert!(phase.first_points_ms < Some(settled), "points come before the end");
        }
    }
}

#[test]
fn the_top_is_drawn_while_the_first_answer_is_still_on_its_way() {
    let recipe = Recipe { node_points: 3000, ..Recipe::default() };
    let bytes = dataset(recipe);
    let (_folder, path) = write(&bytes);
    let config = config();
    let answer = config.speculative_bytes.min(bytes.len() as u64);
    let mut engine = engine(&path, config, link("1mbit/20ms"), 1);
    engine.set_view(overview(recipe.corner));
    let mut first = None;
    settle(&mut engine, |engine, plan| {
        if plan.points > 0 {
            first.get_or_insert_with(|| engine.stats().since_start.totals.bytes);
        }
    });
    let first = first.expect("something is drawn");
    assert!(first < answer / 2, "drawn after {first} of {answer} bytes");
}
