//! What is in the folder, and what becomes of it.

use std::fs;

use lodestream_server::DatasetIndex;

use crate::support::{Site, dataset};

async fn index(site: &Site) -> DatasetIndex {
    serde_json::from_value(site.json("/datasets").await).expect("an index")
}

#[tokio::test]
async fn the_index_tells_what_datasets_hold() {
    let (site, bytes) = Site::with_dataset();
    let json = site.json("/datasets").await;
    let header = lodestream_protocol::Header::parse(&bytes).expect("a sound header");
    assert_eq!(
        json,
        serde_json::json!({
            "datasets": [{
                "name": "a",
                "url": "datasets/a.lods",
                "content_url": format!("datasets/a.lods?v={}", header.content_id_hex()),
                "points": 0,
                "bytes": bytes.len(),
                "levels": 0,
                "bounds": null,
                "attributes": [
                    { "name": "color", "type": "u8", "components": 3, "constant": false },
                ],
                "content_id": header.content_id_hex(),
            }],
            "unreadable": [],
        })
    );
}

#[tokio::test]
async fn datasets_appear_change_and_vanish_without_a_restart() {
    let site = Site::new();
    assert_eq!(index(&site).await, DatasetIndex::default());
    assert_eq!(site.get("/a.lods", &[]).await.status(), 404);

    site.put("a.lods", &dataset(1, 10));
    let first = index(&site).await;
    assert_eq!(first.datasets.len(), 1);
    assert_eq!(site.get("/a.lods", &[]).await.status(), 200);

    site.put("new.tmp", &dataset(2, 10));
    fs::rename(site.path("new.tmp"), site.path("a.lods")).expect("one folder");
    let second = index(&site).await;
    assert_ne!(first.datasets[0].content_id, second.datasets[0].content_id);

    fs::remove_file(site.path("a.lods")).expect("it is there");
    assert_eq!(index(&site).await, DatasetIndex::default());
    assert_eq!(site.get("/a.lods", &[]).await.status(), 404);
}

#[tokio::test]
async fn garbage_is_listed_with_its_reason_and_breaks_nothing() {
    let (site, bytes) = Site::with_dataset();
    site.put("empty.lods", b"");
    site.put("garbage.lods", &[7; 5000]);
    site.put("short.lods", &bytes[..bytes.len() - 1]);
    site.put("z-index.lods", &{
        let mut altered = bytes.clone();
        altered[100] ^= 1;
        altered
    });
    site.put(".hidden.lods", &bytes);
    site.put("being-written.lods.tmp", &bytes);
    fs::create_dir(site.path("folder.lods")).expect("a new name");

    let index = index(&site).await;
    let names = |list: Vec<&str>| list.join(" ");
    assert_eq!(names(index.datasets.iter().map(|d| d.name.as_str()).collect()), "a");
    let unreadable = index.unreadable.iter().map(|u| u.file.as_str()).collect();
    assert_eq!(names(unreadable), "empty.lods garbage.lods short.lods z-index.lods");
    for (file, reason) in
        index.unreadable.iter().zip(["header", "not a lodestream", "cut short", "checksum"])
    {
        assert!(file.reason.contains(reason), "{}: {}", file.file, file.reason);
    }
    for (name, status) in [
        ("empty.lods", 503),
        ("garbage.lods", 503),
        ("short.lods", 503),
        (".hidden.lods", 404),
        ("being-written.lods.tmp", 404),
        ("folder.lods", 404),
    ] {
        assert_eq!(site.get(&format!("/datasets/{name}"), &[]).await.status(), status, "{name}");
    }
    let page = site.get("/", &[]).await.text().await.expect("a page");
    assert!(page.contains("href=\"datasets/a.lods\"") && page.contains("garbage.lods"), "{page}");
}

#[tokio::test]
async fn a_file_cut_short_under_a_response_breaks_that_response_only() {
    let site = Site::new();
    // Far beyond what sockets and the server hold, so that most is unread when the cut comes.
    let bytes = dataset(3, 64 << 20);
    site.put("big.lods", &bytes);
    let mut response = site.get("/big.lods", &[]).await;
    let first = response.chunk().await.expect("a first piece").expect("not the end");
    assert!(bytes.starts_with(&first));
    fs::OpenOptions::new()
        .write(true)
        .open(site.path("big.lods"))
        .and_then(|file| file.set_len(1000))
        .expect("writable");
    let mut received = first.len();
    let broken = loop {
        match response.chunk().await {
            Ok(Some(piece)) => received += piece.len(),
            Ok(None) => break false,
            Err(_) => break true,
        }
    };
    assert!(broken, "{received} of {} bytes passed for the whole", bytes.len());
    assert_eq!(site.get("/healthz", &[]).await.status(), 200);
    assert_eq!(site.get("/big.lods", &[]).await.status(), 503);
}

#[tokio::test]
async fn health_is_that_of_the_folder() {
    let site = Site::new();
    let response = site.get("/healthz", &[]).await;
    assert_eq!(response.status(), 200);
    assert_eq!(response.text().await.expect("a body"), "ok\n");
    fs::remove_dir(site.folder.path()).expect("empty");
    assert_eq!(site.get("/healthz", &[]).await.status(), 503);
    assert_eq!(site.get("/datasets", &[]).await.status(), 503);
}
