//! Encrypted connections.

use std::{fs, path::Path};

use lodestream_server::{Error, TlsFiles};
use rcgen::{CertifiedKey, generate_simple_self_signed};
use reqwest::{Client, Version, tls::Certificate};

use crate::support::{Site, dataset};

/// Writes a new certificate and its key; returns what a client needs to believe it.
fn write_certificate(files: &TlsFiles) -> Certificate {
    let CertifiedKey { cert, signing_key } =
        generate_simple_self_signed(["localhost".to_owned()]).expect("a certificate");
    fs::write(&files.cert, cert.pem()).expect("writable");
    fs::write(&files.key, signing_key.serialize_pem()).expect("writable");
    Certificate::from_pem(cert.pem().as_bytes()).expect("a certificate")
}

fn files(folder: &Path) -> TlsFiles {
    TlsFiles { cert: folder.join("cert.pem"), key: folder.join("key.pem") }
}

fn client(site: &Site, believed: Certificate) -> reqwest::ClientBuilder {
    Client::builder().tls_certs_only([believed]).resolve("localhost", site.server.addr())
}

fn url(site: &Site, path: &str) -> String {
    format!("https://localhost:{}{path}", site.server.addr().port())
}

#[tokio::test]
async fn datasets_come_encrypted_by_http_2_and_by_http_1() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = files(folder.path());
    let believed = write_certificate(&files);
    let site = Site::configured(|config| config.tls = Some(files.clone()));
    assert!(site.server.url().starts_with("https://"));
    let bytes = dataset(1, 700_000);
    site.put("a.lods", &bytes);
    let two = client(&site, believed.clone()).build().expect("a client");
    let one = client(&site, believed).http1_only().build().expect("a client");
    for (client, version) in [(two, Version::HTTP_2), (one, Version::HTTP_11)] {
        let response = client.get(url(&site, "/a.lods")).send().await.expect("an answer");
        assert_eq!((response.status().as_u16(), response.version()), (200, version));
        assert!(response.bytes().await.expect("a body") == bytes);
    }
    let page = format!("https://localhost:{}/datasets/<wbr>a.lods", site.server.addr().port());
    let client = client(&site, write_certificate(&files)).build().expect("a client");
    assert!(client.get(url(&site, "/")).send().await.is_err(), "the new one is not in use yet");
    site.server.control().reload_tls().expect("a sound certificate");
    let text = client.get(url(&site, "/")).send().await.expect("it is now").text().await;
    assert!(text.expect("a page").contains(&page), "addresses are those that clients see");
    fs::write(&files.cert, "nonsense").expect("writable");
    assert!(matches!(site.server.control().reload_tls(), Err(Error::Tls { .. })));
    assert!(client.get(url(&site, "/")).send().await.is_ok(), "the old one stays");
}

#[tokio::test]
async fn http_2_is_spoken_without_encryption_too_to_who_begins_with_it() {
    let (site, bytes) = Site::with_dataset();
    let client = Client::builder().http2_prior_knowledge().build().expect("a client");
    let response = client.get(format!("{}/a.lods", site.server.url())).send().await;
    let response = response.expect("an answer");
    assert_eq!(response.version(), Version::HTTP_2);
    assert!(response.bytes().await.expect("a body") == bytes);
}

#[test]
fn a_certificate_that_cannot_be_used_is_said_at_once() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let files = files(folder.path());
    let start = |files: &TlsFiles| {
        let address = std::net::SocketAddr::from(([127, 0, 0, 1], 0));
        let mut config = lodestream_server::ServeConfig::new(folder.path(), address);
        config.tls = Some(files.clone());
        lodestream_server::spawn(config).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(start(&files).contains("cert.pem"), "it is not there");
    write_certificate(&files);
    assert_eq!(start(&files), "");
    fs::write(&files.key, "").expect("writable");
    assert!(start(&files).contains("key.pem"), "it is empty");
    let other = TlsFiles { key: folder.path().join("other.pem"), ..files.clone() };
    let elsewhere = TlsFiles { cert: folder.path().join("other-cert.pem"), ..other.clone() };
    write_certificate(&elsewhere);
    write_certificate(&files);
    assert!(start(&other).contains("cannot be used with the key"), "{}", start(&other));
}
