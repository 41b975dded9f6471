//! `lodestream doctor` before hosts that are sick in one way each, before sound ones, and on the command
//! line.

#[path = "common/dataset.rs"]
mod dataset;
#[path = "doctor/patient.rs"]
mod patient;

use std::process::Command;

use lodestream_client::{
    doctor::{Diagnosis, Verdict, examine},
    source::Source,
};
use lodestream_server::{ServeConfig, spawn};

use dataset::{Recipe, dataset, write};
use patient::{Patient, Sickness};

fn diagnose(url: &str) -> Diagnosis {
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let url = Source::parse_url(url).expect("a URL");
    runtime.block_on(examine(url)).expect("a client")
}

/// A sickness, the check that finds it, how bad that is, and words of finding and remedy.
type Case = (Sickness, &'static str, Verdict, &'static [&'static str]);

const CASES: [Case; 30] = {
    use Sickness::*;
    use Verdict::{Fail, Warn};
    [
        (IgnoresRanges, "ranges", Fail, &["200 instead of 206", "max_ranges"]),
        (ShiftsRanges, "ranges", Fail, &["asked for bytes 0 to 64", "slice"]),
        (TellsNoRange, "ranges", Fail, &["Content-Range says nothing"]),
        (HidesTheLength, "ranges", Warn, &["does not tell the file's length"]),
        (AnswersBeyondTheEnd, "ranges", Warn, &["beyond the end", "416"]),
        (BreaksOff, "length", Fail, &["broke off after", "proxy_read_timeout"]),
        (Compresses, "encoding", Fail, &["gzip", "gzip off"]),
        (ForbidsOthers, "cors", Warn, &["may not read", "Access-Control-Allow-Origin"]),
        (AllowsOneOther, "cors", Warn, &["only pages of https://other.example"]),
        (HidesFields, "cors", Warn, &["do not see content-range, etag", "Expose-Headers"]),
        (RefusesPreflight, "cors", Warn, &["OPTIONS", "405"]),
        (NoTag, "etag", Warn, &["no ETag"]),
        (WeakTag, "etag", Warn, &["weak", "gzip off"]),
        (ChangingTag, "etag", Fail, &["changes", "replicas"]),
        (IgnoresConditions, "etag", Warn, &["If-None-Match", "304"]),
        (KeepsFromCaches, "cache", Warn, &["no-store", "immutable"]),
        (WrongClock, "clock", Warn, &["2 h ahead", "NTP"]),
        (TextType, "type", Warn, &["text/plain", "octet-stream"]),
        (WebPage, "type", Fail, &["a web page comes"]),
        (NotFound, "access", Fail, &["404", "check the address"]),
        (Denies, "access", Fail, &["403", "firewall"]),
        (Busy, "access", Fail, &["503"]),
        (Crashes, "connection", Fail, &["check the address"]),
        (LimitsRequests, "parallel", Warn, &["429", "limit_conn"]),
        (RefusesHead, "head", Warn, &["405"]),
        (ClosesConnections, "http", Warn, &["closes the connection", "kept alive"]),
        (OldHttp, "http", Warn, &["HTTP/1.0", "proxy_http_version"]),
        (Redirects, "connection", Warn, &["sent on to", "round trip"]),
        (DamagesPayloads, "payloads", Fail, &["checksum", "verify"]),
        (Narrow, "bandwidth", Warn, &["Mbit/s", "limit_rate"]),
    ]
};

#[test]
fn every_sickness_is_found_and_nothing_else() {
    let file = dataset(Recipe { node_points: 3000, ..Recipe::default() });
    assert!(file.len() > 1 << 20, "long enough to tell the bandwidth: {}", file.len());
    for (sickness, check, verdict, words) in CASES {
        let patient = Patient::admit(file.clone(), sickness);
        let diagnosis = diagnose(&patient.url());
        let text = diagnosis.text();
        let finding = diagnosis.of(check).unwrap_or_else(|| panic!("{sickness:?}: {text}"));
        assert_eq!(finding.verdict, verdict, "{sickness:?}: {text}");
        let said = format!("{} {}", finding.found, finding.remedy.as_deref().unwrap_or("nothing"));
        for word in words {
            assert!(said.contains(word), "{sickness:?}: {word:?} is missing: {text}");
        }
        let mut others = diagnosis.findings.iter().filter(|f| f.check != check);
        assert!(others.all(|f| f.verdict == Verdict::Ok), "{sickness:?}: {text}");
        assert_eq!(diagnosis.verdict, verdict, "{sickness:?}: {text}");
    }
}

/// A file that is wrong, the check that finds it, and words of the finding.
type Damage = (&'static str, fn(&mut Vec<u8>), &'static str, &'static [&'static str]);

#[test]
fn files_that_are_no_dataset_or_not_whole_are_told_apart() {
    let cases: [Damage; 10] = [
        ("cut short", |f| f.truncate(f.len() - 1000), "size", &["cut short", "copy it"]),
        ("longer", |f| f.extend([0; 10]), "size", &["something was added"]),
        ("empty", Vec::clear, "size", &["empty"]),
        ("a LAS file", |f| *f = b"LASF".repeat(100), "format", &["LAS or LAZ", "build"]),
        ("a page", |f| *f = b"<!DOCTYPE html>".repeat(20), "format", &["web page"]),
        ("text mode", |f| f[4] = b'\n', "format", &["line ends"]),
        ("an LFS pointer", |f| *f = b"version https://git-lfs".repeat(9), "format", &["Git LFS"]),
        ("newer", |f| f[8] = 9, "format", &["9.0 is newer", "update lodestream"]),
        ("damaged header", |f| f[20] ^= 1, "format", &["checksum of header"]),
        ("damaged index", |f| f[100] ^= 1, "index", &["checksum of manifest", "cache"]),
    ];
    for (name, damage, check, words) in cases {
        let mut file = dataset(Recipe::default());
        damage(&mut file);
        let patient = Patient::admit(file, Sickness::None);
        let diagnosis = diagnose(&patient.url());
        let text = diagnosis.text();
        let finding = diagnosis.of(check).unwrap_or_else(|| panic!("{name}: {text}"));
        let expected = if name == "longer" { Verdict::Warn } else { Verdict::Fail };
        assert_eq!(finding.verdict, expected, "{name}: {text}");
        let said = format!("{} {}", finding.found, finding.remedy.as_deref().unwrap_or("nothing"));
        assert!(words.iter().all(|word| said.contains(word)), "{name}: {text}");
    }
}

#[test]
fn signed_addresses_that_expired_or_do_not_hold_are_told_apart() {
    let file = dataset(Recipe::default());
    let found = |sickness, query: &str| {
        let patient = Patient::admit(file.clone(), sickness);
        let diagnosis = diagnose(&format!("{}?{query}", patient.url()));
        assert!(!diagnosis.url.contains('?'), "secrets are not repeated: {}", diagnosis.url);
        let text = diagnosis.text();
        assert!(!text.contains("secret"), "{text}");
        text
    };
    let in_an_hour = std::time::SystemTime::now() + std::time::Duration::from_secs(3000);
    let in_an_hour =
        in_an_hour.duration_since(std::time::UNIX_EPOCH).expect("after 1970").as_secs();
    let text = found(Sickness::Denies, "expires=1700000000&signature=secret");
    assert!(text.contains("the address expired") && text.contains("have a new address"), "{text}");
    let text = found(Sickness::Denies, "expires=9999999999&signature=secret");
    assert!(text.contains("the signature does not hold"), "{text}");
    // The host believes that it is two hours later.
    let query = format!("expires={in_an_hour}&signature=secret");
    let text = found(Sickness::DeniesByAWrongClock, &query);
    assert!(text.contains("by the host's clock") && text.contains("NTP"), "{text}");
    let text = found(Sickness::None, &query);
    assert!(text.contains("expires in 49 min") || text.contains("expires in 50 min"), "{text}");
}

#[test]
fn our_own_server_is_sound() {
    let (folder, _) = write(&dataset(Recipe { node_points: 3000, ..Recipe::default() }));
    let config = ServeConfig::new(folder.path(), ([127, 0, 0, 1], 0).into());
    let server = spawn(config).expect("serving");
    let diagnosis = diagnose(&format!("{}/dataset", server.url()));
    assert_eq!(diagnosis.verdict, Verdict::Ok, "{}", diagnosis.text());
    let checks = ["ranges", "encoding", "etag", "cors", "format", "size", "payloads", "bandwidth"];
    assert!(checks.iter().all(|check| diagnosis.of(check).is_some()), "{}", diagnosis.text());
    assert!(diagnosis.requests <= 60 && diagnosis.bytes < 16 << 20, "{}", diagnosis.text());
}

#[test]
fn the_command_tells_it_in_lines_or_json_and_by_its_exit_code() {
    let file = dataset(Recipe::default());
    let doctor = |url: &str, args: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream"));
        command.args(["doctor", url]).args(args).output().expect("the binary runs")
    };
    let sound = Patient::admit(file.clone(), Sickness::None);
    let output = doctor(&sound.url(), &["--strict"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && said.lines().last().is_some_and(|l| l.starts_with("sound")),
        "{said}"
    );

    let weak = Patient::admit(file.clone(), Sickness::WeakTag);
    assert!(doctor(&weak.url(), &[]).status.success());
    assert_eq!(doctor(&weak.url(), &["--strict"]).status.code(), Some(1));

    let sick = Patient::admit(file, Sickness::IgnoresRanges);
    let output = doctor(&sick.url(), &["--json"]);
    assert_eq!(output.status.code(), Some(1));
    let diagnosis: Diagnosis = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(diagnosis.verdict, Verdict::Fail);

    let output = doctor(&dataset_path(), &[]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1));
    assert!(said.starts_with("error: ") && said.contains("is a file"), "{said}");
}

fn dataset_path() -> String {
    env!("CARGO_MANIFEST_DIR").to_owned() + "/Cargo.toml"
}
