//! The server behind nginx, with `deploy/nginx.conf` as it is but for name, port and places.

use std::{fs, net::SocketAddr, path::Path};

use rcgen::{CertifiedKey, generate_simple_self_signed};
use reqwest::{Client, StatusCode, tls::Certificate};

use crate::{nginx::Nginx, server};

/// The shipped configuration, adapted as its first lines say.
fn adapted(addr: SocketAddr, folder: &Path, upstream: &str) -> String {
    let shipped = include_str!("../../../deploy/nginx.conf");
    let place = folder.display().to_string();
    let changes = [
        ("/var/cache/nginx/lodestream", format!("{place}/cache")),
        ("/etc/ssl/data.example.", format!("{place}/")),
        ("listen 443 ssl http2;", format!("listen {addr} ssl http2;")),
        ("data.example", "localhost".to_owned()),
        ("127.0.0.1:8080", upstream.trim_start_matches("http://").to_owned()),
    ];
    changes.iter().fold(shipped.to_owned(), |text, (shipped, ours)| {
        assert!(text.contains(shipped), "{shipped} is not in deploy/nginx.conf");
        text.replace(shipped, ours)
    })
}

#[tokio::test]
async fn a_dataset_is_hosted_behind_nginx_as_the_operators_page_says() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let data = tempfile::tempdir().expect("a temporary folder");
    let path = data.path().join("yard.lods");
    server::build(&path, "150k", 1);
    let bytes = fs::read(&path).expect("built");
    assert!(bytes.len() > 3 << 19, "{} bytes are not several slices", bytes.len());
    let folder = data.path().to_str().expect("a plain path");
    let (_server, upstream) = server::serve(folder, &["--trusted-proxy", "127.0.0.1"]);
    let CertifiedKey { cert, signing_key } =
        generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    let nginx = Nginx::start(|addr, folder| {
        fs::write(folder.join("pem"), cert.pem()).expect("writable");
        fs::write(folder.join("key"), signing_key.serialize_pem()).expect("writable");
        adapted(addr, folder, &upstream)
    });
    let believed = Certificate::from_pem(cert.pem().as_bytes()).expect("a certificate");
    let client = Client::builder().tls_certs_only([believed]).resolve("localhost", nginx.addr);
    let client = client.build().expect("a client");
    let origin = format!("https://localhost:{}", nginx.addr.port());
    let get = |path: &str| client.get(format!("{origin}/{path}"));

    // The page's addresses are those of the proxy.
    let page = get("").send().await.expect("an answer").text().await.expect("a page");
    assert!(page.contains(&format!("{origin}/datasets/<wbr>yard.lods")), "{page}");
    let list = get("datasets").send().await.expect("an answer").text().await.expect("a list");
    let list: serde_json::Value = serde_json::from_str(&list).expect("JSON");
    let url = list["datasets"][0]["content_url"].as_str().expect("an address");

    // Ranges within a slice, across slices, at the end: the right bytes, from the server and then
    // from the cache.
    let end = bytes.len() - 1;
    for (first, last) in [(5, 9), ((1 << 20) - 10, (1 << 20) + 10), (end - 9, end), (0, end)] {
        for cached in ["first", "again"] {
            let range = format!("bytes={first}-{last}");
            let response = get(url).header("range", &range).send().await.expect("an answer");
            assert_eq!(response.status(), StatusCode::PARTIAL_CONTENT, "{range}");
            let told = response.headers()["content-range"].to_str().expect("text").to_owned();
            assert_eq!(told, format!("bytes {first}-{last}/{}", bytes.len()));
            let from_cache = response.headers()["x-cache"] == "HIT";
            assert!(from_cache || cached == "first", "{range} came from the server again");
            let body = response.bytes().await.expect("a body");
            assert!(body == bytes[first..=last], "{range} brings other bytes {cached}");
        }
    }
    // Dataset and list have gone through; the figures stay inside.
    let figures = get("metrics").send().await.expect("an answer");
    assert_eq!(figures.status(), StatusCode::FORBIDDEN);
    let whole = get(url).send().await.expect("an answer").bytes().await.expect("a body");
    assert!(whole == bytes);
    // A dataset that is replaced is so for who comes by its new address; the old one is no more.
    server::build(&path, "150k", 2);
    let list = get("datasets").send().await.expect("an answer").text().await.expect("a list");
    let list: serde_json::Value = serde_json::from_str(&list).expect("JSON");
    let new = list["datasets"][0]["content_url"].as_str().expect("an address");
    assert_ne!(new, url);
    let body = get(new).send().await.expect("an answer").bytes().await.expect("a body");
    assert!(body == fs::read(&path).expect("built"));
    let errors = nginx.errors();
    let mut complaints = errors.lines().filter(|l| !l.contains("access forbidden by rule"));
    assert_eq!(complaints.next(), None);
}
