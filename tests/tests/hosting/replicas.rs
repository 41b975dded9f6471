//! Servers without a disk, over one bucket.

use std::{
    fs,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    time::Duration,
};

use lodestream_client::source::{BlockingSource, Source};
use reqwest::Client;

use crate::{nginx::Nginx, process::Process, s3::S3, server};

fn replica(s3: &S3, arguments: &[&str]) -> (Process, String) {
    let all = ["serve", "s3://bucket/scans", "--listen", "127.0.0.1:0"];
    let mut command = server::command(&[&all[..], arguments].concat());
    command.envs(s3.variables());
    Process::start(command, false, |line| Some(line.to_owned()))
}

fn built(points: &str, seed: u8) -> (Vec<u8>, Vec<u8>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.lods");
    server::build(&path, points, seed);
    let read = |name: &str| fs::read(folder.path().join(name)).expect("built");
    (read("a.lods"), read("a.preview.png"))
}

async fn text(url: String) -> (u16, String) {
    let response = Client::new().get(url).send().await.expect("an answer");
    (response.status().as_u16(), response.text().await.expect("text"))
}

#[tokio::test]
async fn a_bucket_is_served_as_a_folder_is() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let (s3, (bytes, preview)) = (S3::start().await, built("100k", 1));
    let (_server, url) = replica(&s3, &["--cache", "8MiB"]);
    assert_eq!(text(format!("{url}/readyz")).await.0, 200);
    assert_eq!(text(format!("{url}/datasets/a.lods")).await.0, 404);
    s3.put("scans/a.lods", bytes.clone()).await;
    s3.put("scans/a.preview.png", preview.clone()).await;
    s3.put("scans/below/b.lods", bytes.clone()).await;
    s3.put("scans/.hidden.lods", bytes.clone()).await;
    s3.put("scans/broken.lods", b"broken".to_vec()).await;
    s3.put("outside.lods", bytes.clone()).await;

    // It appears without a restart; what was not there is believed for two seconds only.
    let list = loop {
        let list: serde_json::Value =
            serde_json::from_str(&text(format!("{url}/datasets")).await.1).expect("JSON");
        let first = &list["datasets"][0];
        if first["preview"].is_string() && list["unreadable"][0].is_object() {
            break list;
        }
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    assert_eq!(list["datasets"].as_array().map(Vec::len), Some(1), "{list}");
    assert_eq!(list["datasets"][0]["points"], 100_000);
    assert_eq!(list["unreadable"][0]["file"], "broken.lods");
    let get = |path: &str| Client::new().get(format!("{url}/{path}"));
    let picture = list["datasets"][0]["preview"].as_str().expect("an address");
    let picture = get(picture).send().await.expect("an answer").bytes().await.expect("a body");
    assert!(picture == preview);
    for path in ["datasets/..%2foutside.lods", "below%2fb.lods", ".hidden.lods", "none.lods"] {
        assert_eq!(text(format!("{url}/{path}")).await.0, 404, "{path}");
    }

    // All of it, and ranges around blocks' ends.
    let whole = get("a.lods").send().await.expect("an answer");
    assert_eq!(whole.content_length(), Some(bytes.len() as u64));
    assert!(whole.bytes().await.expect("a body") == bytes);
    let block = 256 << 10;
    for (first, last) in [(0, 0), (block - 1, block), (block, 3 * block), (7, bytes.len() - 1)] {
        let range = format!("bytes={first}-{last}");
        let part = get("a.lods").header("range", &range).send().await.expect("an answer");
        assert_eq!(part.status(), 206, "{range}");
        assert!(part.bytes().await.expect("a body") == bytes[first..=last], "{range}");
    }
    let figures = text(format!("{url}/metrics")).await.1;
    let figure = |name: &str| -> f64 {
        let line = figures.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap_or_else(|| panic!("no {name} in {figures}")).parse().expect("a number")
    };
    assert!(figure("lodestream_cache_hits_total") > 0.0);
    assert!(figure("lodestream_cache_bytes") <= (8 << 20) as f64);

    // Replaced: never a byte of the one in an answer of the other.
    let (other, _) = built("100k", 2);
    s3.put("scans/a.lods", other.clone()).await;
    loop {
        let response = get("a.lods").send().await.expect("an answer");
        match response.bytes().await {
            Ok(body) if body == other => break,
            Ok(body) => assert!(body == bytes, "a mixture"),
            // It was replaced while it was read.
            Err(_) => {}
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    s3.remove("scans/a.lods").await;
    while text(format!("{url}/a.lods")).await.0 != 404 {
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn one_of_two_replicas_is_killed_and_clients_go_on() {
    const CLIENTS: usize = 4;
    let _ = rustls::crypto::ring::default_provider().install_default();
    let (s3, (bytes, _)) = (S3::start().await, built("100k", 1));
    s3.put("scans/a.lods", bytes.clone()).await;
    let [(first, a), (mut second, b)] = [replica(&s3, &[]), replica(&s3, &[])];
    // Both serve the same bytes.
    for url in [&a, &b] {
        let body = Client::new().get(format!("{url}/a.lods")).send().await.expect("an answer");
        assert!(body.bytes().await.expect("a body") == bytes);
    }
    let [a, b] = [&a, &b].map(|url| url.trim_start_matches("http://").to_owned());
    let nginx = Nginx::start(|addr, _| {
        format!(
            "upstream lodestream {{ server {a} max_fails=2 fail_timeout=2s; \
             server {b} max_fails=2 fail_timeout=2s; }}\n\
             server {{ listen {addr}; location / {{ proxy_pass http://lodestream; \
             proxy_next_upstream error timeout http_502 http_503; proxy_buffering off; }} }}"
        )
    });
    let reads = Arc::new(AtomicUsize::new(0));
    let is_over = Arc::new(AtomicBool::new(false));
    let bytes = Arc::new(bytes);
    let clients: Vec<_> = (0..CLIENTS)
        .map(|client| {
            let (reads, is_over) = (Arc::clone(&reads), Arc::clone(&is_over));
            let (bytes, addr) = (Arc::clone(&bytes), nginx.addr);
            // The client's own source, with its own way to try again.
            std::thread::spawn(move || {
                let source = Source::parse(&format!("{addr}/a")).expect("an address");
                let source = BlockingSource::new(source).expect("a thread");
                let mut at = client * 10_007;
                while !is_over.load(Ordering::Relaxed) {
                    let length = 40_000.min(bytes.len() - at);
                    let read = source.read_range(at as u64, length as u64);
                    let read = read.unwrap_or_else(|e| panic!("client {client} at {at}: {e}"));
                    assert!(read == bytes[at..at + length], "other bytes at {at}");
                    reads.fetch_add(1, Ordering::Relaxed);
                    at = (at + 100_003) % (bytes.len() - 1);
                }
            })
        })
        .collect();
    let wait_for = async |more: usize| {
        let target = reads.load(Ordering::Relaxed) + more;
        while reads.load(Ordering::Relaxed) < target {
            assert!(!clients.iter().any(std::thread::JoinHandle::is_finished), "a client gave up");
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    };
    wait_for(40).await;
    first.kill();
    wait_for(80).await;
    is_over.store(true, Ordering::Relaxed);
    for client in clients {
        client.join().expect("no client failed");
    }
    assert!(second.is_running(), "the other one is there no more");
}
