//! Clouds that come and go, fail and come back, are replaced and hidden, while the engine runs.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use lodestream_client::{
    engine::{ClipBox, CloudStatus, Engine, EngineConfig, FramePlan, View},
    source::{HttpSource, Source},
};
use lodestream_protocol::Refinement;

use crate::{
    common::{
        dataset::{Recipe, dataset, write},
        host::{Answer, Host},
    },
    picture::{LONG, Picture, away, config, expected, file_source, http_source, overview, picture},
};

/// Two datasets in the same place.
fn recipes() -> [Recipe; 2] {
    [Recipe::default(), Recipe { seed: 2, refinement: Refinement::Replace, ..Recipe::default() }]
}

fn view() -> View {
    overview(Recipe::default().corner)
}

/// Waits until the clouds' state is as wanted.
fn wait_for(engine: &Engine, mut is_so: impl FnMut(&[CloudStatus]) -> bool) {
    let begin = std::time::Instant::now();
    while !is_so(&engine.clouds()) {
        assert!(begin.elapsed() < LONG, "{:?}", engine.clouds());
        std::thread::yield_now();
    }
}

/// The part of a picture that is of one cloud, as if that were the only one.
fn of_cloud(picture: &Picture, cloud: usize) -> Picture {
    let nodes = picture.iter().filter(|((number, _), _)| *number == cloud);
    nodes.map(|(&(_, key), &node)| ((0, key), node)).collect()
}

fn settle(engine: &Engine) -> Arc<FramePlan> {
    engine.wait_settled(LONG).expect("settles")
}

/// Nodes of the view before count more: looks away and back.
fn settle_afresh(engine: &Engine, view: View) -> Arc<FramePlan> {
    engine.set_view(away(view));
    settle(engine);
    engine.set_view(view);
    settle(engine)
}

#[test]
fn clouds_come_and_go_and_keep_their_numbers() {
    let config = EngineConfig { point_budget: u64::MAX, ..config() };
    let datasets = recipes().map(dataset);
    let files = datasets.each_ref().map(|bytes| write(bytes));
    let alone = datasets.each_ref().map(|bytes| expected(bytes, &config, view()));
    let engine = Engine::start(vec![], config).expect("starts");
    engine.set_view(view());
    assert!(settle(&engine).nodes.is_empty());

    assert_eq!(engine.add(file_source(&files[0].1)), 0);
    assert_eq!(engine.add(file_source(&files[1].1)), 1);
    let both = picture(&settle(&engine));
    assert_eq!(of_cloud(&both, 0), alone[0]);
    assert_eq!(of_cloud(&both, 1), alone[1]);

    engine.remove(0);
    let plan = settle(&engine);
    let left = picture(&plan);
    assert_eq!((of_cloud(&left, 1), left.len()), (alone[1].clone(), alone[1].len()));
    assert!(plan.clouds[0].points == 0 && plan.clouds[1].points > 0);
    assert!(engine.clouds()[0].removed && engine.clouds()[0].boot.is_none());
    let stats = engine.stats();
    let bytes: u64 = plan.nodes.iter().map(|n| 15 * n.points.positions.len() as u64).sum();
    assert!(
        stats.pinned_bytes + stats.cached_bytes <= 2 * bytes,
        "nothing is kept of what is gone: {stats:?}"
    );

    assert_eq!(engine.add(file_source(&files[0].1)), 2, "a number is never used again");
    let again = picture(&settle(&engine));
    assert_eq!((of_cloud(&again, 2), of_cloud(&again, 0).len()), (alone[0].clone(), 0));
    assert_eq!(engine.wait_open(LONG).expect("open").len(), 2);
}

#[test]
fn a_cloud_may_be_removed_while_its_host_hangs() {
    let (reached, mut hanging) = tokio::sync::mpsc::unbounded_channel();
    let bytes = dataset(Recipe::default());
    let host = Host::start(bytes.clone(), move |request| match request.number {
        0 => Answer::Good,
        _ => Answer::Hang { share: 0.5, reached: reached.clone() },
    });
    let (_folder, path) = write(&bytes);
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.set_view(view());
    hanging.blocking_recv().expect("a request is in flight");
    engine.add(file_source(&path));
    engine.remove(0);
    engine.remove(0);
    engine.remove(77);
    let picture = picture(&settle(&engine));
    assert_eq!(of_cloud(&picture, 1), expected(&bytes, &config(), view()));
    while engine.stats().in_flight > 0 {
        std::thread::yield_now();
    }
}

#[test]
fn a_hidden_cloud_takes_no_budget_and_loads_nothing() {
    let datasets = recipes().map(dataset);
    let host = Host::good(datasets[1].clone());
    let (_folder, path) = write(&datasets[0]);
    // Nothing but what opening needs comes by itself.
    let config = EngineConfig { point_budget: 20_000, speculative_bytes: 0, ..config() };
    let alone = expected(&datasets[0], &config, view());
    let sources = vec![file_source(&path), http_source(&host)];
    let engine = Engine::start(sources, config).expect("starts");
    engine.set_visible(1, false);
    engine.wait_open(LONG).expect("opens");
    let opened = host.requests().len();
    engine.set_view(view());
    let plan = settle(&engine);
    assert_eq!(picture(&plan), alone, "as if the other were not there");
    assert_eq!(host.requests().len(), opened);

    let shown = engine.set_visible(1, true);
    let plan = settle(&engine);
    assert!(plan.view_generation >= shown && plan.nodes.iter().any(|node| node.cloud == 1));
    assert!(plan.points <= 20_000);
    assert_eq!(engine.set_visible(1, true), shown, "no news");
    engine.set_visible(1, false);
    settle(&engine);
    assert_eq!(picture(&settle_afresh(&engine, view())), alone);
}

#[test]
fn budget_and_least_size_change_what_is_drawn_and_back() {
    let bytes = dataset(Recipe::default());
    let (_folder, path) = write(&bytes);
    let engine = Engine::start(vec![file_source(&path)], config()).expect("starts");
    engine.set_view(view());
    let whole = settle(&engine);
    for (budget, size) in [(5_000, 1.0), (60_000, 60.0), (60_000, 1.0)] {
        engine.set_budget(budget);
        engine.set_min_size_px(size);
        let fresh = EngineConfig { point_budget: budget, min_size_px: size, ..config() };
        let plan = settle(&engine);
        assert!(plan.points <= budget);
        assert_eq!(picture(&plan), expected(&bytes, &fresh, view()), "{budget} {size}");
    }
    assert_eq!(picture(&settle(&engine)), picture(&whole));
    assert_eq!(engine.stats().since_view.totals.bytes, 0, "it was all in the cache");
}

#[test]
fn a_smaller_cache_is_emptied_at_once() {
    let (_folder, path) = write(&dataset(Recipe::default()));
    let engine = Engine::start(vec![file_source(&path)], config()).expect("starts");
    engine.set_view(view());
    settle(&engine);
    engine.set_view(away(view()));
    assert!(settle(&engine).cached_bytes > 100_000);
    engine.set_cache_bytes(100_000);
    assert!(settle(&engine).cached_bytes <= 100_000);
    engine.set_cache_bytes(0);
    assert_eq!(settle(&engine).cached_bytes, 0);
}

#[test]
fn what_lies_outside_the_clip_box_is_neither_loaded_nor_drawn() {
    let recipe = Recipe::default();
    let bytes = dataset(recipe);
    let host = Host::good(bytes.clone());
    let config = EngineConfig { point_budget: u64::MAX, speculative_bytes: 0, ..config() };
    let whole = expected(&bytes, &config, view());
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    let min = glam::DVec3::from(recipe.corner);
    let clip = ClipBox { min, max: min + 20.0 };
    engine.set_clip(Some(clip));
    engine.set_view(view());
    let plan = settle(&engine);
    let clipped = picture(&plan);
    assert!(plan.left_out.clipped.nodes > 0 && !clipped.is_empty() && clipped.len() < whole.len());
    assert!(clipped.iter().all(|(id, node)| whole.get(id) == Some(node)));
    let lattice = plan.clouds[0].lattice;
    let is_inside = |q| clip.contains(lattice.world(q).into());
    for node in plan.nodes.iter().filter(|node| node.key.level() == 4) {
        let corner = lattice.node_min(node.key);
        let side = 1 << lattice.node_bits(node.key.level());
        assert!(
            is_inside(corner)
                || (0..3).any(|a| is_inside(std::array::from_fn(
                    |i| corner[i] + if i == a { side } else { 0 }
                ))),
            "{} is outside",
            node.key
        );
    }
    let asked: u64 = host.requests().iter().filter_map(|r| r.range).map(|(a, b)| b - a).sum();
    assert!(asked < bytes.len() as u64 / 2, "{asked} of {} bytes", bytes.len());
    engine.set_clip(None);
    assert_eq!(picture(&settle(&engine)), whole);
}

/// A host that has another dataset from the moment that it is told so.
struct Replacing {
    host: Host,
    is_new: Arc<AtomicBool>,
}

impl Replacing {
    fn start(old: Vec<u8>) -> Self {
        let is_new = Arc::new(AtomicBool::new(false));
        let new = Arc::clone(&is_new);
        let host = Host::start(old, move |_| match new.load(Ordering::Relaxed) {
            false => Answer::Good,
            true => Answer::Tagged("\"second\""),
        });
        Self { host, is_new }
    }

    fn replace(&self, new: Vec<u8>) {
        self.host.replace(new);
        self.is_new.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_dataset_that_is_replaced_is_opened_anew_and_no_two_versions_are_mixed() {
    let [old, new] = recipes().map(dataset);
    let (_folder, other) = write(&dataset(Recipe { seed: 3, ..Recipe::default() }));
    let config = EngineConfig { point_budget: u64::MAX, speculative_bytes: 0, ..config() };
    let expected = [&old, &new].map(|bytes| expected(bytes, &config, view()));
    let replacing = Replacing::start(old);
    let sources = vec![http_source(&replacing.host), file_source(&other)];
    let engine = Engine::start(sources, config).expect("starts");
    let boot = Arc::clone(&engine.wait_open(LONG).expect("opens")[0]);
    engine.set_view(view());
    settle(&engine);
    engine.set_visible(0, false);
    engine.set_cache_bytes(0);
    let beside = picture(&settle(&engine));
    replacing.replace(new);
    engine.set_visible(0, true);
    let mut sequence = 0;
    loop {
        let plan = engine.wait_plan(sequence, LONG).expect("a plan");
        sequence = plan.sequence;
        let picture = picture(&plan);
        assert_eq!(of_cloud(&picture, 1), of_cloud(&beside, 1), "the other is not disturbed");
        let found = of_cloud(&picture, 0);
        let is_old = *plan.clouds[0] == boot.manifest;
        if is_old {
            let expected = &expected[0];
            assert!(found.iter().all(|(id, node)| expected.get(id) == Some(node)));
        } else if plan.settled {
            assert_eq!(found, expected[1]);
            break;
        }
    }
    let status = &engine.clouds()[0];
    assert_eq!((status.replaced, &status.failure, &status.trouble), (1, &None, &None));
    assert!(!Arc::ptr_eq(status.boot.as_ref().expect("open"), &boot));
    assert_eq!(engine.clouds()[1].replaced, 0);
}

#[test]
fn a_host_that_names_the_same_dataset_anew_costs_nothing_that_is_loaded() {
    let bytes = dataset(Recipe::default());
    let config = EngineConfig { speculative_bytes: 0, ..config() };
    let expected = expected(&bytes, &config, view());
    let replacing = Replacing::start(bytes.clone());
    let engine = Engine::start(vec![http_source(&replacing.host)], config).expect("starts");
    let boot = Arc::clone(&engine.wait_open(LONG).expect("opens")[0]);
    replacing.replace(bytes);
    engine.set_view(view());
    assert_eq!(picture(&settle(&engine)), expected);
    let status = &engine.clouds()[0];
    assert!(Arc::ptr_eq(status.boot.as_ref().expect("open"), &boot) && status.replaced == 0);
}

#[test]
fn a_file_that_is_replaced_under_its_name_is_opened_anew() {
    let [old, new] = recipes().map(dataset);
    let config = EngineConfig { speculative_bytes: 0, ..config() };
    let expected = expected(&new, &config, view());
    let (folder, path) = write(&old);
    let engine = Engine::start(vec![file_source(&path)], config).expect("starts");
    engine.wait_open(LONG).expect("opens");
    let beside = folder.path().join("beside");
    std::fs::write(&beside, &new).expect("written");
    std::fs::rename(&beside, &path).expect("replaced");
    engine.set_view(view());
    wait_for(&engine, |clouds| clouds[0].replaced == 1);
    assert_eq!(picture(&settle(&engine)), expected);
    // In place, too.
    std::fs::write(&path, &old).expect("overwritten");
    engine.set_cache_bytes(0);
    settle_afresh(&engine, view());
    wait_for(&engine, |clouds| clouds[0].replaced == 2);
    settle(&engine);
}

#[test]
fn a_cloud_that_has_failed_is_tried_again_by_itself_and_the_others_go_on() {
    let bytes = dataset(Recipe::default());
    let host = Host::good(bytes.clone());
    let (_folder, path) = write(&bytes);
    let config = EngineConfig { speculative_bytes: 0, ..config() };
    let expected = expected(&bytes, &config, view());
    let engine = Engine::start(vec![http_source(&host)], config).expect("starts");
    engine.wait_open(LONG).expect("opens");
    host.behave(|_| Answer::Status(404));
    engine.set_view(view());
    wait_for(&engine, |clouds| clouds[0].failure.is_some());
    assert!(engine.clouds()[0].failure.as_ref().is_some_and(|f| f.contains("404")));
    engine.add(file_source(&path));
    wait_for(&engine, |clouds| clouds[1].boot.is_some());
    while !engine.plan().settled {
        std::thread::yield_now();
    }
    host.behave(|_| Answer::Good);
    wait_for(&engine, |clouds| clouds[0].failure.is_none());
    engine.remove(1);
    assert_eq!(picture(&settle(&engine)), expected);
}

#[test]
fn a_cloud_that_fails_while_its_first_bytes_come_is_tried_again_once_they_have_ended() {
    let bytes = dataset(Recipe::default());
    let expected = expected(&bytes, &config(), view());
    let (reached, mut hanging) = tokio::sync::mpsc::unbounded_channel();
    // Half of the first bytes hold the index: the cloud is open.
    let mut host = Host::start(bytes, move |request| match request.number {
        0 => Answer::Hang { share: 0.5, reached: reached.clone() },
        _ => Answer::Status(404),
    });
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    hanging.blocking_recv().expect("the first bytes come");
    engine.set_view(view());
    wait_for(&engine, |clouds| clouds[0].boot.is_some() && clouds[0].failure.is_some());
    host.behave(|_| Answer::Good);
    // They break off: nothing of the cloud is on its way any more.
    host.stop();
    host.restart();
    wait_for(&engine, |clouds| clouds[0].failure.is_none());
    assert_eq!(picture(&settle(&engine)), expected);
}

#[test]
fn a_cloud_that_could_never_be_opened_is_opened_when_that_is_asked_for() {
    let bytes = dataset(Recipe::default());
    let host = Host::start(bytes.clone(), |_| Answer::Status(404));
    let engine = Engine::start(vec![http_source(&host)], config()).expect("starts");
    engine.wait_open(LONG).expect_err("not there");
    engine.reopen(0);
    engine.reopen(99);
    while host.requests().len() < 2 {
        std::thread::yield_now();
    }
    host.behave(|_| Answer::Good);
    engine.reopen(0);
    wait_for(&engine, |clouds| clouds[0].boot.is_some() && clouds[0].failure.is_none());
    engine.set_view(view());
    assert_eq!(picture(&settle(&engine)), expected(&bytes, &config(), view()));
}

#[test]
fn hosts_without_entity_tags_are_known_by_dates() {
    let [old, new] = recipes().map(dataset);
    let host = Host::good(old);
    host.behave(|_| Answer::Dated("Mon, 01 Jan 2024 00:00:00 GMT"));
    let config = EngineConfig { speculative_bytes: 0, ..config() };
    let expected = expected(&new, &config, view());
    let source = Source::Http(HttpSource::new(host.url().parse().expect("a URL")));
    let engine = Engine::start(vec![source], config).expect("starts");
    engine.wait_open(LONG).expect("opens");
    host.replace(new);
    host.behave(|_| Answer::Dated("Tue, 02 Jan 2024 00:00:00 GMT"));
    engine.set_view(view());
    wait_for(&engine, |clouds| clouds[0].replaced == 1);
    assert_eq!(picture(&settle(&engine)), expected);
}
