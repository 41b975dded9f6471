//! Clients that are many, slow, or up to no good.

use std::{
    io::{ErrorKind, Read, Write},
    net::{SocketAddr, TcpStream},
    sync::Arc,
    time::Duration,
};

use lodestream_server::{RunningServer, ServeConfig, spawn};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};

use crate::{
    clients::{Client, Crowd},
    file::dataset,
    frames::{FrameClient, GOAWAY},
    process::Program,
};

fn serve(
    change: impl FnOnce(&mut ServeConfig),
) -> (tempfile::TempDir, RunningServer, Arc<Vec<u8>>) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = Arc::new(dataset(1, 2_000_000));
    std::fs::write(folder.path().join("a.lods"), &*file).expect("writable");
    let here = SocketAddr::from(([127, 0, 0, 1], 0));
    let mut config = ServeConfig::new(folder.path(), here);
    change(&mut config);
    (folder, spawn(config).expect("port 0 is free"), file)
}

#[test]
fn ten_thousand_idle_connections_cost_little_and_keep_nobody_out() {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit { current: limit.maximum, maximum: limit.maximum };
    setrlimit(Resource::Nofile, raised).expect("within its own maximum");
    // Each end is a process of its own; a system that allows fewer files gets as many as it allows.
    let most = limit.maximum.map_or(10_000, |most| most.saturating_sub(500).min(10_000));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = Arc::new(dataset(1, 2_000_000));
    std::fs::write(folder.path().join("a.lods"), &*file).expect("writable");
    let server = Program::with(folder.path(), "127.0.0.1:0", &["--max-connections", "20000"]);
    let before = server.resident_bytes();
    let idle: Vec<_> = (0..most)
        .map(|i| {
            let mut client = Client::connect(server.addr()).expect("the server accepts");
            // Some have been served before they fell asleep.
            if i % 10 == 0 {
                let answer = client.ask("/a.lods", i, i + 999).expect("an answer");
                assert_eq!(answer.body, file[i as usize..][..1000]);
            }
            client
        })
        .collect();
    let each = server.resident_bytes().saturating_sub(before) / most;
    println!("{most} idle connections, {each} bytes each");
    assert!(each < 16 << 10, "{each} bytes for each idle connection");
    let crowd = Crowd::start(server.addr(), "/a.lods", 4, move |_| Arc::clone(&file));
    crowd.tally.wait_for_good(200);
    crowd.stop();
    drop(idle);
}

#[test]
fn clients_that_send_a_byte_now_and_then_are_cut_off_and_keep_nobody_waiting() {
    let (_folder, server, file) = serve(|config| config.head_timeout = Duration::from_millis(300));
    let crowd = Crowd::start(server.addr(), "/a.lods", 2, move |_| Arc::clone(&file));
    let mut slow: Vec<_> = (0..200)
        .map(|_| {
            let mut stream = TcpStream::connect(server.addr()).expect("the server accepts");
            stream.write_all(b"GET /a.lods HTTP/1.1\r\nhost: x\r\nx-").expect("the server reads");
            stream
        })
        .collect();
    // Each is cut off though it never stops to send: writing fails in the end.
    for stream in &mut slow {
        while stream.write_all(b"y").is_ok() {
            // Slow is what they are.
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    crowd.tally.wait_for_good(50);
    crowd.stop();
}

#[test]
fn connections_of_http2_end_where_nothing_is_asked_or_taken() {
    let (_folder, server, _file) = serve(|config| {
        config.head_timeout = Duration::from_millis(300);
        config.write_timeout = Duration::from_millis(300);
    });
    // It never gets as far as a frame.
    let mut silent = TcpStream::connect(server.addr()).expect("the server accepts");
    silent.set_read_timeout(Some(Duration::from_secs(30))).expect("a time");
    silent.write_all(b"PRI * HTTP/2.0\r\n\r\n").expect("the server reads");
    let mut rest = Vec::new();
    // Closed, or reset: an error that is no timeout.
    let ended = silent.read_to_end(&mut rest).map_err(|e| e.kind());
    assert!(!matches!(ended, Err(ErrorKind::WouldBlock | ErrorKind::TimedOut)), "{ended:?}");

    // It answers every ping, and asks for nothing.
    let mut idle = FrameClient::connect(server.addr(), 65_535);
    let frames: Vec<u8> = std::iter::from_fn(|| idle.next()).collect();
    assert!(frames.contains(&GOAWAY), "it is told: {frames:?}");

    // It asks for a file and takes none of it.
    let mut stalled = FrameClient::connect(server.addr(), 0);
    stalled.get(1, "/a.lods").expect("the server reads");
    while stalled.next().is_some() {}
    assert_eq!(stalled.data_bytes, 0);

    // The same, however much it asks for and takes besides.
    let mut busy = FrameClient::connect(server.addr(), 0);
    busy.get(1, "/a.lods").expect("the server reads");
    for id in (3..).step_by(2) {
        assert!(id < 600, "it is kept though one response is not taken");
        if busy.get(id, "/healthz").and_then(|()| busy.allow(id, 1000)).is_err() {
            break;
        }
        let before = busy.data_bytes;
        let mut is_over = false;
        while busy.data_bytes == before && !is_over {
            is_over = busy.next().is_none_or(|kind| kind == GOAWAY);
        }
        if is_over {
            break;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn a_slow_client_of_http2_is_kept_as_long_as_it_takes_something() {
    let (_folder, server, _file) = serve(|config| {
        config.head_timeout = Duration::from_secs(2);
        config.write_timeout = Duration::from_secs(2);
    });
    let mut slow = FrameClient::connect(server.addr(), 0);
    slow.get(1, "/a.lods").expect("the server reads");
    // Longer than any time that is allowed.
    for step in 1..=60 {
        // The stream, and the connection that it shares.
        slow.allow(1, 1500).and_then(|()| slow.allow(0, 1500)).expect("the server reads");
        while slow.data_bytes < 1500 * step {
            let frame = slow.next();
            assert!(frame.is_some_and(|kind| kind != GOAWAY), "{frame:?} after {step} steps");
        }
        // Slow is what it is.
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn heads_and_lists_without_measure_are_refused_and_keep_nobody_waiting() {
    let (_folder, server, file) = serve(|_| {});
    let crowd = Crowd::start(server.addr(), "/a.lods", 2, move |_| Arc::clone(&file));
    let list = |count: usize, spec: fn(usize) -> String| {
        let specs: Vec<_> = (0..count).map(spec).collect();
        format!("range: bytes={}\r\n", specs.join(","))
    };
    for (what, fields, statuses) in [
        ("a field of 1 MiB", format!("x: {}\r\n", "y".repeat(1 << 20)), &["431", ""][..]),
        ("1,000 fields", "x: y\r\n".repeat(1000), &["431", ""]),
        ("1,000 ranges", list(1000, |i| format!("{0}-{0}", i * 300)), &["416"]),
        ("1,000 times everything", list(1000, |_| "0-".into()), &["416"]),
        ("256 times everything", list(256, |_| "0-".into()), &["206"]),
        ("no number", "range: bytes=0-1\u{0}\r\n".into(), &["400"]),
    ] {
        let mut stream = TcpStream::connect(server.addr()).expect("the server accepts");
        let request =
            format!("GET /a.lods HTTP/1.1\r\nhost: x\r\nconnection: close\r\n{fields}\r\n");
        // The server may close before it has taken everything.
        let _ = stream.write_all(request.as_bytes());
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        assert!(answer.len() < 2_100_000, "{what}: {} bytes", answer.len());
        let head = String::from_utf8_lossy(&answer[..answer.len().min(20)]).into_owned();
        let status = head.split(' ').nth(1).unwrap_or_default();
        assert!(statuses.contains(&status), "{what}: {head}");
    }
    crowd.tally.wait_for_good(50);
    crowd.stop();
}
