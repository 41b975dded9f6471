//! Engines as tasks: the same nodes as an engine with threads of its own, and nothing left behind.

use std::{collections::HashSet, iter::successors, sync::Arc};

use lodestream_client::{
    engine::{Commons, EngineConfig, FramePlan, MissingPage, Payloads, TaskedEngine, View},
    source::{HttpSource, Meter, Source, Timeouts, Wire},
};
use lodestream_protocol::Refinement;
use tokio::sync::mpsc::unbounded_channel;

use crate::{
    common::{
        dataset::{Recipe, dataset},
        host::{Answer, Host},
    },
    picture::{LONG, Picture, config, expected, meter, overview, picture},
};

fn runtime() -> tokio::runtime::Runtime {
    tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("threads")
}

fn counting() -> EngineConfig {
    EngineConfig { payloads: Payloads::Count, occlusion: false, ..config() }
}

fn metered(host: &Host, meter: &Arc<Meter>) -> Source {
    let timeouts = Timeouts { connect: LONG, silence: LONG };
    let wire = Wire { link: None, meter: Some(Arc::clone(meter)) };
    let url = host.url().parse().expect("a URL");
    Source::Http(HttpSource::by_wire(url, timeouts, wire))
}

async fn settle(engine: &mut TaskedEngine, view: View) -> Arc<FramePlan> {
    let generation = engine.set_view(view);
    loop {
        let plan = engine.next_plan().await;
        if plan.settled && plan.view_generation == generation {
            return plan;
        }
    }
}

/// Nodes and their points.
fn counts(picture: &Picture) -> Vec<(lodestream_protocol::NodeKey, usize)> {
    picture.iter().map(|(&(_, key), &(points, _))| (key, points)).collect()
}

#[test]
fn settles_on_what_an_engine_with_threads_settles_on() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let view = overview(recipe.corner);
    let expected = expected(&bytes, &config(), view);
    let host = Host::good(bytes);
    runtime().block_on(async {
        let commons = Arc::<Commons>::default();
        let meter = meter();
        for payloads in [Payloads::Decode, Payloads::Count] {
            let config = EngineConfig { payloads, ..counting() };
            let source = metered(&host, &meter);
            let mut engine = TaskedEngine::start(vec![source], config, Arc::clone(&commons));
            let plan = settle(&mut engine, view).await;
            if payloads == Payloads::Decode {
                assert_eq!(picture(&plan), expected);
            }
            let keys: Vec<_> = picture(&plan).into_keys().map(|(_, key)| key).collect();
            assert_eq!(keys, counts(&expected).iter().map(|(key, _)| *key).collect::<Vec<_>>());
            let points: usize = expected.values().map(|(points, _)| points).sum();
            assert_eq!(plan.points, points as u64, "points are counted, decoded or not");
            assert!(engine.wanted().all(|node| node.is_there && node.bytes > 0));
            assert_eq!(engine.stats().pinned_bytes, 15 * points as u64, "positions and colours");
        }
        assert_eq!(meter.requests() as usize, host.requests().len());
    });
}

#[test]
fn a_payload_that_is_only_counted_is_verified_all_the_same() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    // The third request's bytes are turned over, once: the engine asks again.
    let host = Host::start(bytes, |request| match request.number {
        3 => Answer::Garbage,
        _ => Answer::Good,
    });
    runtime().block_on(async {
        let source = metered(&host, &meter());
        let mut engine = TaskedEngine::start(vec![source], counting(), Arc::default());
        settle(&mut engine, overview(recipe.corner)).await;
        let totals = engine.stats().since_start.totals;
        assert!(totals.damaged > 0, "{totals:?}");
        assert!(engine.stats().problems.is_empty());
    });
}

#[test]
fn an_engine_that_is_dropped_breaks_its_requests_off() {
    let (reached, mut hangs) = unbounded_channel();
    let host = Host::start(dataset(Recipe::default()), move |request| match request.number {
        0 => Answer::Good,
        _ => Answer::Hang { share: 0.0, reached: reached.clone() },
    });
    runtime().block_on(async {
        let meter = meter();
        let source = metered(&host, &meter);
        let mut engine = TaskedEngine::start(vec![source], counting(), Arc::default());
        engine.set_view(overview(Recipe::default().corner));
        tokio::select! {
            _ = async { loop { engine.next_plan().await; } } => unreachable!("it goes on"),
            hang = hangs.recv() => hang.expect("a request hangs"),
        }
        assert!(meter.in_flight() > 0);
        drop(engine);
        while meter.in_flight() > 0 {
            tokio::task::yield_now().await;
        }
        let counted = meter.counted();
        assert!(counted.broken_off > 0 && counted.all_faults() == 0, "{counted:?}");
    });
}

#[test]
fn what_becomes_wanted_without_another_view_lies_below_a_page_that_was_missing() {
    for refinement in [Refinement::Additive, Refinement::Replace] {
        let recipe = Recipe { refinement, ..Recipe::default() };
        let host = Host::good(dataset(recipe));
        let beside = Host::good(dataset(Recipe { seed: 2, ..recipe }));
        // Pages come in several turns, and not with the header.
        let config = EngineConfig { speculative_bytes: 0, requests_in_flight: 1, ..counting() };
        runtime().block_on(async {
            let sources = [&host, &beside].map(|host| metered(host, &meter())).to_vec();
            let mut engine = TaskedEngine::start(sources, config, Arc::default());
            let whole = overview(recipe.corner);
            let mut near = whole;
            near.camera.eye = 0.5 * (near.camera.eye + near.camera.target);
            let (mut below_first, mut below_further) = (0, 0);
            for view in [whole, near] {
                let generation = engine.set_view(view);
                let mut before: Option<(HashSet<_>, HashSet<_>)> = None;
                loop {
                    let plan = engine.next_plan().await;
                    let pages: HashSet<_> = engine.missing_pages().collect();
                    let further = pages.iter().filter(|page| page.below.is_some()).count();
                    assert_eq!(further as u64, plan.pages_loading);
                    let wanted: HashSet<_> = engine.wanted().map(|n| (n.cloud, n.key)).collect();
                    if let Some((wanted_before, missing)) = &before {
                        for &(cloud, key) in wanted.difference(wanted_before) {
                            let is_missing =
                                |below| missing.contains(&MissingPage { cloud, below });
                            let mut above = successors(key.parent(), |key| key.parent());
                            let is_below = above.any(|key| is_missing(Some(key)));
                            assert!(is_below || is_missing(None), "{cloud} {key}");
                            below_further += u32::from(is_below);
                            below_first += u32::from(!is_below);
                        }
                    }
                    if plan.settled && plan.view_generation == generation {
                        break;
                    }
                    if plan.view_generation == generation {
                        before = Some((wanted, pages));
                    }
                }
            }
            assert!(below_first > 0 && below_further > 20, "{below_first} {below_further}");
        });
    }
}
