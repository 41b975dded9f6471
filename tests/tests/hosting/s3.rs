//! An S3 server: `moto`'s, a program in Python, in an environment of its own.

use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

use lodestream_tests::python_environment;
use reqwest::{Client, Method, StatusCode};

use crate::process::Process;

/// A running S3 server that holds everything in its memory.
pub struct S3 {
    pub endpoint: String,
    _process: Process,
}

/// One for all tests of this process: two must not make the environment at once.
fn interpreter() -> &'static Path {
    static INTERPRETER: OnceLock<PathBuf> = OnceLock::new();
    INTERPRETER.get_or_init(|| {
        python_environment("s3", "requirements-s3.txt").unwrap_or_else(|why| {
            panic!("an S3 server is installed from tests/python/requirements-s3.txt: {why}")
        })
    })
}

/// Any; it does not look at signatures, but wants to see one.
pub const SIGNED: &str = "AWS4-HMAC-SHA256 Credential=key/20260101/us-east-1/s3/aws4_request, \
                      SignedHeaders=host, Signature=none";

impl S3 {
    pub async fn start() -> Self {
        let mut command = Command::new(interpreter());
        command.args(["-u", "-m", "moto.server", "-H", "127.0.0.1", "-p", "0"]);
        let (process, endpoint) = Process::start(command, true, |line| {
            line.split_once("Running on ").map(|(_, url)| url.trim().to_owned())
        });
        let s3 = Self { endpoint, _process: process };
        s3.send(Method::PUT, "bucket", Vec::new()).await;
        s3
    }

    pub async fn put(&self, key: &str, bytes: Vec<u8>) {
        self.send(Method::PUT, &format!("bucket/{key}"), bytes).await;
    }

    pub async fn remove(&self, key: &str) {
        self.send(Method::DELETE, &format!("bucket/{key}"), Vec::new()).await;
    }

    async fn send(&self, method: Method, path: &str, body: Vec<u8>) {
        let request = Client::new().request(method, format!("{}/{path}", self.endpoint));
        let response = request.header("authorization", SIGNED).body(body).send().await;
        let status = response.expect("the S3 server answers").status();
        assert!([StatusCode::OK, StatusCode::NO_CONTENT].contains(&status), "{path}: {status}");
    }

    /// What the server's program needs to know of it.
    pub fn variables(&self) -> [(&'static str, String); 5] {
        [
            ("AWS_ENDPOINT", self.endpoint.clone()),
            ("AWS_ALLOW_HTTP", "true".into()),
            ("AWS_REGION", "us-east-1".into()),
            ("AWS_ACCESS_KEY_ID", "key".into()),
            ("AWS_SECRET_ACCESS_KEY", "hush".into()),
        ]
    }
}
