//! A served folder.

use std::{
    fs,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::PathBuf,
};

use lodestream_server::{RunningServer, ServeConfig, spawn};
use reqwest::{Method as HttpMethod, Response, header::HeaderMap};

pub use crate::file::dataset;

/// A server over a temporary folder.
pub struct Site {
    pub folder: tempfile::TempDir,
    pub server: RunningServer,
    client: reqwest::Client,
}

impl Site {
    pub fn new() -> Self {
        Self::configured(|_| {})
    }

    pub fn configured(change: impl FnOnce(&mut ServeConfig)) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut config = ServeConfig::new(folder.path(), SocketAddr::from(([127, 0, 0, 1], 0)));
        change(&mut config);
        let server = spawn(config).expect("port 0 is free");
        // Built together with the client, reqwest has TLS and asks for a provider, used or not.
        let _ = rustls::crypto::ring::default_provider().install_default();
        Self { folder, server, client: reqwest::Client::new() }
    }

    /// With one dataset `a.lods` of about 700 KB, which is several pieces; returns its bytes.
    pub fn with_dataset() -> (Self, Vec<u8>) {
        let site = Self::new();
        let bytes = dataset(1, 700_000);
        site.put("a.lods", &bytes);
        (site, bytes)
    }

    pub fn put(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).expect("the folder is writable");
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub async fn send(&self, method: HttpMethod, path: &str, fields: &[(&str, &str)]) -> Response {
        self.send_body(method, path, fields, Vec::new()).await
    }

    pub async fn send_body(
        &self,
        method: HttpMethod,
        path: &str,
        fields: &[(&str, &str)],
        body: Vec<u8>,
    ) -> Response {
        let mut request = self.client.request(method, format!("{}{path}", self.server.url()));
        for (name, value) in fields {
            request = request.header(*name, *value);
        }
        request.body(body).send().await.expect("the server answers")
    }

    pub async fn get(&self, path: &str, fields: &[(&str, &str)]) -> Response {
        self.send(HttpMethod::GET, path, fields).await
    }

    pub async fn json(&self, path: &str) -> serde_json::Value {
        let text = self.get(path, &[]).await.text().await.expect("a body");
        serde_json::from_str(&text).expect("JSON")
    }
}

/// A field's value; nothing where it is absent.
pub fn field<'a>(headers: &'a HeaderMap, name: &str) -> &'a str {
    headers.get(name).map_or("", |value| value.to_str().expect("text"))
}

/// Head and body of the answer to a `GET`, on a connection that stays open.
pub fn ask(stream: &mut TcpStream, path: &str, fields: &str) -> (Vec<String>, Vec<u8>) {
    let request = format!("GET {path} HTTP/1.1\r\nhost: x\r\n{fields}\r\n");
    stream.write_all(request.as_bytes()).expect("the server reads");
    answer(stream)
}

/// The head's lines, sorted, without the date.
pub fn answer(stream: &mut TcpStream) -> (Vec<String>, Vec<u8>) {
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte).expect("the server answers");
        head.push(byte[0]);
    }
    let head = String::from_utf8(head).expect("ASCII");
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
    let mut body = vec![0; length.expect("a length").parse().expect("a number")];
    stream.read_exact(&mut body).expect("the server answers");
    let lines = head.lines().filter(|line| !line.starts_with("date: "));
    let mut lines: Vec<_> = lines.map(|line| line.trim_end().to_owned()).collect();
    lines.sort();
    (lines, body)
}
