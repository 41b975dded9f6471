//! What an operator sees and sets.

use std::{
    io::{Read, Write},
    net::TcpStream,
    time::Duration,
};

use lodestream_server::RateLimit;
use reqwest::Method;

use crate::support::{Site, dataset, field};

/// The figure of that name and labels.
async fn figure(site: &Site, name: &str) -> f64 {
    let text = site.get("/metrics", &[]).await.text().await.expect("figures");
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.unwrap_or_else(|| panic!("no {name} in {text}")).parse().expect("a number")
}

#[tokio::test]
async fn figures_tell_what_was_served() {
    let (site, bytes) = Site::with_dataset();
    for _ in 0..3 {
        site.get("/a.lods", &[("range", "bytes=0-99")]).await.bytes().await.expect("a body");
    }
    site.get("/datasets/a.lods", &[]).await.bytes().await.expect("a body");
    site.get("/absent.lods", &[]).await.bytes().await.expect("a body");
    let name = "lodestream_requests_total{dataset=\"a\",kind=\"file\",status=\"206\"}";
    assert!((figure(&site, name).await - 3.0).abs() < 0.1);
    let name = "lodestream_response_bytes_total{dataset=\"a\",kind=\"file\"}";
    assert!((figure(&site, name).await - (300 + bytes.len()) as f64).abs() < 0.1);
    let name = "lodestream_requests_total{dataset=\"\",kind=\"file\",status=\"404\"}";
    assert!((figure(&site, name).await - 1.0).abs() < 0.1, "names of nothing are no labels");
    let name = "lodestream_last_byte_seconds_count{dataset=\"a\",kind=\"file\"}";
    assert!((figure(&site, name).await - 4.0).abs() < 0.1);
    assert!(figure(&site, "lodestream_connections_open").await >= 1.0);
    #[cfg(target_os = "linux")]
    {
        assert!(figure(&site, "lodestream_process_resident_memory_bytes").await > 1e6);
        assert!(figure(&site, "lodestream_process_cpu_seconds_total").await >= 0.0);
    }
}

#[tokio::test]
async fn a_response_without_a_body_is_not_counted_as_broken() {
    let (site, _) = Site::with_dataset();
    let tag =
        field(site.get("/a.lods", &[("range", "bytes=0-0")]).await.headers(), "etag").to_owned();
    assert_eq!(site.send(Method::HEAD, "/a.lods", &[]).await.status(), 200);
    assert_eq!(site.get("/a.lods", &[("if-none-match", &tag)]).await.status(), 304);
    let name = "lodestream_requests_total{dataset=\"a\",kind=\"file\",status=\"304\"}";
    assert!((figure(&site, name).await - 1.0).abs() < 0.1);
    let text = site.get("/metrics", &[]).await.text().await.expect("figures");
    assert!(!text.contains("\nlodestream_responses_broken_total{"), "{text}");
}

#[tokio::test]
async fn a_response_that_the_client_left_is_counted_as_broken() {
    let site = Site::new();
    site.put("big.lods", &dataset(1, 64 << 20));
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.write_all(b"GET /big.lods HTTP/1.1\r\nhost: x\r\n\r\n").expect("the server reads");
    stream.read_exact(&mut [0; 1000]).expect("the response begins");
    drop(stream);
    let name = "lodestream_responses_broken_total{dataset=\"big\",kind=\"file\"}";
    loop {
        let text = site.get("/metrics", &[]).await.text().await.expect("figures");
        if text.contains(&format!("{name} 1")) {
            break;
        }
        tokio::task::yield_now().await;
    }
}

#[tokio::test]
async fn a_client_that_asks_too_often_is_told_when_to_come_again() {
    let site = Site::configured(|config| {
        config.rate = Some(RateLimit { per_second: 0.001, burst: 3 });
        config.trusted_proxies = vec![[127, 0, 0, 1].into()];
    });
    let from = |address| [("x-forwarded-for", address)];
    for _ in 0..3 {
        assert_eq!(site.get("/healthz", &from("192.0.2.1")).await.status(), 200);
    }
    let response = site.get("/healthz", &from("192.0.2.1")).await;
    assert_eq!(response.status(), 429);
    let wait: u64 = field(response.headers(), "retry-after").parse().expect("seconds");
    assert!((900..=1001).contains(&wait), "{wait}");
    assert_eq!(site.get("/healthz", &from("192.0.2.2")).await.status(), 200, "another client");
}

#[tokio::test]
async fn bodies_beyond_the_limit_are_refused() {
    let site = Site::configured(|config| config.max_body_bytes = 1000);
    site.put("a.lods", &dataset(1, 10));
    let post = async |bytes| {
        let body = vec![0; bytes];
        site.send_body(Method::POST, "/a.lods/batch", &[], body).await.status()
    };
    assert_eq!(post(1001).await, 413);
    assert_eq!(post(1000).await, 415, "it is taken, and then it is no batch");
}

#[tokio::test]
async fn a_server_that_is_to_stop_says_that_it_is_not_ready_and_goes_on_for_a_while() {
    let site = Site::configured(|config| {
        config.drain_delay = Duration::from_secs(3600);
        config.drain_timeout = Duration::ZERO;
    });
    assert_eq!(site.get("/readyz", &[]).await.status(), 200);
    let (folder, url) = (site.folder, site.server.url());
    // It stops only after the delay, which is far beyond this test: the thread ends with the process.
    std::thread::spawn(move || site.server.stop());
    let client = reqwest::Client::new();
    let status = async |path: &str| {
        client.get(format!("{url}{path}")).send().await.expect("it still answers").status()
    };
    while status("/readyz").await != 503 {
        tokio::task::yield_now().await;
    }
    assert_eq!(status("/healthz").await, 200);
    drop(folder);
}
