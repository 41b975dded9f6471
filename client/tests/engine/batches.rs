//! Requests for many parts: of our server, and of hosts that turn out not to take them.

use std::{net::SocketAddr, sync::Arc};

use lodestream_client::{
    engine::{Engine, EngineConfig, Totals},
    source::{HttpSource, Source, Wire},
};
use lodestream_protocol::BatchPart;
use lodestream_server::{RunningServer, ServeConfig, spawn};

use crate::{
    common::{
        dataset::{Recipe, dataset},
        host::{Answer, Host},
    },
    picture::{LONG, Picture, config, expected, http_source, meter, overview, picture},
};

/// A tag, and an offer that comes with it.
const OFFER: &str =
    "\"000102030405060708090a0b0c0d0e0f\"\r\nLodestream-Batch: 1; parts=100; bytes=100000";

fn serve(bytes: &[u8]) -> (tempfile::TempDir, RunningServer, String) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join("a.lods"), bytes).expect("writable");
    let here = SocketAddr::from(([127, 0, 0, 1], 0));
    let server = spawn(ServeConfig::new(folder.path(), here)).expect("port 0 is free");
    let url = format!("{}/a.lods", server.url());
    (folder, server, url)
}

fn source(url: &str) -> Source {
    Source::Http(HttpSource::new(url.parse().expect("a URL")))
}

fn stream(source: Source, config: EngineConfig) -> (Picture, Totals) {
    let engine = Engine::start(vec![source], config).expect("starts");
    engine.set_view(overview(Recipe::default().corner));
    let plan = engine.wait_settled(LONG).expect("settles");
    (picture(&plan), engine.stats().since_start.totals)
}

#[test]
fn batches_bring_the_same_picture_with_fewer_bytes() {
    let bytes = dataset(Recipe::default());
    // Too few points for all nodes: those that are wanted lie apart.
    let mut ours = EngineConfig { attributes: vec![], point_budget: 15_000, ..config() };
    ours.coalesce.gap_bytes = 5_000;
    let expected = expected(&bytes, &ours, overview(Recipe::default().corner));
    let (_folder, _server, url) = serve(&bytes);
    let (with, fewer) = stream(source(&url), ours.clone());
    let (without, more) = stream(source(&url), EngineConfig { batches: false, ..ours });
    assert!(with == expected && without == expected);
    assert_eq!(fewer.retries, 0);
    // Nothing between the nodes comes along.
    assert!(fewer.bytes < more.bytes, "{} of {} bytes", fewer.bytes, more.bytes);
}

#[test]
fn a_host_that_bars_what_it_offered_is_asked_for_ranges() {
    let bytes = dataset(Recipe::default());
    let expected = expected(&bytes, &config(), overview(Recipe::default().corner));
    // The last says that the file was replaced, though it never is.
    for status in [405, 412] {
        let host = Host::start(bytes.clone(), move |request| match request.range {
            Some(_) => Answer::Tagged(OFFER),
            None => Answer::Status(status),
        });
        let (found, totals) = stream(http_source(&host), config());
        assert!(found == expected);
        assert_eq!(totals.retries, 0);
        let requests = host.requests();
        let batches = requests.iter().filter(|request| request.range.is_none()).count();
        // Those that are on their way together, at most.
        assert!((1..=config().requests_in_flight).contains(&batches), "{batches} batches");
        let openings = requests.iter().filter(|r| r.range.is_some_and(|(from, _)| from == 0));
        assert_eq!(openings.count(), 1, "{status}: it was opened anew");
    }
}

#[test]
fn parts_come_back_to_back_whether_batches_are_offered_or_not() {
    let bytes = dataset(Recipe::default());
    let (_folder, _server, url) = serve(&bytes);
    let host = Host::good(bytes.clone());
    let places = [(5_000, 300), (0, 64), (90, 1), (4_000, 3_000)];
    let parts = places.map(|(offset, bytes)| BatchPart { offset, bytes });
    let slices = places.map(|(offset, n)| &bytes[offset as usize..][..n as usize]);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.expect("a runtime");
    for (source, offers) in [(source(&url), true), (http_source(&host), false)] {
        runtime.block_on(source.read_prefix(100)).expect("a good host");
        assert_eq!(source.batch_limits().is_some(), offers);
        let mut found = Vec::new();
        let mut sink = |piece: bytes::Bytes| found.extend_from_slice(&piece);
        runtime.block_on(source.stream_parts(&parts, &mut sink)).expect("a good host");
        assert!(found == slices.concat());
    }
}

#[tokio::test]
async fn a_dataset_that_was_replaced_is_told_from_the_one_in_use_and_batches_go_on() {
    let (folder, _server, url) = serve(&dataset(Recipe::default()));
    let meter = meter();
    let wire = Wire { link: None, meter: Some(Arc::clone(&meter)) };
    let source = Source::by_wire(&url, wire).expect("a URL");
    source.read_prefix(100).await.expect("a good host");
    let other = dataset(Recipe { seed: 2, ..Recipe::default() });
    std::fs::write(folder.path().join("b"), &other).expect("writable");
    std::fs::rename(folder.path().join("b"), folder.path().join("a.lods")).expect("one folder");
    let parts = [BatchPart { offset: 0, bytes: 10 }, BatchPart { offset: 50, bytes: 10 }];
    let error = source.stream_parts(&parts, &mut |_| panic!("bytes")).await.expect_err("another");
    assert!(!error.is_transient() && error.to_string().contains("replaced"), "{error}");
    let renewed = source.renew().expect("an address");
    renewed.read_prefix(100).await.expect("a good host");
    let (asked, mut found) = (meter.requests(), Vec::new());
    let mut sink = |piece: bytes::Bytes| found.extend_from_slice(&piece);
    renewed.stream_parts(&parts, &mut sink).await.expect("a good host");
    assert!(found == [&other[..10], &other[50..60]].concat());
    assert_eq!(meter.requests() - asked, 1, "both by one request");
}
