//! What is compressed, and what is not.

use crate::support::{Site, field};

const TAKES: (&str, &str) = ("accept-encoding", "br, gzip");

#[tokio::test]
async fn texts_are_compressed_for_whoever_takes_that_and_have_a_length() {
    let (site, _) = Site::with_dataset();
    for path in ["/", "/datasets"] {
        let plain = site.get(path, &[]).await;
        assert!(field(plain.headers(), "content-encoding").is_empty(), "{path}");
        let plain = plain.bytes().await.expect("a body");
        let small = site.get(path, &[TAKES]).await;
        assert_eq!(field(small.headers(), "content-encoding"), "gzip", "{path}");
        assert!(field(small.headers(), "vary").contains("accept-encoding"), "{path}");
        let length = small.content_length();
        let small = small.bytes().await.expect("a body");
        assert_eq!(length, Some(small.len() as u64), "{path}");
        assert!(small.starts_with(&[0x1F, 0x8B]) && small.len() < plain.len(), "{path}");
    }
}

#[tokio::test]
async fn payloads_are_sent_as_they_are() {
    let (site, bytes) = Site::with_dataset();
    for fields in
        [&[TAKES][..], &[TAKES, ("range", "bytes=0-99")], &[TAKES, ("range", "bytes=0-9,900-999")]]
    {
        let response = site.get("/a.lods", fields).await;
        assert!(field(response.headers(), "content-encoding").is_empty());
        assert!(field(response.headers(), "content-length").parse::<usize>().is_ok());
        let body = response.bytes().await.expect("a body");
        assert!(body.windows(10).any(|window| window == &bytes[..10]));
    }
}
