//! What is not sent again.

use crate::support::{Site, dataset, field};

const LONG_AGO: &str = "Sun, 06 Nov 1994 08:49:37 GMT";

#[tokio::test]
async fn a_copy_that_is_good_is_not_sent_again() {
    let (site, _) = Site::with_dataset();
    let first = site.get("/a.lods", &[("range", "bytes=0-9")]).await;
    let etag = field(first.headers(), "etag").to_owned();
    let modified = field(first.headers(), "last-modified").to_owned();
    let weak = format!("W/{etag}");
    for (name, value) in
        [("if-none-match", &etag), ("if-none-match", &weak), ("if-modified-since", &modified)]
    {
        let response = site.get("/a.lods", &[(name, value), ("range", "bytes=0-9")]).await;
        assert_eq!(response.status(), 304, "{name}: {value}");
        assert_eq!(field(response.headers(), "etag"), etag);
        assert!(!field(response.headers(), "cache-control").is_empty());
        assert!(response.bytes().await.expect("no body").is_empty());
    }
    for (name, value) in [("if-none-match", "\"other\""), ("if-modified-since", LONG_AGO)] {
        assert_eq!(site.get("/a.lods", &[(name, value)]).await.status(), 200, "{name}");
    }
}

#[tokio::test]
async fn another_file_than_expected_is_refused() {
    let (site, _) = Site::with_dataset();
    let etag = field(site.get("/a.lods", &[]).await.headers(), "etag").to_owned();
    assert_eq!(site.get("/a.lods", &[("if-match", &etag)]).await.status(), 200);
    assert_eq!(site.get("/a.lods", &[("if-match", "\"other\"")]).await.status(), 412);
    assert_eq!(site.get("/a.lods", &[("if-unmodified-since", LONG_AGO)]).await.status(), 412);
}

#[tokio::test]
async fn a_range_of_a_replaced_file_brings_the_whole_new_one() {
    let (site, old) = Site::with_dataset();
    let etag = field(site.get("/a.lods", &[]).await.headers(), "etag").to_owned();
    let ask = [("range", "bytes=100-199"), ("if-range", etag.as_str())];
    let part = site.get("/a.lods", &ask).await;
    assert_eq!(part.status(), 206);
    assert!(part.bytes().await.expect("a body") == old[100..200]);

    let new = dataset(2, 1000);
    site.put("new.tmp", &new);
    std::fs::rename(site.path("new.tmp"), site.path("a.lods")).expect("one folder");
    let whole = site.get("/a.lods", &ask).await;
    assert_eq!(whole.status(), 200);
    assert_ne!(field(whole.headers(), "etag"), etag);
    assert!(whole.bytes().await.expect("a body") == new);
}
