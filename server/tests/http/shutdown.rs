//! Limits on clients, and the end of the server.

use std::{
    io::{ErrorKind, Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    time::Duration,
};

use lodestream_server::{Error, ServeConfig, spawn};

use crate::support::{Site, dataset};

#[tokio::test]
async fn a_response_under_way_ends_after_the_server_was_asked_to_stop() {
    let site = Site::configured(|config| config.drain_timeout = Duration::MAX);
    let bytes = dataset(1, 32 << 20);
    site.put("big.lods", &bytes);
    let mut response = site.get("/big.lods", &[]).await;
    let mut body = response.chunk().await.expect("a first piece").expect("not the end").to_vec();
    let Site { folder, server, .. } = site;
    let addr = server.addr();
    let stopping = std::thread::spawn(move || server.stop());
    while let Some(piece) = response.chunk().await.expect("the response goes on") {
        body.extend_from_slice(&piece);
    }
    assert!(body == bytes);
    drop(response);
    stopping.join().expect("no panic").expect("a clean stop");
    assert!(TcpStream::connect(addr).is_err(), "it still accepts");
    drop(folder);
}

#[test]
fn a_client_that_takes_nothing_does_not_keep_the_server() {
    let site = Site::configured(|config| config.drain_timeout = Duration::from_millis(50));
    site.put("big.lods", &dataset(1, 32 << 20));
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.write_all(b"GET /big.lods HTTP/1.1\r\nhost: x\r\n\r\n").expect("the server reads");
    stream.read_exact(&mut [0; 100]).expect("the response begins");
    site.server.stop().expect("a clean stop");
    let mut rest = Vec::new();
    let outcome = stream.read_to_end(&mut rest);
    assert!(rest.len() < 32 << 20, "{outcome:?}");
}

#[test]
fn a_client_that_takes_nothing_is_cut_off() {
    let site = Site::configured(|config| {
        config.write_timeout = Duration::from_millis(50);
        config.drain_timeout = Duration::MAX;
    });
    site.put("big.lods", &dataset(1, 32 << 20));
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.write_all(b"GET /big.lods HTTP/1.1\r\nhost: x\r\n\r\n").expect("the server reads");
    // Stopping waits for the response, and for nothing else: it returns because that was cut off.
    site.server.stop().expect("a clean stop");
    let mut rest = Vec::new();
    let outcome = stream.read_to_end(&mut rest);
    assert!(rest.len() < 32 << 20, "{outcome:?}");
}

#[test]
fn a_client_that_never_ends_its_head_is_cut_off() {
    let site = Site::configured(|config| config.head_timeout = Duration::from_millis(50));
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.write_all(b"GET / HTTP/1.1\r\nhost:").expect("the server reads");
    // Returns only because the server closes the connection.
    let mut rest = Vec::new();
    let outcome = stream.read_to_end(&mut rest);
    assert!(outcome.is_ok() || outcome.is_err_and(|e| e.kind() == ErrorKind::ConnectionReset));
}

#[test]
fn a_head_beyond_all_measure_is_refused() {
    let site = Site::new();
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    let huge = format!("GET / HTTP/1.1\r\nhost: x\r\nx: {}\r\n\r\n", "y".repeat(1 << 20));
    // The server may close before it has taken everything.
    let _ = stream.write_all(huge.as_bytes());
    let mut response = [0; 12];
    if stream.read_exact(&mut response).is_ok() {
        assert_eq!(&response, b"HTTP/1.1 431");
    }
}

#[test]
fn connections_beyond_the_limit_wait_for_their_turn() {
    const REQUEST: &[u8] = b"GET /healthz HTTP/1.1\r\nhost: x\r\n\r\n";
    let site = Site::configured(|config| config.max_connections = 1);
    let connect = || TcpStream::connect(site.server.addr()).expect("the system queues it");
    let mut status = [0; 12];
    let mut first = connect();
    first.write_all(REQUEST).expect("the server reads");
    first.read_exact(&mut status).expect("the server answers");
    let mut second = connect();
    second.write_all(REQUEST).expect("queued");
    second.set_read_timeout(Some(Duration::from_millis(50))).expect("a valid time");
    assert!(second.read_exact(&mut status).is_err(), "it did not wait");
    drop(first);
    second.set_read_timeout(None).expect("a valid time");
    second.read_exact(&mut status).expect("its turn has come");
    assert_eq!(&status, b"HTTP/1.1 200");
}

#[test]
fn what_cannot_be_served_is_said_at_once() {
    let free = SocketAddr::from(([127, 0, 0, 1], 0));
    let missing = spawn(ServeConfig::new("no/such/folder", free));
    assert!(matches!(missing, Err(Error::Folder { .. })), "{missing:?}");
    let taken = TcpListener::bind(free).expect("a free port");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let addr = taken.local_addr().expect("bound");
    let busy = spawn(ServeConfig::new(folder.path(), addr));
    assert!(matches!(busy, Err(Error::Listen { .. })), "{busy:?}");
}
