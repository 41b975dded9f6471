//! Datasets of an object store that fails, and recovers.

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    process::{Command, Stdio},
    time::Duration,
};

use crate::{
    store::{Asked, Mood, Store},
    support::{Site, ask, dataset},
};

const RANGE: &str = "range: bytes=0-9\r\n";
/// With a field that the short way does not know.
const LONG_WAY: &str = "range: bytes=0-9\r\nx-other: 1\r\n";

fn status(answer: &(Vec<String>, Vec<u8>)) -> &str {
    let line = answer.0.iter().find(|line| line.starts_with("HTTP/1.1 ")).expect("a status");
    &line["HTTP/1.1 ".len()..][..3]
}

fn connect(site: &Site) -> TcpStream {
    TcpStream::connect(site.server.addr()).expect("the server accepts")
}

/// Waits until the figures hold a line.
fn wait_for_figure(site: &Site, line: &str) {
    let figures = || String::from_utf8(ask(&mut connect(site), "/metrics", "").1).expect("text");
    while !figures().contains(line) {
        std::thread::yield_now();
    }
}

#[test]
fn a_failure_of_the_store_is_told_once_and_only_to_the_log() {
    let store = Store::new(&[("a.lods", &dataset(1, 1000))]);
    store.set(Mood::Refusing);
    let mut program = Command::new(env!("CARGO_BIN_EXE_lodestream-server"))
        .args(["serve", "s3://bucket/scans", "--listen", "127.0.0.1:0"])
        .envs(store.options())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program is there");
    let mut url = String::new();
    let stdout = program.stdout.take().expect("piped");
    BufReader::new(stdout).read_line(&mut url).expect("an address");
    let addr = url.trim().strip_prefix("http://").expect("an address");
    let mut stream = TcpStream::connect(addr).expect("the server accepts");
    let mut told = String::new();
    for (path, fields) in [("/a.lods", RANGE), ("/a.lods", LONG_WAY), ("/datasets", "")] {
        let (_, body) = ask(&mut stream, path, fields);
        told += &String::from_utf8(body).expect("text");
    }
    assert_eq!(told.matches("the object store does not answer as it should").count(), 3, "{told}");
    assert!(!told.contains("bucket") && !told.contains("AccessDenied"), "{told}");
    assert_eq!(store.asked().len(), 3, "each asks once: {:?}", store.asked());
    program.kill().expect("it runs");
    let mut log = String::new();
    program.stderr.take().expect("piped").read_to_string(&mut log).expect("text");
    program.wait().expect("it has ended");
    let lines: Vec<_> = log.lines().filter(|line| line.contains("a.lods")).collect();
    assert!(lines.len() == 3 && lines.iter().all(|l| l.contains("AccessDenied")), "{log}");
}

#[test]
fn what_the_store_says_of_a_part_is_not_in_the_list() {
    let store = Store::new(&[("a.lods", &dataset(1, 1000))]);
    store.set(Mood::RefusingParts);
    let site = Site::configured(|config| {
        config.data = store.place();
        // Not even the block that came with the first look is kept.
        config.cache_bytes = 0;
    });
    let (_, body) = ask(&mut connect(&site), "/datasets", "");
    let list = String::from_utf8(body).expect("text");
    assert!(list.contains("the object store does not give them"), "{list}");
    assert!(!list.contains("bucket") && !list.contains("AccessDenied"), "{list}");
}

#[test]
fn a_picture_that_the_store_does_not_tell_of_is_not_said_to_be_missing() {
    let store = Store::new(&[("a.lods", &dataset(1, 1000))]);
    let site = Site::configured(|config| config.data = store.place());
    let mut stream = connect(&site);
    let path = "/datasets/a.lods/preview.png";
    assert_eq!(status(&ask(&mut stream, path, "")), "404");
    store.set(Mood::Refusing);
    assert_eq!(status(&ask(&mut stream, path, "")), "503");
}

#[test]
fn a_store_that_is_silent_is_waited_for_once() {
    let bytes = dataset(1, 1000);
    let store = Store::new(&[("a.lods", &bytes)]);
    let site = Site::configured(|config| {
        config.data = store.place();
        config.response_timeout = Duration::from_secs(1);
    });
    store.set(Mood::Silent);
    let mut stream = connect(&site);
    let quick = ask(&mut stream, "/a.lods", RANGE);
    assert_eq!(status(&quick), "504");
    assert_eq!(store.asked().len(), 1);
    // The connection is none the worse for it, however long the store takes on a busy machine.
    store.set(Mood::Good);
    let mut again = ask(&mut stream, "/a.lods", RANGE);
    while status(&again) == "504" {
        again = ask(&mut stream, "/a.lods", RANGE);
    }
    assert_eq!(again.1, bytes[..10]);
}

#[test]
fn both_ways_refuse_alike() {
    let (long, short) = (Duration::from_secs(30), Duration::from_secs(1));
    for (mood, patience, expected) in [(Mood::Refusing, long, "503"), (Mood::Silent, short, "504")]
    {
        let store = Store::new(&[("a.lods", &dataset(1, 1000))]);
        let site = Site::configured(|config| {
            config.data = store.place();
            config.response_timeout = patience;
        });
        store.set(mood);
        let quick = ask(&mut connect(&site), "/a.lods", RANGE);
        assert_eq!(status(&quick), expected);
        assert_eq!(quick, ask(&mut connect(&site), "/a.lods", LONG_WAY));
        let counted = format!("dataset=\"\",kind=\"file\",status=\"{expected}\"}} 2");
        // An answer counts once it is sent.
        wait_for_figure(&site, &counted);
    }
}

#[test]
fn the_list_is_made_to_its_end_though_nobody_waits_for_it() {
    let store = Store::new(&[("a.lods", &dataset(1, 1000))]);
    let site = Site::configured(|config| config.data = store.place());
    store.set(Mood::Silent);
    let mut first = connect(&site);
    first.write_all(b"GET /datasets HTTP/1.1\r\nhost: x\r\n\r\n").expect("the server reads");
    store.wait_for(1);
    drop(first);
    wait_for_figure(&site, "kind=\"index\",status=\"499\"} 1");
    store.set(Mood::Good);
    let (_, list) = ask(&mut connect(&site), "/datasets", "");
    let list: serde_json::Value = serde_json::from_slice(&list).expect("JSON");
    assert_eq!(list["datasets"][0]["name"], "a", "{list}");
    assert_eq!(store.asked().len(), 1, "what was found for the first is for the second as well");
}

#[test]
fn what_is_kept_of_an_object_outlives_a_failure_of_the_store() {
    let bytes = dataset(1, 1 << 20);
    let store = Store::new(&[("a.lods", &bytes)]);
    let site = Site::configured(|config| config.data = store.place());
    let mut stream = connect(&site);
    // Not of the first block, which comes with every look at an object that is new.
    let range = "range: bytes=500000-500009\r\n";
    let mut read = || ask(&mut stream, "/a.lods", range);
    assert_eq!(read().1, bytes[500_000..500_010]);
    store.set(Mood::Refusing);
    // Until the object is to be looked at again.
    while status(&read()) == "206" {
        std::thread::sleep(Duration::from_millis(20));
    }
    store.set(Mood::Good);
    assert_eq!(read().1, bytes[500_000..500_010]);
    let part = Asked { name: "a.lods".into(), is_part: true };
    let parts = store.asked().iter().filter(|asked| **asked == part).count();
    assert_eq!(parts, 1, "the block is still there");
}
