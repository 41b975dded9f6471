//! What comes first, and what is fetched in vain. (Fraiss 2017, figs. 3.2, 3.3)

use glam::DVec3;
use lodestream_client::{
    engine::{Coalesce, EngineConfig, Priority, Totals, View},
    path::{Extent, PathSpec},
};

use crate::{
    common::{
        arrival::{arrivals, correlations, jump, rank_correlation},
        dataset::{Recipe, dataset, write},
    },
    picture::{config, overview},
};

/// A view along x from before the cloud: nodes of many sizes.
fn along(corner: [f64; 3]) -> View {
    let mut view = overview(corner);
    let middle = DVec3::from(corner) + 32.5;
    (view.camera.eye, view.camera.target) = (middle - 50.0 * DVec3::X, middle);
    view
}

#[test]
fn ranks_are_compared_as_spearman_does() {
    let row = [1.0, 2.0, 3.0, 4.0, 5.0];
    assert!((rank_correlation(&row, &[2.0, 4.0, 4.5, 80.0, 90.0]) - 1.0).abs() < 1e-12);
    assert!((rank_correlation(&row, &[5.0, 4.0, 3.0, 2.0, 1.0]) + 1.0).abs() < 1e-12);
    // By hand: ranks 0, 1.5, 1.5, 3.5, 3.5 and 4, 0, 1, 2, 3.
    let found = rank_correlation(&[1.0, 2.0, 2.0, 3.0, 3.0], &[9.0, 1.0, 2.0, 3.0, 4.0]);
    assert!((found - 0.0).abs() < 0.2, "{found}");
}

#[test]
fn large_nodes_and_those_in_the_middle_arrive_first() {
    let recipe = Recipe { node_points: 2000, page_levels: 8, ..Recipe::default() };
    let (_folder, path) = write(&dataset(recipe));
    let link = "20mbit/40ms".parse().expect("a link");
    // Ours weighs bytes, too, which are random here.
    for (priority, least) in [(Priority::ErrorPerByte, 0.3), (Priority::Fraiss, 0.5)] {
        // A request for each, so that none rides along with its neighbours.
        let config = EngineConfig {
            point_budget: u64::MAX,
            priority,
            coalesce: Coalesce::NONE,
            speculative_bytes: 0,
            ..config()
        };
        let arrivals = arrivals(&path, config, link, along(recipe.corner));
        assert!(arrivals.len() > 200, "{} nodes", arrivals.len());
        let (size, offset) = correlations(&arrivals);
        assert!(size < -0.7, "{priority:?}: arrival and size {size}");
        assert!(offset > least, "{priority:?}: arrival and distance from the middle {offset}");
    }
}

#[test]
fn little_is_fetched_in_vain_when_the_view_jumps() {
    let recipe = Recipe { node_points: 3000, ..Recipe::default() };
    let (_folder, path) = write(&dataset(recipe));
    let extent = Extent::new(recipe.corner, recipe.corner.map(|c| c + 65.0)).expect("a box");
    for (link, seconds) in [("4mbit/100ms", 20), ("20mbit/40ms", 10), ("100mbit/20ms/1%", 4)] {
        let spec = PathSpec::parse(&format!("teleport?stops=10&seconds={seconds}&seed=2"));
        let jumps = spec.expect("a generator").path(&extent).expect("a path");
        let run = |cancels| {
            // Nothing is kept: whatever a place needs comes over the link.
            let base = EngineConfig { min_size_px: 2.0, cache_bytes: 0, ..Default::default() };
            let config = EngineConfig { cancels, ..base };
            jump(&path, config, link.parse().expect("a link"), &jumps)
        };
        let share = |totals: Totals| totals.wasted_bytes() as f64 / totals.bytes as f64;
        let (with, without) = (run(true), run(false));
        assert!(with.cancelled > 5, "{link}: {with:?}");
        assert!(share(with) < 0.1, "{link}: {:.3} of {} bytes", share(with), with.bytes);
        assert!(share(with) < share(without), "{link}: {} {}", share(with), share(without));
    }
}
