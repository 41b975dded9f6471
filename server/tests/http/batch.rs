//! Many parts by one request.

use lodestream_protocol::{BATCH_REQUEST_TYPE, BATCH_TYPE, BatchDecoder, BatchPart, BatchRequest};
use lodestream_protocol::{Header, MAX_BATCH_REQUEST_BYTES};
use reqwest::{Method, Response};

use crate::support::{Site, field};

const TYPE: (&str, &str) = ("content-type", BATCH_REQUEST_TYPE);

fn request(file: &[u8], parts: &[(u64, u32)]) -> BatchRequest {
    let content_id = Header::parse(file).expect("a sound header").content_id;
    let parts = parts.iter().map(|&(offset, bytes)| BatchPart { offset, bytes }).collect();
    BatchRequest { content_id, parts }
}

async fn post(site: &Site, fields: &[(&str, &str)], body: Vec<u8>) -> Response {
    site.send_body(Method::POST, "/datasets/a.lods/batch", fields, body).await
}

#[tokio::test]
async fn parts_come_in_the_order_in_which_they_were_asked_for() {
    let (site, file) = Site::with_dataset();
    let parts = [(600_000, 100), (0, 300_000), (5, 1), (0, 64), (350_000, 349_000)];
    let asked = request(&file, &parts);
    let response = post(&site, &[TYPE], asked.encode().expect("within the limits")).await;
    assert_eq!(response.status(), 200);
    assert_eq!(field(response.headers(), "content-type"), BATCH_TYPE);
    assert_eq!(response.content_length(), Some(asked.response_bytes()));
    let body = response.bytes().await.expect("a whole body");
    let mut decoder = BatchDecoder::new(asked);
    let (mut rest, mut payload) = (&body[..], Vec::new());
    while !rest.is_empty() {
        let step = decoder.step(rest).expect("a good answer");
        let (now, later) = rest.split_at(step.bytes);
        if step.is_payload {
            payload.extend_from_slice(now);
        }
        rest = later;
    }
    assert!(decoder.is_complete());
    let expected: Vec<_> = parts.iter().map(|&(o, n)| &file[o as usize..][..n as usize]).collect();
    assert!(payload == expected.concat());
}

#[tokio::test]
async fn batches_are_offered_where_a_dataset_begins() {
    let (site, _) = Site::with_dataset();
    let offered = |response: &Response| field(response.headers(), "lodestream-batch").to_owned();
    let first = site.get("/a.lods", &[("range", "bytes=0-9")]).await;
    assert_eq!(offered(&first), "1; parts=4096; bytes=67108864");
    assert!(offered(&site.get("/a.lods", &[("range", "bytes=5-9")]).await).is_empty());
    let origin = [("origin", "https://viewer.example"), ("range", "bytes=0-9")];
    let exposed = site.get("/a.lods", &origin).await;
    assert!(field(exposed.headers(), "access-control-expose-headers").contains("lodestream-batch"));
}

#[tokio::test]
async fn what_is_no_batch_request_is_refused() {
    let (site, file) = Site::with_dataset();
    let good = request(&file, &[(0, 10), (20, 10)]);
    let body = good.encode().expect("within the limits");
    let beyond = request(&file, &[(0, 10), (file.len() as u64 - 1, 2)]);
    let overflow = request(&file, &[(u64::MAX, 2)]);
    let other = BatchRequest { content_id: [0; 16], ..good };
    let encode = |request: &BatchRequest| request.encode().expect("within the limits");
    // 4,096 parts at most, whatever the length says that stands before them.
    let lying = [&[0; 16][..], &[0xFC, 0xFF, 0xFF, 0xFF, 0xFF]].concat();
    let gzip = ("content-encoding", "gzip");
    for (what, fields, body, status) in [
        ("no type", &[][..], body.clone(), 415),
        ("another type", &[("content-type", "text/plain")], body.clone(), 415),
        ("compressed", &[TYPE, gzip], body.clone(), 415),
        ("empty", &[TYPE], vec![], 400),
        ("cut short", &[TYPE], body[..body.len() - 1].to_vec(), 400),
        ("longer than it says", &[TYPE], [&body[..], b"x"].concat(), 400),
        ("lying about its length", &[TYPE], lying, 400),
        ("too long", &[TYPE], vec![0; MAX_BATCH_REQUEST_BYTES + 1], 413),
        ("beyond the end", &[TYPE], encode(&beyond), 416),
        ("beyond 64 bits", &[TYPE], encode(&overflow), 416),
        ("about another file", &[TYPE], encode(&other), 412),
    ] {
        let response = post(&site, fields, body).await;
        assert_eq!(response.status(), status, "{what}");
        assert!(!response.text().await.expect("a line").is_empty(), "{what}");
    }
    let get = site.get("/datasets/a.lods/batch", &[]).await;
    assert_eq!((get.status().as_u16(), field(get.headers(), "allow")), (405, "POST"));
    let missing = site.send_body(Method::POST, "/b.lods/batch", &[TYPE], body).await;
    assert_eq!(missing.status(), 404);
}
