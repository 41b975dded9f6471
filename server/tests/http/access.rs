//! Attempts to read what one may not: the table `access.json`, all refused.

use std::{
    collections::BTreeMap,
    fs,
    io::{Read, Write},
    net::TcpStream,
    time::{Duration, SystemTime, UNIX_EPOCH},
};

use lodestream_protocol::Header;
use lodestream_server::access::{
    Access, AccessRules, DatasetPattern, Link, Secret, TokenHash, TokenRule, sign,
};
use serde::Deserialize;

use crate::support::{Site, dataset, field};

const TEAM: &str = "team-token-of-more-than-22-bytes";
const ROOT: &str = "root-token-of-more-than-22-bytes";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Attempt {
    attempt: String,
    /// What stands in the request's first line, byte by byte.
    target: String,
    method: Option<String>,
    #[serde(default)]
    fields: BTreeMap<String, String>,
    /// The only right answer; otherwise any that refuses.
    status: Option<u16>,
    /// Whether the answer must not even have a secret's name.
    #[serde(default)]
    silent: bool,
}

fn key(byte: u8) -> Secret {
    Secret::new(vec![byte; 32])
}

fn pattern(text: &str) -> DatasetPattern {
    text.parse().expect(text)
}

fn rules() -> AccessRules {
    let rule = |name: &str, token: &str, datasets: &[&str], metrics| TokenRule {
        name: name.into(),
        hash: TokenHash::of_new(token).expect("long enough"),
        datasets: datasets.iter().map(|text| pattern(text)).collect(),
        metrics,
    };
    AccessRules {
        public: vec![pattern("open")],
        tokens: vec![rule("team", TEAM, &["team-1"], false), rule("root", ROOT, &["*"], true)],
        signing_keys: vec![key(1)],
    }
}

fn site() -> Site {
    site_with(Access::Rules(rules()))
}

/// A folder with what everyone may read and what not, and a file beside it.
fn site_with(access: Access) -> Site {
    let site = Site::configured(|config| {
        // One level down, so that something can lie beside it.
        let dir = match &config.data {
            lodestream_server::DataPlace::Folder(dir) => dir.join("served"),
            lodestream_server::DataPlace::Objects(_) => unreachable!("a folder was given"),
        };
        fs::create_dir_all(dir.join("below")).expect("writable");
        config.data = lodestream_server::DataPlace::Folder(dir);
        config.access = access;
    });
    for (seed, name) in (1..).zip([
        "served/open.lods",
        "served/open2.lods",
        "served/secret.lods",
        "served/team-1.lods",
        "served/team-secret.lods",
        "served/.hidden.lods",
        "served/below/inner.lods",
        "served/part.lods.part",
        "outside.lods",
    ]) {
        site.put(name, &dataset(seed, 1000));
    }
    site.put("served/broken.lods", b"no dataset");
    site.put("served/secret.preview.png", b"LODS");
    #[cfg(unix)]
    std::os::unix::fs::symlink(site.path("outside.lods"), site.path("served/link.lods"))
        .expect("a new name");
    site
}

fn seconds(ahead: i64) -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_secs();
    now.saturating_add_signed(ahead)
}

/// Puts what the table cannot know in place of `{…}`.
fn filled(text: &str, site: &Site, expires: u64) -> String {
    let link = |datasets: &str, expires: u64, signing: u8| {
        sign(&Link { datasets: pattern(datasets), expires }, &key(signing))
    };
    let signature = |datasets: &str| {
        let query = link(datasets, expires, 1);
        query.rsplit_once("signature=").expect("signed").1.to_owned()
    };
    let secret = fs::read(site.path("served/secret.lods")).expect("there");
    let (mut rest, mut out) = (text, String::new());
    while let Some((before, after)) = rest.split_once('{') {
        let (name, after) = after.split_once('}').expect("closed");
        out += before;
        out += &match name.split_once(':').unwrap_or((name, "")) {
            ("team", _) => TEAM.to_owned(),
            ("root", _) => ROOT.to_owned(),
            ("root-short", _) => ROOT[..ROOT.len() - 1].to_owned(),
            ("root-capital", _) => ROOT.to_uppercase(),
            ("root-hash", _) => TokenHash::of_new(ROOT).expect("long enough").to_hex(),
            ("id", _) => Header::parse(&secret).expect("sound").content_id_hex(),
            ("expires", _) => expires.to_string(),
            ("long", _) => "a".repeat(5000),
            ("ups", _) => "..%2f".repeat(500),
            ("link", datasets) => link(datasets, expires, 1),
            ("foreign", datasets) => link(datasets, expires, 2),
            ("expired", datasets) => link(datasets, seconds(-1), 1),
            ("signature", datasets) => signature(datasets),
            ("half", datasets) => signature(datasets)[..20].to_owned(),
            (unknown, _) => panic!("{unknown} is no filler"),
        };
        rest = after;
    }
    out + rest
}

/// Sends the bytes as they are, which no client library would, and returns the response.
fn send(site: &Site, request: &str) -> Vec<u8> {
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a valid time");
    stream.write_all(request.as_bytes()).expect("the server reads");
    let mut response = Vec::new();
    stream.read_to_end(&mut response).expect("the server closes");
    response
}

#[test]
fn every_attempt_of_the_table_is_refused() {
    let failures = failures(&site());
    assert!(failures.is_empty(), "{} attempts:\n{}", failures.len(), failures.join("\n---\n"));
}

#[test]
fn the_table_notices_a_server_without_rules() {
    let failures = failures(&site_with(Access::Open));
    assert!(failures.len() > 40, "only {} attempts are noticed", failures.len());
}

/// What of the table is not refused as it should be.
fn failures(site: &Site) -> Vec<String> {
    let attempts: Vec<Attempt> =
        serde_json::from_str(include_str!("../access.json")).expect("the table is sound");
    assert!(attempts.len() >= 40);
    let expires = seconds(3600);
    let mut failures = Vec::new();
    for attempt in &attempts {
        let fill = |text: &str| filled(text, site, expires);
        let method = attempt.method.as_deref().unwrap_or("GET");
        let mut request = format!("{method} {} HTTP/1.1\r\n", fill(&attempt.target));
        if !attempt.fields.contains_key("host") {
            request += "host: localhost\r\n";
        }
        for (name, value) in &attempt.fields {
            request += &format!("{name}: {}\r\n", fill(value));
        }
        let response = send(site, &(request + "connection: close\r\n\r\n"));
        let text = String::from_utf8_lossy(&response);
        let status: u16 = text.get(9..12).and_then(|s| s.parse().ok()).unwrap_or(0);
        let is_right = match attempt.status {
            Some(right) => status == right,
            None => [400, 401, 404, 405, 414, 431].contains(&status),
        };
        // Datasets begin with these letters, and so does the false preview.
        let leaks = text.contains("LODS\r") || text.contains("\r\n\r\nLODS");
        let named = attempt.silent
            && ["secret", "team-1", "broken"].iter().any(|name| {
                text.contains(name)
                    && !(*name == "team-1" && attempt.fields.contains_key("authorization"))
            });
        if !is_right || leaks || named || text.to_lowercase().contains("\r\netag:") && status != 200
        {
            failures.push(format!(
                "{}: {request_line}\n{text}",
                attempt.attempt,
                request_line = fill(&attempt.target)
            ));
        }
    }
    failures
}

#[tokio::test]
async fn who_may_read_does() {
    let (site, expires) = (site(), seconds(3600));
    let root = ("authorization", &*format!("Bearer {ROOT}"));
    let team = ("authorization", &*format!("bearer {TEAM}"));
    assert_eq!(site.get("/open.lods", &[]).await.status(), 200);
    for name in ["open", "open2", "secret", "team-1", "team-secret", "link"] {
        let response = site.get(&format!("/datasets/{name}.lods"), &[root]).await;
        assert_eq!(response.status(), 200, "{name}");
    }
    assert_eq!(site.get("/team-1.lods", &[team]).await.status(), 200);
    assert_eq!(site.get("/metrics", &[root]).await.status(), 200);
    for target in [
        "/datasets/secret.lods?{link:secret}",
        "/secret.lods?{link:sec*}",
        "/secret.lods?v={id}&{link:*}",
    ] {
        assert_eq!(site.get(&filled(target, &site, expires), &[]).await.status(), 200, "{target}");
    }
    let names = async |target: &str, fields: &[(&str, &str)]| {
        let text = site.get(target, fields).await.text().await.expect("a list");
        let index: lodestream_server::DatasetIndex = serde_json::from_str(&text).expect("JSON");
        let names: Vec<_> = index.datasets.into_iter().map(|d| (d.name, d.url)).collect();
        let unreadable: Vec<_> = index.unreadable.into_iter().map(|u| u.file).collect();
        (names, unreadable)
    };
    let only = |name: &str, url: &str| (name.to_owned(), url.to_owned());
    assert_eq!(names("/datasets", &[]).await.0, [only("open", "datasets/open.lods")]);
    let (all, unreadable) = names("/datasets", &[root]).await;
    assert_eq!((all.len(), unreadable), (6, vec!["broken.lods".to_owned()]));
    // The list of a link's holder has addresses that work.
    let (linked, _) = names(&filled("/datasets?x=1&{link:secret}", &site, expires), &[]).await;
    assert_eq!(linked.len(), 2);
    let response = site.get(&format!("/{}", linked[1].1), &[]).await;
    assert_eq!((linked[1].0.as_str(), response.status().as_u16()), ("secret", 200));
}

#[tokio::test]
async fn a_forbidden_dataset_answers_as_a_missing_one() {
    let site = site();
    for path in ["/datasets/NAME.lods", "/NAME.lods", "/datasets/NAME.lods/preview.png"] {
        let mut answers = Vec::new();
        for name in ["secret", "absent", "broken"] {
            let response = site.get(&path.replace("NAME", name), &[]).await;
            let head = format!("{:?} {:?}", response.status(), {
                let mut headers = response.headers().clone();
                headers.remove("date");
                headers.remove("content-length");
                headers
            });
            let body = response.text().await.expect("a line");
            answers.push(format!("{head} {}", body.replace(name, "NAME")));
        }
        assert!(answers.iter().all(|answer| *answer == answers[0]), "{answers:#?}");
    }
}

#[tokio::test]
async fn a_forbidden_dataset_is_not_even_looked_at() {
    // So the time that the answer takes cannot tell whether there is one.
    let site = site();
    fs::remove_dir_all(site.path("served")).expect("ours");
    assert_eq!(site.get("/datasets", &[]).await.status(), 503);
    let root = ("authorization", &*format!("Bearer {ROOT}"));
    assert_eq!(site.get("/secret.lods", &[root]).await.status(), 404);
    assert_eq!(site.get("/secret.lods", &[]).await.status(), 404);
}

#[tokio::test]
async fn caches_in_between_keep_nothing_for_others() {
    let site = site();
    let root = ("authorization", &*format!("Bearer {ROOT}"));
    let link = filled("/secret.lods?{link:secret}", &site, seconds(3600));
    for (target, fields) in [("/secret.lods", &[root][..]), (&link, &[]), ("/datasets", &[root])] {
        let response = site.get(target, fields).await;
        let kept = field(response.headers(), "cache-control").to_owned();
        assert!(kept.contains("private") && !kept.contains("public"), "{target}: {kept}");
        let mut varies = response.headers().get_all("vary").iter();
        assert!(varies.any(|field| field == "authorization"), "{target}");
    }
    let response = site.get("/open.lods", &[]).await;
    assert!(field(response.headers(), "cache-control").contains("public"), "everyone's");
}

#[tokio::test]
async fn rules_can_change_while_the_server_runs() {
    let site = site();
    assert_eq!(site.get("/secret.lods", &[]).await.status(), 404);
    let mut changed = rules();
    changed.public.push(pattern("secret"));
    site.server.control().set_access(Access::Rules(changed)).expect("loopback");
    assert_eq!(site.get("/secret.lods", &[]).await.status(), 200);
}

#[test]
fn an_address_that_others_reach_needs_rules_or_a_word() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let anywhere = std::net::SocketAddr::from(([0, 0, 0, 0], 0));
    let config = lodestream_server::ServeConfig::new(folder.path(), anywhere);
    let refused = lodestream_server::spawn(config.clone());
    assert!(matches!(refused, Err(lodestream_server::Error::Exposed { .. })), "{refused:?}");
    // What is allowed is not tried: tests listen on this machine alone.
}

#[test]
fn a_connection_that_stands_when_rules_come_is_held_to_them() {
    let site = site_with(Access::Open);
    let mut stream = TcpStream::connect(site.server.addr()).expect("the server accepts");
    stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a valid time");
    // Nothing but what the short way takes.
    let mut status = |name: &str| {
        let request = format!("GET /{name}.lods HTTP/1.1\r\nhost: x\r\nrange: bytes=0-3\r\n\r\n");
        stream.write_all(request.as_bytes()).expect("the server reads");
        let mut response = Vec::new();
        let mut byte = [0];
        while !response.ends_with(b"\r\n\r\n") {
            stream.read_exact(&mut byte).expect("the server answers");
            response.push(byte[0]);
        }
        let head = String::from_utf8(response).expect("text").to_lowercase();
        let length = head.split("content-length: ").nth(1).and_then(|rest| rest.lines().next());
        let mut body = vec![0; length.and_then(|l| l.parse().ok()).expect("a length")];
        stream.read_exact(&mut body).expect("the server answers");
        (head[9..12].to_owned(), body == b"LODS")
    };
    assert_eq!(status("secret"), ("206".to_owned(), true));
    site.server.control().set_access(Access::Rules(rules())).expect("loopback");
    assert_eq!(status("secret"), ("404".to_owned(), false));
    assert_eq!(status("open"), ("206".to_owned(), true));
}
