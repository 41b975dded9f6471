//! One behaviour for all kinds of sources.

use lodestream_client::source::{BlockingSource, Source};
use lodestream_protocol::{Dataset, ReadAt};

use crate::{
    common::{
        dataset::{Recipe, dataset, write},
        host::{Answer, Host},
    },
    picture::file_source,
};

/// Runs `check` over the same bytes in a file and on a host.
fn for_all_kinds(bytes: &[u8], check: impl Fn(&str, Source)) {
    let (_folder, path) = write(bytes);
    check("file", file_source(&path));
    let host = Host::good(bytes.to_vec());
    check("http", Source::parse(&host.url()).expect("a URL"));
}

fn blocking(source: Source) -> BlockingSource {
    BlockingSource::new(source).expect("a thread")
}

fn numbered(len: usize) -> Vec<u8> {
    (0..len).map(|i| (i % 251) as u8).collect()
}

#[test]
fn ranges_are_delivered_exactly() {
    let bytes = numbered(300_000);
    for_all_kinds(&bytes, |kind, source| {
        let source = blocking(source);
        for (offset, len) in [(0, 1), (0, 300_000), (299_999, 1), (1234, 77_777), (5, 0)] {
            let found = source.read_range(offset, len).expect(kind);
            assert_eq!(found, bytes[offset as usize..][..len as usize], "{kind} {offset} {len}");
        }
        assert_eq!(source.size().expect(kind), 300_000);
        assert_eq!(source.read_at(7, 9).expect(kind), bytes[7..16]);
    });
}

#[test]
fn the_size_is_known_without_reading() {
    for_all_kinds(&numbered(1000), |kind, source| {
        assert_eq!(blocking(source).size().expect(kind), 1000);
    });
}

#[test]
fn a_prefix_ends_with_the_file() {
    let bytes = numbered(1000);
    for_all_kinds(&bytes, |kind, source| {
        let source = blocking(source);
        for (asked, got) in [(10, 10), (1000, 1000), (5000, 1000)] {
            let prefix = source.read_prefix(asked).expect(kind);
            assert_eq!(prefix.bytes, bytes[..got], "{kind}");
            assert_eq!(prefix.total, Some(1000), "{kind}");
        }
    });
}

#[test]
fn bytes_beyond_the_end_are_refused_for_good() {
    for_all_kinds(&numbered(1000), |kind, source| {
        let source = blocking(source);
        for (offset, len) in [(1000, 1), (5000, 10), (u64::MAX, 2)] {
            let error = source.read_range(offset, len).expect_err(kind);
            assert!(!error.is_transient(), "{kind}: {error}");
        }
    });
}

#[test]
fn nothing_is_reserved_for_bytes_that_are_not_there() {
    for_all_kinds(&numbered(1000), |kind, source| {
        blocking(source).read_range(0, 1 << 60).expect_err(kind);
    });
}

#[test]
fn an_empty_file_is_refused_by_every_reader() {
    for_all_kinds(&[], |kind, source| {
        let source = blocking(source);
        assert!(Dataset::open(source).is_err(), "{kind}");
    });
}

#[test]
fn a_whole_dataset_reads_the_same() {
    let bytes = dataset(Recipe::default());
    let reference = Dataset::open(bytes.clone()).expect("opens");
    let nodes = reference.hierarchy().expect("reads");
    for_all_kinds(&bytes, |kind, source| {
        let found = Dataset::open(blocking(source)).expect(kind);
        assert_eq!(found.hierarchy().expect(kind), nodes, "{kind}");
        for node in nodes.iter().step_by(nodes.len() / 10) {
            let points = found.read_node(node, &[1]).expect(kind);
            assert_eq!(points, reference.read_node(node, &[1]).expect("decodes"), "{kind}");
        }
    });
}

#[test]
fn a_source_is_described_by_what_the_user_named() {
    for_all_kinds(&numbered(10), |_, source| {
        assert!(source.describe().ends_with("dataset.lods"), "{}", source.describe());
    });
}

#[test]
fn blocking_reads_survive_passing_trouble() {
    let bytes = numbered(10_000);
    let host = Host::start(bytes.clone(), |request| match request.number {
        0 => Answer::Status(503),
        1 => Answer::CutShort { share: 0.5 },
        2 => Answer::Close,
        _ => Answer::Good,
    });
    let source = blocking(Source::parse(&host.url()).expect("a URL"));
    assert_eq!(source.read_range(10, 9000).expect("recovers"), bytes[10..9010]);
}

#[test]
fn a_host_that_ignores_ranges_is_refused_without_its_body() {
    // Far more than fits into the buffers of a connection: a client that read it all would be seen.
    let host = Host::start(numbered(64 << 20), |_| Answer::WholeFile);
    let source = blocking(Source::parse(&host.url()).expect("a URL"));
    let error = source.read_range(0, 1000).expect_err("refused");
    assert!(!error.is_transient());
    assert!(error.to_string().contains("whole file"), "{error}");
    assert_eq!(host.requests().len(), 1, "asked once only");
}

#[test]
fn statuses_say_whether_to_try_again() {
    for (status, transient) in [
        (401, false),
        (403, false),
        (404, false),
        (410, false),
        (416, false),
        (418, false),
        (408, true),
        (429, true),
        (500, true),
        (502, true),
        (503, true),
        (504, true),
    ] {
        let host = Host::start(numbered(1000), move |_| Answer::Status(status));
        let source = Source::parse(&host.url()).expect("a URL");
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let error = runtime.expect("a runtime").block_on(source.read_range(0, 10));
        let error = error.expect_err("no bytes");
        assert_eq!(error.is_transient(), transient, "{status}: {error}");
    }
}
