//! Files that change under the server.

use std::{
    fs::{self, OpenOptions},
    net::SocketAddr,
    path::Path,
    sync::{Arc, atomic::Ordering},
};

use lodestream_protocol::Header;
use lodestream_server::{RunningServer, ServeConfig, spawn};

use crate::{
    clients::{Client, Crowd},
    file::dataset,
};

fn serve(folder: &Path) -> RunningServer {
    let here = SocketAddr::from(([127, 0, 0, 1], 0));
    spawn(ServeConfig::new(folder, here)).expect("port 0 is free")
}

fn tag(file: &[u8]) -> String {
    format!("\"{}\"", Header::parse(file).expect("a sound header").content_id_hex())
}

#[test]
fn while_a_dataset_is_replaced_again_and_again_nobody_is_sent_a_mixture() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (one, two) = (Arc::new(dataset(1, 2_000_000)), Arc::new(dataset(2, 2_000_000)));
    let put = |file: &[u8]| {
        let part = folder.path().join("a.part");
        fs::write(&part, file).expect("writable");
        fs::rename(&part, folder.path().join("a.lods")).expect("one folder");
    };
    put(&one);
    let server = serve(folder.path());
    let second = tag(&two);
    let right = {
        let (one, two) = (Arc::clone(&one), Arc::clone(&two));
        move |etag: &str| Arc::clone(if etag == second { &two } else { &one })
    };
    let crowd = Crowd::start(server.addr(), "/a.lods", 8, right);
    for round in 0..40 {
        crowd.tally.wait_for_good(30);
        put(if round % 2 == 0 { &two } else { &one });
    }
    let tally = crowd.stop();
    // An open file outlives its name: every answer that began came to its end.
    assert_eq!(tally.broken.load(Ordering::Relaxed), 0, "{tally:?}");
    assert_eq!(tally.refused.load(Ordering::Relaxed), 0, "{tally:?}");
    assert_eq!(tally.failed.load(Ordering::Relaxed), 0, "{tally:?}");
}

#[test]
fn a_file_that_is_cut_short_under_load_brings_no_wrong_byte_and_harms_no_other() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (file, other) = (Arc::new(dataset(1, 2_000_000)), Arc::new(dataset(2, 2_000_000)));
    let path = folder.path().join("a.lods");
    fs::write(&path, &*file).expect("writable");
    fs::write(folder.path().join("b.lods"), &*other).expect("writable");
    let server = serve(folder.path());
    let right = Arc::clone(&file);
    let crowd = Crowd::start(server.addr(), "/a.lods", 6, move |_| Arc::clone(&right));
    let others = Crowd::start(server.addr(), "/b.lods", 2, move |_| Arc::clone(&other));
    for round in 0..30u64 {
        crowd.tally.wait_for_good(20);
        // Within a page, so that the system blanks the rest of it; and not always before the header.
        let cut = OpenOptions::new().write(true).open(&path).expect("it is there");
        cut.set_len(1_000_001 - 33_333 * round).expect("writable");
        let mut client = Client::connect(server.addr()).expect("the server accepts");
        let answer = client.ask("/a.lods", 0, 9).expect("an answer");
        assert_eq!(answer.status, 503, "a dataset without its end is none");
        fs::write(&path, &*file).expect("writable");
    }
    others.tally.wait_for_good(20);
    let tally = others.stop();
    assert_eq!(tally.broken.load(Ordering::Relaxed), 0, "{tally:?}");
    assert_eq!(tally.refused.load(Ordering::Relaxed), 0, "{tally:?}");
    crowd.tally.wait_for_good(20);
    crowd.stop();
}

#[test]
fn what_waits_in_a_socket_is_not_blanked_by_a_cut() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = dataset(1, 2_000_000);
    let path = folder.path().join("a.lods");
    fs::write(&path, &file).expect("writable");
    let server = serve(folder.path());
    let mut client = Client::connect(server.addr()).expect("the server accepts");
    // Long enough for the file to earn its private copy.
    for _ in 0..60 {
        assert!(client.ask("/a.lods", 0, 1_499_999).expect("an answer").is_whole);
    }
    let mut waiting: Vec<_> = (0..20)
        .map(|_| {
            let mut client = Client::connect(server.addr()).expect("the server accepts");
            client.begin("/a.lods", 0, 199_999).expect("an answer begins");
            client
        })
        .collect();
    let cut = OpenOptions::new().write(true).open(&path).expect("it is there");
    cut.set_len(100_001).expect("writable");
    for client in &mut waiting {
        let body = client.rest(200_000);
        let at = body.iter().zip(&file).position(|(a, b)| a != b);
        assert_eq!(at, None, "wrong from there on, of {} bytes", body.len());
    }
}
