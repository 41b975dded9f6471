//! Names that try to lead out of the folder.

use std::{
    fs,
    io::{Read, Write},
    net::TcpStream,
};

use crate::support::{Site, dataset};

/// Sends a path as it is, which no client library would, and returns the response.
fn raw_get(site: &Site, path: &str) -> String {
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    let request = format!("GET {path} HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n");
    stream.write_all(request.as_bytes()).expect("the server reads");
    let mut response = Vec::new();
    stream.read_to_end(&mut response).expect("the server closes");
    String::from_utf8_lossy(&response).into_owned()
}

#[test]
fn no_name_leads_out_of_the_folder() {
    let site = Site::new();
    let outside = tempfile::tempdir().expect("a temporary folder");
    let secret = outside.path().join("secret.lods");
    fs::write(&secret, dataset(1, 10)).expect("writable");
    fs::create_dir(site.path("sub")).expect("a new name");
    site.put("sub/inner.lods", &dataset(2, 10));
    let up = outside.path().file_name().and_then(|name| name.to_str()).expect("a plain name");
    let absolute = secret.display().to_string().replace('/', "%2f");
    for path in [
        format!("/datasets/../{up}/secret.lods"),
        format!("/datasets/..%2f{up}%2fsecret.lods"),
        format!("/datasets/%2e%2e%2f{up}%2fsecret.lods"),
        format!("/datasets/..%5c{up}%5csecret.lods"),
        format!("/../{up}/secret.lods"),
        format!("/..%2f{up}%2fsecret.lods"),
        format!("/datasets/{absolute}"),
        format!("/{}", secret.display()),
        "/datasets/sub/inner.lods".into(),
        "/datasets/sub%2finner.lods".into(),
        "/datasets/.%2fsub%2finner.lods".into(),
        "/datasets/a%00.lods".into(),
        "/datasets/%ff.lods".into(),
        "/datasets/..lods".into(),
        "/datasets/.lods".into(),
        "/datasets/".into(),
        format!("/datasets/{}.lods", "a".repeat(300)),
    ] {
        let response = raw_get(&site, &path);
        let status = response.split(' ').nth(1).unwrap_or_default();
        assert!(["404", "400"].contains(&status), "{path}: {response}");
        assert!(!response.contains("LODS"), "{path} brought a dataset");
    }
}

#[tokio::test]
async fn a_link_in_the_folder_is_served() {
    let (site, bytes) = Site::with_dataset();
    let outside = tempfile::tempdir().expect("a temporary folder");
    let elsewhere = outside.path().join("elsewhere");
    fs::write(&elsewhere, &bytes).expect("writable");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&elsewhere, site.path("link.lods")).expect("a new name");
        let body = site.get("/link.lods", &[]).await.bytes().await.expect("a body");
        assert!(body == bytes);
        std::os::unix::fs::symlink("/dev/zero", site.path("device.lods")).expect("a new name");
        assert_eq!(site.get("/device.lods", &[]).await.status(), 404);
    }
}

#[tokio::test]
async fn names_with_blanks_and_signs_are_reached_through_the_index() {
    let site = Site::new();
    let bytes = dataset(1, 10);
    site.put("a b?#%é&<x>.lods", &bytes);
    let index = site.json("/datasets").await;
    let url = index["datasets"][0]["url"].as_str().expect("an address").to_owned();
    let body = site.get(&format!("/{url}"), &[]).await.bytes().await.expect("a body");
    assert!(body == bytes);
}

#[test]
fn a_request_names_its_host_once() {
    let (site, _) = Site::with_dataset();
    for (version, hosts, status) in [
        ("1.1", "", "400"),
        ("1.1", "host: a\r\nhost: b\r\n", "400"),
        ("1.1", "host: a\r\n", "206"),
        ("1.0", "", "206"),
    ] {
        let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
        let request = format!(
            "GET /a.lods HTTP/{version}\r\n{hosts}range: bytes=0-9\r\nconnection: close\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).expect("the server reads");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        let first = String::from_utf8_lossy(&answer).lines().next().map(str::to_owned);
        assert!(
            first.as_ref().is_some_and(|line| line.contains(status)),
            "{version} {hosts:?}: {first:?}"
        );
    }
}
