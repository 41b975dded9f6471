//! Which bytes come back.

use std::sync::OnceLock;

use proptest::prelude::*;
use reqwest::Method;

use crate::support::{Site, field};

fn shared() -> &'static (Site, Vec<u8>, tokio::runtime::Runtime) {
    static SHARED: OnceLock<(Site, Vec<u8>, tokio::runtime::Runtime)> = OnceLock::new();
    SHARED.get_or_init(|| {
        let (site, bytes) = Site::with_dataset();
        let runtime = tokio::runtime::Builder::new_multi_thread();
        (site, bytes, { runtime }.enable_all().build().expect("a runtime"))
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_range_is_that_slice_of_the_file(
        first in 0usize..720_000, length in prop_oneof![1usize..100, 1usize..720_000], form in 0..3,
    ) {
        let (site, bytes, runtime) = shared();
        let (len, last) = (bytes.len(), first + length - 1);
        let (range, start, end) = match form {
            0 => (format!("bytes={first}-{last}"), first, (last + 1).min(len)),
            1 => (format!("bytes={first}-"), first, len),
            _ => (format!("bytes=-{length}"), len.saturating_sub(length), len),
        };
        runtime.block_on(async {
            let response = site.get("/datasets/a.lods", &[("range", &range)]).await;
            if start >= len {
                prop_assert_eq!(response.status(), 416);
                let content = field(response.headers(), "content-range").to_owned();
                prop_assert_eq!(content, format!("bytes */{len}"));
                return Ok(());
            }
            prop_assert_eq!(response.status(), 206);
            let content = field(response.headers(), "content-range").to_owned();
            prop_assert_eq!(content, format!("bytes {start}-{}/{len}", end - 1));
            prop_assert_eq!(response.content_length(), Some((end - start) as u64));
            let body = response.bytes().await.expect("a whole body");
            prop_assert!(body == bytes[start..end], "{} differs", range);
            Ok(())
        })?;
    }
}

#[tokio::test]
async fn the_whole_file_comes_with_all_that_caches_need() {
    let (site, bytes) = Site::with_dataset();
    for path in ["/datasets/a.lods", "/a.lods"] {
        let response = site.get(path, &[]).await;
        assert_eq!(response.status(), 200);
        let headers = response.headers().clone();
        assert_eq!(field(&headers, "accept-ranges"), "bytes");
        assert_eq!(field(&headers, "content-type"), "application/octet-stream");
        assert_eq!(field(&headers, "cache-control"), "public, max-age=60");
        assert_eq!(field(&headers, "content-length"), bytes.len().to_string());
        assert!(headers.contains_key("last-modified"));
        let header = lodestream_protocol::Header::parse(&bytes).expect("a sound header");
        assert_eq!(field(&headers, "etag"), format!("\"{}\"", header.content_id_hex()));
        assert!(response.bytes().await.expect("a whole body") == bytes);
    }
}

#[tokio::test]
async fn bytes_behind_the_dataset_are_not_part_of_it() {
    let (site, bytes) = Site::with_dataset();
    site.put("a.lods", &[&bytes[..], b"left over"].concat());
    let body = site.get("/a.lods", &[]).await.bytes().await.expect("a whole body");
    assert!(body == bytes);
}

#[tokio::test]
async fn a_multipart_is_streamed_whole_though_its_parts_are_longer_than_a_piece() {
    let (site, bytes) = Site::with_dataset();
    let range = "bytes=0-299999,300500-699999";
    let response = site.get("/a.lods", &[("range", range)]).await;
    assert_eq!(response.status(), 206);
    let content_type = field(response.headers(), "content-type").to_owned();
    let boundary = content_type.strip_prefix("multipart/byteranges; boundary=").expect("multipart");
    let head = |first: usize, last: usize| {
        format!(
            "\r\n--{boundary}\r\nContent-Type: application/octet-stream\r\n\
             Content-Range: bytes {first}-{last}/{}\r\n\r\n",
            bytes.len()
        )
    };
    let expected = [
        head(0, 299_999).as_bytes(),
        &bytes[..300_000],
        head(300_500, 699_999).as_bytes(),
        &bytes[300_500..700_000],
        format!("\r\n--{boundary}--\r\n").as_bytes(),
    ]
    .concat();
    assert_eq!(response.content_length(), Some(expected.len() as u64));
    assert!(response.bytes().await.expect("a whole body") == expected);
}

#[tokio::test]
async fn only_the_address_of_the_content_may_be_kept_for_good() {
    let (site, bytes) = Site::with_dataset();
    let index = site.json("/datasets").await;
    let address = format!("/{}", index["datasets"][0]["content_url"].as_str().expect("an address"));
    let response = site.get(&address, &[("range", "bytes=0-9")]).await;
    assert_eq!(response.status(), 206);
    let kept = field(response.headers(), "cache-control");
    assert_eq!(kept, "public, max-age=31536000, immutable");
    let response = site.get("/a.lods", &[("range", "bytes=0-9")]).await;
    assert_eq!(field(response.headers(), "cache-control"), "public, max-age=60");

    let new = crate::file::dataset(2, 1000);
    site.put("new.tmp", &new);
    std::fs::rename(site.path("new.tmp"), site.path("a.lods")).expect("one folder");
    let gone = site.get(&address, &[]).await;
    assert_eq!(gone.status(), 404);
    assert_eq!(field(gone.headers(), "cache-control"), "no-store");
    assert!(site.get("/a.lods", &[]).await.bytes().await.expect("a body") == new);
    assert!(new != bytes);
}

#[tokio::test]
async fn head_tells_the_length_and_sends_nothing() {
    let (site, bytes) = Site::with_dataset();
    let response = site.send(Method::HEAD, "/a.lods", &[("range", "bytes=0-9")]).await;
    assert_eq!(response.status(), 200);
    assert_eq!(field(response.headers(), "content-length"), bytes.len().to_string());
    assert!(!field(response.headers(), "etag").is_empty());
    assert!(response.bytes().await.expect("no body").is_empty());
}

#[tokio::test]
async fn datasets_cannot_be_written() {
    let (site, _) = Site::with_dataset();
    for method in [Method::PUT, Method::POST, Method::DELETE] {
        let response = site.send(method, "/datasets/a.lods", &[]).await;
        assert_eq!(response.status(), 405);
        assert!(field(response.headers(), "allow").contains("GET"));
    }
}

#[tokio::test]
async fn pages_from_elsewhere_may_read_ranges() {
    let (site, _) = Site::with_dataset();
    let origin = ("origin", "https://viewer.example");
    let asked = [
        origin,
        ("access-control-request-method", "GET"),
        ("access-control-request-headers", "range, if-range"),
    ];
    let preflight = site.send(Method::OPTIONS, "/datasets/a.lods", &asked).await;
    assert!(preflight.status().is_success());
    let headers = preflight.headers();
    assert_eq!(field(headers, "access-control-allow-origin"), "*");
    assert!(field(headers, "access-control-allow-methods").contains("GET"));
    assert!(field(headers, "access-control-allow-headers").contains("range"));

    let response = site.get("/datasets/a.lods", &[origin, ("range", "bytes=0-9")]).await;
    assert_eq!(response.status(), 206);
    assert_eq!(field(response.headers(), "access-control-allow-origin"), "*");
    let exposed = field(response.headers(), "access-control-expose-headers").to_lowercase();
    for name in ["content-range", "content-length", "etag", "accept-ranges"] {
        assert!(exposed.contains(name), "{name} is not in {exposed}");
    }
}
