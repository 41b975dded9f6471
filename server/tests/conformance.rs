//! Every case of `conformance.json`, put to this server and to a real nginx.
//!
//! Ours must answer as RFC 9110 says, in every case. What nginx answers otherwise is told in
//! `docs/CONFORMANCE.md`, which is held to what both answer; to write it anew:
//! `LODESTREAM_WRITE_CONFORMANCE=1 cargo test -p lodestream-server --test conformance`.
#![cfg(unix)]

use std::{
    env,
    fmt::Write as _,
    fs,
    io::{Read, Write},
    net::{SocketAddr, TcpStream},
    path::Path,
    time::{Duration, SystemTime},
};

use lodestream_server::{ServeConfig, spawn};
use serde::Deserialize;

#[path = "http/file.rs"]
mod file;
#[path = "../../tests/nginx.rs"]
mod nginx;

use nginx::Nginx;

const LENGTH: usize = 10_000;

/// A request, and what is to come of it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    name: String,
    /// Of RFC 9110.
    section: String,
    #[serde(default = "get")]
    method: String,
    #[serde(default = "one_one")]
    version: String,
    /// Names and values; values may hold `{…}`, see [`Host::fill_in`].
    headers: Vec<(String, String)>,
    /// The status, and for 206 the ranges that come.
    expect: String,
}

fn get() -> String {
    "GET".into()
}

fn one_one() -> String {
    "1.1".into()
}

/// A server and what it told of the file.
struct Host {
    addr: SocketAddr,
    etag: String,
    modified: SystemTime,
    file: Vec<u8>,
}

#[derive(Debug)]
struct Answer {
    status: u16,
    fields: Vec<(String, String)>,
    body: Vec<u8>,
}

impl Answer {
    /// The one value of a field.
    fn field(&self, name: &str) -> Option<&str> {
        let mut values = self.fields.iter().filter(|(n, _)| n == name).map(|(_, v)| v.as_str());
        let value = values.next();
        assert_eq!(values.next(), None, "{name} comes twice");
        value
    }
}

impl Host {
    fn new(addr: SocketAddr, modified: SystemTime, file: &[u8]) -> Self {
        let mut host = Self { addr, etag: String::new(), modified, file: file.to_vec() };
        let case = Case {
            name: String::new(),
            section: String::new(),
            method: get(),
            version: one_one(),
            headers: Vec::new(),
            expect: String::new(),
        };
        let answer = host.ask(&case);
        assert_eq!(answer.field("last-modified"), Some(date(modified).as_str()));
        host.etag = answer.field("etag").expect("a tag").to_owned();
        host
    }

    /// Values that depend on the server or are too long to be written down.
    fn fill_in(&self, value: &str) -> String {
        let day = Duration::from_secs(86_400);
        let list = |count: &str, spec: &dyn Fn(u32) -> String| {
            let specs: Vec<_> = (0..count.parse().expect("a number")).map(spec).collect();
            format!("bytes={}", specs.join(","))
        };
        match value.strip_prefix('{').and_then(|v| v.strip_suffix('}')) {
            Some("modified") => date(self.modified),
            Some("earlier") => date(self.modified - day),
            Some("later") => date(self.modified + day),
            Some("modified:850") => "Sunday, 06-Nov-94 08:49:37 GMT".into(),
            Some("modified:asctime") => "Sun Nov  6 08:49:37 1994".into(),
            Some("bare") => self.etag.trim_matches('"').into(),
            Some(list_of) if list_of.starts_with("steps:") => {
                list(&list_of[6..], &|i| format!("{0}-{0}", 30 * i))
            }
            Some(list_of) if list_of.starts_with("list:") => {
                let (count, spec) = list_of[5..].split_once(':').expect("count:spec");
                list(count, &|_| spec.to_owned())
            }
            _ => value.replace("{etag}", &self.etag),
        }
    }

    fn ask(&self, case: &Case) -> Answer {
        let mut request = format!("{} /a.lods HTTP/{}\r\nHost: x\r\n", case.method, case.version);
        for (name, value) in &case.headers {
            let _ = write!(request, "{name}: {}\r\n", self.fill_in(value));
        }
        request += "Connection: close\r\n\r\n";
        let mut stream = TcpStream::connect(self.addr).expect("the server accepts");
        stream.write_all(request.as_bytes()).expect("the server reads");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("the server answers and closes");
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n").expect("a head");
        let body = bytes.split_off(end + 4);
        let head = String::from_utf8(bytes).expect("ASCII");
        let mut lines = head.trim_end().split("\r\n");
        let status = lines.next().and_then(|line| line.split(' ').nth(1)?.parse().ok());
        let field = |line: &str| {
            let (name, value) = line.split_once(':').expect("a field");
            (name.to_ascii_lowercase(), value.trim().to_owned())
        };
        let fields = lines.map(field).collect();
        Answer { status: status.expect("a status"), fields, body }
    }

    /// What an answer comes to, in the words of [`Case::expect`]; what is wrong with it otherwise.
    fn summary(&self, case: &Case, answer: &Answer) -> String {
        let status = answer.status;
        let length = answer.field("content-length").and_then(|v| v.parse::<usize>().ok());
        let is_head = case.method == "HEAD";
        let may_lack_length = [204, 304].contains(&status);
        if !may_lack_length && length.is_none() {
            return format!("{status} without Content-Length");
        }
        if !is_head && !may_lack_length && length != Some(answer.body.len()) {
            return format!("{status} with another Content-Length");
        }
        if (is_head || may_lack_length) && !answer.body.is_empty() {
            return format!("{status} with a body");
        }
        if [200, 206, 304].contains(&status) && answer.field("etag").is_none() {
            return format!("{status} without ETag");
        }
        let total = self.file.len();
        match status {
            200 if is_head && length == Some(total) => "200".into(),
            200 if !is_head && answer.body == self.file => "200".into(),
            200 => "200 with other bytes".into(),
            206 => self.parts(answer).map_or_else(|e| format!("206 {e}"), |p| format!("206 {p}")),
            416 if answer.field("content-range") != Some(&format!("bytes */{total}")) => {
                "416 without the length".into()
            }
            405 if answer.field("allow").is_none() => "405 without Allow".into(),
            204 if answer.field("allow").is_none() => "204 without Allow".into(),
            other => other.to_string(),
        }
    }

    fn parts(&self, answer: &Answer) -> Result<String, String> {
        let content_type = answer.field("content-type").unwrap_or_default();
        let Some(boundary) = content_type.strip_prefix("multipart/byteranges; boundary=") else {
            let range = answer.field("content-range").ok_or("without Content-Range")?;
            return self.check(range, &answer.body);
        };
        if answer.field("content-range").is_some() {
            return Err("with Content-Range beside parts".into());
        }
        let mut rest = &answer.body[..];
        let mut ranges = Vec::new();
        loop {
            let line = format!("\r\n--{boundary}");
            rest = rest.strip_prefix(line.as_bytes()).ok_or("without a boundary")?;
            if rest == b"--\r\n" {
                return Ok(ranges.join(","));
            }
            let end = rest.windows(4).position(|w| w == b"\r\n\r\n").ok_or("without a head")?;
            let head = String::from_utf8_lossy(&rest[..end]).to_ascii_lowercase();
            rest = &rest[end + 4..];
            if !head.contains("\r\ncontent-type: application/octet-stream") {
                return Err("without a part's type".into());
            }
            let range = head.split("\r\n").find_map(|l| l.strip_prefix("content-range: "));
            let range = range.ok_or("without a part's range")?;
            let (first, last) = bounds(range).ok_or("with a malformed range")?;
            let (part, later) = rest.split_at((last + 1 - first).min(rest.len()));
            ranges.push(self.check(range, part)?);
            rest = later;
        }
    }

    fn check(&self, range: &str, body: &[u8]) -> Result<String, String> {
        let (first, last) = bounds(range).ok_or("with a malformed range")?;
        let is_of_file = range.ends_with(&format!("/{}", self.file.len()));
        if !is_of_file || self.file.get(first..=last) != Some(body) {
            return Err("with other bytes".into());
        }
        Ok(format!("{first}-{last}"))
    }
}

/// First and last of `bytes FIRST-LAST/TOTAL`.
fn bounds(range: &str) -> Option<(usize, usize)> {
    let (range, _) = range.strip_prefix("bytes ")?.split_once('/')?;
    let (first, last) = range.split_once('-')?;
    Some((first.parse().ok()?, last.parse().ok()?))
}

fn date(time: SystemTime) -> String {
    httpdate::fmt_http_date(time)
}

#[test]
fn every_case_is_answered_as_the_rfc_says_and_nginx_as_the_document_says() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.lods");
    let file = file::dataset(1, LENGTH - file::dataset(1, 0).len());
    assert_eq!(file.len(), LENGTH);
    fs::write(&path, &file).expect("writable");
    let modified = httpdate::parse_http_date("Sun, 06 Nov 1994 08:49:37 GMT").expect("a date");
    let opened = fs::File::options().write(true).open(&path).expect("writable");
    opened.set_modified(modified).expect("its owner may");

    let here = SocketAddr::from(([127, 0, 0, 1], 0));
    let server = spawn(ServeConfig::new(folder.path(), here)).expect("port 0 is free");
    let rival = Nginx::start(folder.path()).expect("nginx");
    let ours = Host::new(server.addr(), modified, &file);
    let theirs = Host::new(rival.addr, modified, &file);

    let cases: Vec<Case> =
        serde_json::from_str(include_str!("conformance.json")).expect("a list of cases");
    assert!(cases.len() >= 60);
    let mut wrong = Vec::new();
    let mut rows = String::new();
    let mut differing = 0;
    for case in &cases {
        let found = ours.summary(case, &ours.ask(case));
        if found != case.expect {
            wrong.push(format!("{}: {found}, not {}", case.name, case.expect));
        }
        let nginx = theirs.summary(case, &theirs.ask(case));
        if nginx != case.expect {
            differing += 1;
        }
        let shown = match nginx.split(',').count() {
            _ if nginx == case.expect => String::new(),
            parts if parts > 5 => format!("206 in {parts} parts"),
            _ => nginx,
        };
        let fields: Vec<_> = case.headers.iter().map(|(n, v)| format!("`{n}: {v}`")).collect();
        let _ = writeln!(
            rows,
            "| {} | {} | {} | {} | {} |",
            case.name,
            fields.join(" "),
            case.expect,
            shown,
            case.section
        );
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let version = Nginx::version().expect("nginx");
    let document = include_str!("conformance.md.in")
        .replace("{cases}", &cases.len().to_string())
        .replace("{differing}", &differing.to_string())
        .replace("{nginx}", &version)
        .replace("{rows}", rows.trim_end());
    hold_to(&document, &version);
}

/// Holds `docs/CONFORMANCE.md` to what was found.
fn hold_to(document: &str, version: &str) {
    let place = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/CONFORMANCE.md");
    if env::var_os("LODESTREAM_WRITE_CONFORMANCE").is_some() {
        return fs::write(place, document).expect("writable");
    }
    let written = fs::read_to_string(place).expect("the document");
    // Another version of nginx may answer otherwise: then only our answers are held.
    if written.contains(version) {
        assert!(
            written == document,
            "docs/CONFORMANCE.md is out of date; see the head of this test"
        );
    }
}
