//! What is drawn while nodes are on their way, and what is fetched for it.

use lodestream_client::engine::{Engine, EngineConfig};
use lodestream_protocol::{BOOT_SPECULATIVE_BYTES, Refinement};

use crate::{
    common::{
        dataset::{Recipe, dataset, write},
        host::Host,
    },
    picture::{LONG, away, config, expected, file_source, http_source, overview, picture},
};

#[test]
fn the_first_answer_is_used_for_all_that_it_holds() {
    let recipe = Recipe { levels: 2, ..Recipe::default() };
    let bytes = dataset(recipe);
    assert!((bytes.len() as u64) < BOOT_SPECULATIVE_BYTES, "the whole file fits");
    let host = Host::good(bytes);
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.set_view(overview(recipe.corner));
    assert!(engine.wait_settled(LONG).expect("settles").points > 0);
    assert_eq!(host.requests().len(), 1);
    assert_eq!(engine.stats().since_start.totals.requests, 1);
}

#[test]
fn neighbours_share_requests_and_figures_match_the_host() {
    let recipe = Recipe { node_points: 2000, ..Recipe::default() };
    let host = Host::good(dataset(recipe));
    let config = EngineConfig { point_budget: 1_000_000, min_size_px: 1.0, ..Default::default() };
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    assert!(plan.nodes.len() > 500);
    let totals = engine.stats().since_start.totals;
    assert_eq!(totals.requests, host.requests().len() as u64);
    let asked: u64 =
        host.requests().iter().filter_map(|r| r.range).map(|(start, end)| end - start).sum();
    assert_eq!(totals.bytes, asked);
    assert!(totals.requests < 100, "{} requests for {}", totals.requests, plan.nodes.len());
}

#[test]
fn a_further_group_is_fetched_only_when_it_is_wanted() {
    let recipe = Recipe::default();
    let host = Host::good(dataset(recipe));
    // Nodes are worth their bytes: within a bound, others would be drawn.
    let config = EngineConfig { point_budget: u64::MAX, ..config() };
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plain = engine.wait_settled(LONG).expect("settles");
    assert!(plain.nodes.iter().all(|node| node.points.column(1).is_none()));
    let before = engine.stats().since_start.totals.bytes;

    engine.set_attributes(vec!["intensity".into()]);
    let full = engine.wait_settled(LONG).expect("settles");
    assert_eq!(full.points, plain.points);
    for node in &full.nodes {
        let column = node.points.column(1).expect("intensity is there");
        assert_eq!(column.bytes.len(), 2 * node.points.positions.len());
        assert!(node.points.column(0).is_some(), "what was there stays");
    }
    assert!(engine.stats().since_start.totals.bytes > before);
    assert!(engine.stats().since_view.totals.bytes < before, "group 0 is not fetched again");
}

#[test]
fn a_replacing_cloud_covers_everything_and_never_draws_a_node_with_its_stand_ins() {
    let recipe = Recipe { refinement: Refinement::Replace, ..Recipe::default() };
    let bytes = dataset(recipe);
    let (_folder, path) = write(&bytes);
    let engine = Engine::start(vec![file_source(&path)], config()).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    let picture = picture(&plan);
    assert!(picture.keys().any(|(_, key)| key.level() >= 2), "something was refined");
    let reference = lodestream_protocol::Dataset::open(bytes).expect("opens");
    for node in reference.hierarchy().expect("reads").iter().filter(|node| node.is_leaf()) {
        let above = (0..=node.key.level()).filter_map(|level| node.key.ancestor(level));
        let shown = above.filter(|&key| picture.contains_key(&(0, key))).count();
        assert_eq!(shown, 1, "exactly one node stands for {}", node.key);
    }
}

#[test]
fn clouds_share_one_budget_and_differ_in_nothing_from_clouds_alone() {
    let here = Recipe::default();
    let there = Recipe { seed: 5, corner: [500_100.0, 5_000_000.0, 100.0], ..here };
    let files = [here, there].map(|recipe| write(&dataset(recipe)));
    let plenty = EngineConfig { point_budget: u64::MAX, ..config() };
    let sources = || files.iter().map(|(_, path)| file_source(path)).collect();
    let view = overview(here.corner);
    let engine = Engine::start(sources(), plenty.clone()).expect("starts");
    engine.set_view(view);
    let both = engine.wait_settled(LONG).expect("settles");
    let first = picture(&both).into_iter().filter(|((cloud, _), _)| *cloud == 0).collect();
    assert_eq!(expected(&dataset(here), &plenty, view), first);

    let engine = Engine::start(sources(), EngineConfig { point_budget: 15_000, ..plenty });
    let engine = engine.expect("starts");
    engine.set_view(view);
    let plan = engine.wait_settled(LONG).expect("settles");
    assert!(plan.points <= 15_000 && plan.points > 14_000, "{}", plan.points);
    assert!(plan.left_out.over_budget.nodes > 0);
}

#[test]
fn nodes_that_come_into_view_again_are_taken_from_the_cache() {
    let recipe = Recipe::default();
    let host = Host::good(dataset(recipe));
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    let here = overview(recipe.corner);
    engine.set_view(here);
    let first = engine.wait_settled(LONG).expect("settles");
    engine.set_view(away(here));
    assert!(engine.wait_settled(LONG).expect("settles").nodes.is_empty());
    engine.set_view(here);
    let again = engine.wait_settled(LONG).expect("settles");
    assert_eq!(picture(&first), picture(&again));
    let since_view = engine.stats().since_view.totals;
    assert_eq!((since_view.requests, since_view.cache_hits), (0, first.nodes.len() as u64));
}
