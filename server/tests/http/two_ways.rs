//! Plain range requests go a short way of their own: nobody must be able to tell.

use std::{io::Write, net::TcpStream};

use lodestream_protocol::{BATCH_REQUEST_TYPE, BatchPart, BatchRequest, Header};

use crate::support::{Site, answer, ask, dataset};

#[tokio::test]
async fn both_ways_give_the_same_answer() {
    let (site, bytes) = Site::with_dataset();
    let index = site.json("/datasets").await;
    let content = format!("/{}", index["datasets"][0]["content_url"].as_str().expect("text"));
    let connect = || TcpStream::connect(site.server.addr()).expect("the server accepts");
    let (mut short, mut long) = (connect(), connect());
    for path in ["/a.lods", "/datasets/a.lods", &content] {
        for (first, last) in [(0, 0), (0, 99), (5, 70_000), (300_000, 650_000), (9, 9_999_999)] {
            let range = format!("range: bytes={first}-{last}\r\n");
            let quick = ask(&mut short, path, &range);
            // A field that the short way does not know.
            let slow = ask(&mut long, path, &format!("{range}x-other: 1\r\n"));
            assert_eq!(quick.0, slow.0, "{path} {range}");
            assert!(quick.1 == slow.1 && quick.1 == bytes[first..=last.min(bytes.len() - 1)]);
        }
    }
    for path in ["/a.lods?v=0", "/missing.lods", "/datasets/.lods"] {
        let range = "range: bytes=0-9\r\n";
        let quick = ask(&mut connect(), path, range);
        assert_eq!(quick, ask(&mut connect(), path, &format!("{range}x-other: 1\r\n")), "{path}");
    }
}

#[test]
fn both_ways_give_the_same_batch() {
    let (site, bytes) = Site::with_dataset();
    let content_id = Header::parse(&bytes).expect("a sound header").content_id;
    let connect = || TcpStream::connect(site.server.addr()).expect("the server accepts");
    let (mut short, mut long) = (connect(), connect());
    for round in 0..30u64 {
        // Some of them too short for pages, and some too long for a piece.
        let places = [(round * 1000, 10), (600_000, 90_000), (round, 5_000 * round as u32 + 1)];
        let parts = places.map(|(offset, bytes)| BatchPart { offset, bytes }).to_vec();
        let body = BatchRequest { content_id, parts }.encode().expect("within the limits");
        let post = |stream: &mut TcpStream, other: &str| {
            let head = format!(
                "POST /a.lods/batch HTTP/1.1\r\nhost: x\r\ncontent-type: {BATCH_REQUEST_TYPE}\r\n\
                 content-length: {}\r\n{other}\r\n",
                body.len()
            );
            stream.write_all(&[head.as_bytes(), &body].concat()).expect("the server reads");
            answer(stream)
        };
        let quick = post(&mut short, "");
        assert!(quick == post(&mut long, "x-other: 1\r\n"), "{round}: {:?}", quick.0);
        assert_eq!(quick.1.len(), 24 + 3 * 8 + 90_011 + 5_000 * round as usize);
    }
}

#[test]
fn neither_way_takes_a_longer_body_than_it_may() {
    let (mut statuses, body) = (Vec::new(), vec![0; 101]);
    for (limit, other) in [(100, ""), (100, "x-other: 1\r\n"), (101, ""), (101, "x-other: 1\r\n")] {
        let site = Site::configured(|config| config.max_body_bytes = limit);
        site.put("a.lods", &dataset(1, 10_000));
        let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
        let head = format!(
            "POST /a.lods/batch HTTP/1.1\r\nhost: x\r\ncontent-type: {BATCH_REQUEST_TYPE}\r\n\
             content-length: 101\r\n{other}\r\n"
        );
        stream.write_all(&[head.as_bytes(), &body].concat()).expect("the server reads");
        let (lines, _) = answer(&mut stream);
        statuses.extend(lines.into_iter().find(|line| line.starts_with("HTTP/1.1")));
    }
    // Of zeros: no batch request.
    let (long, bad) = ("HTTP/1.1 413 Payload Too Large", "HTTP/1.1 400 Bad Request");
    assert_eq!(statuses, [long, long, bad, bad]);
}

#[test]
fn a_connection_may_change_its_way_in_the_middle_of_a_pipeline() {
    let (site, bytes) = Site::with_dataset();
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    let plain = |first: usize| {
        format!("GET /a.lods HTTP/1.1\r\nhost: x\r\nrange: bytes={first}-{}\r\n\r\n", first + 9)
    };
    let other = "GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n".to_owned();
    let requests = [plain(0), plain(10), other, plain(20), plain(30)].concat();
    // Cut within a head, so that both ways begin in the middle of one.
    let (begin, end) = requests.split_at(requests.len() / 2 + 20);
    stream.write_all(begin.as_bytes()).expect("the server reads");
    assert_eq!(answer(&mut stream).1, bytes[0..10]);
    stream.write_all(end.as_bytes()).expect("the server reads");
    assert_eq!(answer(&mut stream).1, bytes[10..20]);
    assert_eq!(answer(&mut stream).1, b"ok\n");
    assert_eq!(answer(&mut stream).1, bytes[20..30]);
    assert_eq!(answer(&mut stream).1, bytes[30..40]);
}

#[test]
fn what_is_asked_for_again_and_again_is_sent_right_however_it_is_sent() {
    let site = Site::new();
    let bytes = dataset(7, 3_000_000);
    site.put("a.lods", &bytes);
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    // Long before the end, the file has earned its private copy.
    for round in 0..40u32 {
        let first = (round * 65_537) as usize % 1_000_000;
        let last = first + 1_500_000;
        let range = format!("range: bytes={first}-{last}\r\n");
        assert!(ask(&mut stream, "/a.lods", &range).1 == bytes[first..=last], "{round}");
    }
    // Of lengths that are read, that leave with their head, behind it, and a part with it; also at places where no page
    // begins.
    for length in [
        1, 8_191, 8_192, 16_385, 40_959, 40_960, 61_440, 61_441, 65_536, 81_919, 81_920, 131_072,
        200_000, 245_759, 245_760, 600_000,
    ] {
        for first in [0, 4_096, 1_234_567] {
            let last = first + length - 1;
            let range = format!("range: bytes={first}-{last}\r\n");
            assert!(
                ask(&mut stream, "/a.lods", &range).1 == bytes[first..=last],
                "{first} {length}"
            );
        }
    }
    // What is in its place by now must not be taken from there.
    let new = dataset(8, 3_000_000);
    site.put("b", &new);
    std::fs::rename(site.path("b"), site.path("a.lods")).expect("one folder");
    let (_, body) = ask(&mut stream, "/a.lods", "range: bytes=100000-900000\r\n");
    assert!(body == new[100_000..=900_000]);
}
