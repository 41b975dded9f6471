//! Hosts that misbehave: the engine ends settled on the same picture, or says why it cannot.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use lodestream_client::engine::{Coalesce, Engine, EngineConfig, EngineError};
use lodestream_protocol::{HEADER_BYTES, Header};
use tokio::sync::{Barrier, mpsc::unbounded_channel};

use crate::{
    common::{
        dataset::{Recipe, dataset},
        host::{Answer, Host, Request},
    },
    picture::{
        LONG, away, config, expected, failure, http_source, overview, picture, source_with_patience,
    },
};

/// Streams the dataset from a host with these manners; the picture must be that of the file.
fn settles_on_the_same_picture(manners: impl FnMut(Request) -> Answer + Send + 'static) -> Engine {
    settles_with_patience(LONG, manners)
}

fn settles_with_patience(
    patience: Duration,
    manners: impl FnMut(Request) -> Answer + Send + 'static,
) -> Engine {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let view = overview(recipe.corner);
    let expected = expected(&bytes, &config(), view);
    assert!(expected.len() > 50, "there is something to fetch");
    let host = Host::start(bytes, manners);
    let source = source_with_patience(&host, patience);
    let engine = Engine::start(vec![source], config()).expect("starts");
    engine.set_view(view);
    let plan = engine.wait_settled(LONG).expect("settles");
    assert_eq!(picture(&plan), expected);
    assert!(engine.stats().problems.is_empty(), "{:?}", engine.stats().problems);
    engine
}

#[test]
fn a_good_host() {
    let engine = settles_on_the_same_picture(|_| Answer::Good);
    assert_eq!(engine.stats().since_start.totals.retries, 0);
}

#[test]
fn every_third_request_fails() {
    let engine = settles_on_the_same_picture(|request| match request.number % 3 {
        2 => Answer::Status(500),
        _ => Answer::Good,
    });
    assert!(engine.stats().since_start.totals.retries > 0);
}

#[test]
fn bodies_are_cut_short() {
    settles_on_the_same_picture(|request| match request.number % 2 {
        0 => Answer::CutShort { share: 0.6 },
        _ => Answer::Good,
    });
}

#[test]
fn long_bodies_are_always_cut_short_but_what_came_is_kept() {
    let engine = settles_on_the_same_picture(|request| {
        let (start, end) = request.range.unwrap_or_default();
        if request.number > 0 && end - start > 8000 {
            Answer::CutShort { share: 8000.0 / (end - start) as f64 }
        } else {
            Answer::Good
        }
    });
    assert!(engine.stats().since_start.totals.retries > 0);
}

#[test]
fn connections_close_without_an_answer() {
    settles_on_the_same_picture(|request| match request.number % 4 {
        1 => Answer::Close,
        _ => Answer::Good,
    });
}

#[test]
fn answers_come_late_and_in_halves() {
    settles_on_the_same_picture(|_| Answer::Late(Duration::from_millis(15)));
}

#[test]
fn answers_hang_half_way() {
    let (reached, _reached) = unbounded_channel();
    settles_with_patience(Duration::from_millis(200), move |request| match request.number {
        0 | 3 | 5 => Answer::Hang { share: 0.5, reached: reached.clone() },
        _ => Answer::Good,
    });
}

#[test]
fn ranges_are_wrong_at_times() {
    settles_on_the_same_picture(|request| match request.number % 3 {
        0 => Answer::WrongRange,
        _ => Answer::Good,
    });
}

#[test]
fn bytes_are_damaged_at_times() {
    let engine = settles_on_the_same_picture(|request| match request.number {
        2 | 4 => Answer::Garbage,
        _ => Answer::Good,
    });
    assert!(engine.stats().since_start.totals.damaged > 0);
}

#[test]
fn a_host_that_knew_ranges_forgets_them_at_times() {
    settles_on_the_same_picture(|request| match request.number % 3 {
        1 => Answer::WholeFile,
        _ => Answer::Good,
    });
}

#[test]
fn a_host_killed_in_mid_stream_comes_back() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let views = [overview(recipe.corner), {
        let mut near = overview(recipe.corner);
        near.camera.eye = 0.5 * (near.camera.eye + near.camera.target);
        near
    }];
    let expected = expected(&bytes, &config(), views[0]);
    let (reached, mut hanging) = unbounded_channel();
    let mut host = Host::start(bytes, move |request| match request.number {
        0 => Answer::Good,
        _ => Answer::Hang { share: 0.5, reached: reached.clone() },
    });
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.set_view(views[0]);
    hanging.blocking_recv().expect("an answer has begun");
    host.stop();
    // While the host is away, the caller goes on: none of these waits for it.
    for round in 0..1000 {
        engine.set_view(views[round % 2]);
        assert!(!engine.plan().settled || engine.plan().points > 0);
    }
    assert!(matches!(
        engine.wait_settled(Duration::from_millis(1)),
        Err(EngineError::Timeout { .. })
    ));
    host.behave(|_| Answer::Good);
    host.restart();
    engine.set_view(views[0]);
    let plan = engine.wait_settled(LONG).expect("settles once the host is back");
    // The way here went through the other view, and nodes of the view before count more: look away
    // and back, so that the picture is that of this view alone.
    assert!(plan.points > 0);
    engine.set_view(away(views[0]));
    assert!(engine.wait_settled(LONG).expect("settles").nodes.is_empty(), "nothing to see there");
    engine.set_view(views[0]);
    let plan = engine.wait_settled(LONG).expect("settles");
    assert_eq!(picture(&plan), expected);
}

#[test]
fn requests_that_are_no_longer_wanted_are_broken_off_and_their_slots_are_free() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let view = overview(recipe.corner);
    let expected = expected(&bytes, &config(), view);
    let (reached, mut hanging) = unbounded_channel();
    let host = Host::start(bytes, move |request| match request.number {
        0 => Answer::Good,
        _ => Answer::Hang { share: 0.5, reached: reached.clone() },
    });
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.set_view(view);
    for _ in 0..config().requests_in_flight {
        hanging.blocking_recv().expect("an answer has begun");
    }
    engine.set_view(away(view));
    engine.wait_settled(LONG).expect("nothing is wanted there");
    while engine.stats().in_flight > 0 {
        std::thread::yield_now();
    }
    let cancelled = engine.stats().since_start.totals.cancelled;
    assert_eq!(cancelled, config().requests_in_flight as u64);
    // The first requests still hang: were their slots taken, nothing would come.
    host.behave(|_| Answer::Good);
    engine.set_view(view);
    assert_eq!(picture(&engine.wait_settled(LONG).expect("settles")), expected);
}

#[test]
fn a_host_that_is_not_there_yet_is_waited_for() {
    let recipe = Recipe::default();
    let mut host = Host::good(dataset(recipe));
    host.stop();
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    let message = loop {
        let waited = engine.wait_open(Duration::from_millis(50));
        let message = waited.expect_err("nobody there").to_string();
        // The first try may still find the port that is closing.
        if message.contains("no connection") {
            break message;
        }
    };
    assert!(message.contains("1 of 1 sources are not open; http"), "{message}");
    host.restart();
    engine.set_view(overview(recipe.corner));
    assert!(engine.wait_settled(LONG).expect("settles").points > 0);
}

#[test]
fn a_host_that_ignores_ranges_is_named_as_such() {
    let host = Host::start(dataset(Recipe::default()), |_| Answer::WholeFile);
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.set_view(overview([0.0; 3]));
    assert!(failure(&engine).contains("status 200"));
    assert_eq!(host.requests().len(), 1, "and is not asked again");
}

#[test]
fn a_dataset_that_is_not_there_is_an_error() {
    for (status, words) in [(404, "not found"), (403, "access denied")] {
        let host = Host::start(vec![0; 100], move |_| Answer::Status(status));
        let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
        let message = engine.wait_open(LONG).expect_err("failed").to_string();
        assert!(message.contains(words) && message.contains("dataset.lods"), "{message}");
    }
}

#[test]
fn what_is_no_dataset_is_an_error() {
    let mut cut = dataset(Recipe::default());
    cut.truncate(cut.len() - 10);
    for (bytes, words) in [(vec![7; 5000], "not a lodestream dataset"), (cut, "cut short")] {
        let host = Host::good(bytes);
        let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
        let message = engine.wait_open(LONG).expect_err("failed").to_string();
        assert!(message.contains(words), "{message}");
    }
}

#[test]
fn nodes_beyond_the_end_are_left_out_and_never_asked_for_and_the_rest_goes_on() {
    let recipe = Recipe::default();
    let mut bytes = dataset(recipe);
    let config = EngineConfig { point_budget: u64::MAX, ..config() };
    let whole = expected(&bytes, &config, overview(recipe.corner));
    // A header that says so, sound in itself: the last nodes lie behind what it tells.
    let mut header = Header::parse(&bytes).expect("a header");
    header.file_bytes -= 1000;
    bytes[..HEADER_BYTES].copy_from_slice(&header.encode());
    let end = header.file_bytes;
    bytes.truncate(end as usize);
    let host = Host::good(bytes);
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    let problems = engine.stats().problems;
    assert!(!problems.is_empty(), "told");
    assert!(
        problems.iter().all(|p| p.contains("beyond the end") && p.contains("left out")),
        "{problems:?}"
    );
    let found = picture(&plan);
    assert!(found.len() < whole.len() && found.len() * 2 > whole.len());
    assert!(found.iter().all(|(key, node)| whole.get(key) == Some(node)));
    let asked = host.requests();
    assert!(asked.iter().all(|r| r.range.is_none_or(|(from, _)| from < end)), "{asked:?}");
    // The prefix is asked for once: the cloud as a whole is sound.
    assert_eq!(asked.iter().filter(|r| r.range.is_some_and(|(from, _)| from == 0)).count(), 1);
}

#[test]
fn damaged_nodes_are_left_out_and_reported_and_the_rest_goes_on() {
    let recipe = Recipe::default();
    let mut bytes = dataset(recipe);
    let config = EngineConfig { point_budget: u64::MAX, ..config() };
    let whole = expected(&bytes, &config, overview(recipe.corner));
    // In the middle of group 0, away from the root page.
    let at = bytes.len() / 3;
    bytes[at] ^= 0xff;
    let host = Host::good(bytes);
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    let problems = engine.stats().problems;
    assert_eq!(problems.len(), 1, "{problems:?}");
    assert!(problems[0].contains("checksum") && problems[0].contains("left out"), "{problems:?}");
    assert_eq!(plan.left_out.failed.nodes, 1);
    let found = picture(&plan);
    assert_eq!(found.len() + 1, whole.len());
    assert!(found.iter().all(|(key, node)| whole.get(key) == Some(node)));
}

#[test]
fn dropping_the_engine_does_not_wait_for_a_hanging_host() {
    let (reached, mut hanging) = unbounded_channel();
    let host = Host::start(dataset(Recipe::default()), move |_| Answer::Hang {
        share: 0.1,
        reached: reached.clone(),
    });
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    hanging.blocking_recv().expect("a request is in flight");
    // Were the drop to wait for the request, or for those that would follow it, it would not return.
    drop(engine);
}

#[test]
fn a_host_that_falls_silent_keeps_no_other_from_its_share_of_requests() {
    let recipe = Recipe { page_levels: 8, ..Recipe::default() };
    let bytes = dataset(recipe);
    // Each request is small, and so many are wanted that one host's take all that may be in flight.
    let mut config = EngineConfig { paces: false, requests_in_flight: 5, ..config() };
    config.coalesce = Coalesce::NONE;
    config.point_budget *= 2;
    config.speculative_bytes = HEADER_BYTES as u64;
    // The header, and the rest of the index.
    let is_opening = |request: Request| request.number < 2;
    let (reached, mut hanging) = unbounded_channel();
    let silent = Host::start(bytes.clone(), move |request| match is_opening(request) {
        true => Answer::Good,
        false => Answer::Hang { share: 0.0, reached: reached.clone() },
    });
    // Of five for two hosts, each has three: the other answers none before three are there.
    let barrier = Arc::new(Barrier::new(3));
    let good = Host::start(bytes, move |request| match is_opening(request) {
        true => Answer::Good,
        false => Answer::Together(Arc::clone(&barrier)),
    });
    let engine = Engine::start(vec![http_source(&silent)], config).expect("starts");
    engine.set_view(overview(recipe.corner));
    for _ in 0..5 {
        hanging.blocking_recv().expect("all that may be in flight hang");
    }
    engine.add(http_source(&good));
    let end = Instant::now() + LONG;
    loop {
        let plan = engine.plan();
        let of_good = plan.nodes.iter().filter(|node| node.cloud == 1).count();
        let wanted = plan.left_out.loading.nodes as usize + plan.nodes.len();
        // Both have the same nodes, and both want the same of them. The last two may wait for a third.
        if of_good > 20 && 2 * (of_good + 2) >= wanted {
            assert_eq!(plan.nodes.len(), of_good, "the silent host sent none");
            assert_eq!(silent.requests().len(), 2 + 5, "it has had its share, and keeps it");
            return;
        }
        assert!(Instant::now() < end, "{of_good} nodes of {wanted}");
        std::thread::sleep(Duration::from_millis(5));
    }
}
