//! The binary itself: its commands, exit codes and first lines.

use std::{
    collections::BTreeMap,
    fs,
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Command, Output, Stdio},
};

fn lodestream(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream-server"));
    command.args(arguments);
    command
}

fn run(arguments: &[&str]) -> Output {
    lodestream(arguments).output().expect("the binary starts")
}

/// Runs a command that is to succeed; returns its standard output.
fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).expect("text")
}

/// Runs a command that is to fail; returns its one line of error.
fn failed(arguments: &[&str]) -> String {
    let output = run(arguments);
    let errors = String::from_utf8(output.stderr).expect("text");
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {errors}");
    let lines: Vec<_> = errors.lines().filter(|line| line.starts_with("error: ")).collect();
    assert!(lines.len() == 1 && errors.ends_with(&format!("{}\n", lines[0])), "{errors}");
    lines[0].to_owned()
}

/// A small scan as text: a bumpy sheet of 20,000 points with an intensity.
fn write_scan(path: &Path) {
    let line = |i: u32| {
        let (x, y) = (i % 200, i / 200);
        let bump = x * x % 17 + y * 7 % 13;
        format!(
            "{}.{:02} {}.{:02} 1.{bump:02} {bump}\n",
            500 + x / 4,
            x % 4 * 25,
            y / 4,
            y % 4 * 25
        )
    };
    let text: String = (0..20_000).map(line).collect();
    fs::write(path, text).expect("the folder is writable");
}

struct Built {
    folder: tempfile::TempDir,
    scan: String,
    dataset: String,
    report: serde_json::Value,
}

fn built() -> Built {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [scan, dataset, report] = ["scan.xyz", "scan.lods", "report.json"]
        .map(|name| folder.path().join(name).display().to_string());
    write_scan(Path::new(&scan));
    let columns = ["--columns", "x,y,z,intensity"];
    let out =
        done(&[&["build", &scan, "-o", &dataset, "--report", &report], &columns[..]].concat());
    assert!(out.contains("20,000 points"), "{out}");
    let report = fs::read(report).expect("a report");
    let report: serde_json::Value = serde_json::from_slice(&report).expect("JSON");
    assert_eq!(report["points_written"], 20_000);
    Built { folder, scan, dataset, report }
}

#[test]
fn a_built_dataset_is_sound_and_described_in_full() {
    let Built { folder: _folder, scan, dataset, report } = built();
    let columns = ["--columns", "x,y,z,intensity"];
    let out = done(&[&["verify", &dataset, "--against", &scan], &columns[..]].concat());
    assert!(out.contains("the same, bit by bit") && out.ends_with("sound\n"), "{out}");

    let json: serde_json::Value =
        serde_json::from_str(&done(&["inspect", &dataset, "--json"])).expect("JSON");
    assert_eq!(json["points"], 20_000);
    let sum = |list: &str, of: &str| -> u64 {
        let items = json[list].as_array().expect("a list");
        items.iter().map(|item| item[of].as_u64().expect("a number")).sum()
    };
    assert_eq!(sum("levels", "points"), 20_000);
    assert_eq!(sum("levels", "nodes"), json["nodes"].as_u64().expect("a number"));
    assert_eq!(sum("levels", "bytes"), sum("groups", "bytes"));
    let index = json["index_bytes"].as_u64().expect("a number");
    let file = fs::metadata(&dataset).expect("it is there").len();
    assert_eq!(sum("groups", "bytes") + index, file);
    let columns: Vec<&serde_json::Value> = json["groups"]
        .as_array()
        .expect("a list")
        .iter()
        .flat_map(|group| group["columns"].as_array().expect("a list"))
        .collect();
    // One tells them by group, the other in the manifest's order.
    let column = |c: &serde_json::Value| (c["name"].to_string(), c["bytes"].clone());
    let bytes: BTreeMap<_, _> = columns.into_iter().map(column).collect();
    let reported = report["columns"].as_array().expect("a list");
    let reported: BTreeMap<_, _> = reported.iter().map(column).collect();
    assert_eq!(bytes, reported);
    assert_eq!(
        bytes.values().map(|b| b.as_u64().expect("a number")).sum::<u64>(),
        sum("groups", "bytes")
    );
    assert_eq!(json["bounds"]["min"][0], 500.0);

    let text = done(&["inspect", &dataset]);
    for expected in ["20,000", "intensity", "position", "normal", "absent", "poisson"] {
        assert!(text.contains(expected), "{expected} is not in\n{text}");
    }
    assert!(text.lines().all(|line| line.trim_end() == line), "{text}");
}

#[test]
fn an_altered_dataset_is_not_sound() {
    let Built { folder: _folder, dataset, .. } = built();
    let mut bytes = fs::read(&dataset).expect("it is there");
    *bytes.last_mut().expect("not empty") ^= 1;
    fs::write(&dataset, bytes).expect("writable");
    let line = failed(&["verify", &dataset]);
    assert!(line.contains("scan.lods") && line.contains("not sound"), "{line}");
}

#[test]
fn failures_are_one_line_and_exit_code_1() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    fs::write(path("garbage.lods"), b"no dataset").expect("writable");
    for (arguments, expected) in [
        (vec!["inspect", "no/such.lods"], "no/such.lods"),
        (vec!["inspect", &path("garbage.lods")], "not a lodestream dataset"),
        (vec!["inspect", &path("")], "not a file"),
        (vec!["verify", &path("garbage.lods")], "not a lodestream dataset"),
        (vec!["build", "no/such.las", "-o", &path("out.lods")], "no/such.las"),
        (vec!["serve", "no/such/folder"], "no/such/folder"),
        (vec!["serve", &path("garbage.lods")], "garbage.lods"),
    ] {
        let line = failed(&arguments);
        assert!(line.contains(expected), "{arguments:?}: {line}");
    }
    assert!(!folder.path().join("out.lods").exists());
}

#[test]
fn bad_usage_is_exit_code_2() {
    for arguments in [
        &["build"][..],
        &["build", "a.las"],
        &["build", "a.las", "-o", "a.las"],
        &["build", "a.las", "-o", "a.lods", "--grid", "100"],
        &["build", "a.las", "-o", "a.lods", "--memory", "lots"],
        &["build", "a.las", "-o", "a.lods", "--method", "magic"],
        &["build", "a.las", "-o", "a.lods", "--threads", "0"],
        &["build", "a.las", "-o", "a.lods", "--scale", "0"],
        &["serve", ".", "--listen", "nowhere"],
        &["verify"],
        &["unheard-of"],
        &[],
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
    }
}

#[cfg(unix)]
#[test]
fn serve_prints_its_address_first_and_ends_on_the_termination_signal() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let dir = folder.path().display().to_string();
    let mut server = lodestream(&["serve", &dir, "--listen", "127.0.0.1:0"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the binary starts");
    let mut out = BufReader::new(server.stdout.take().expect("piped"));
    let mut line = String::new();
    out.read_line(&mut line).expect("a first line");
    let url = line.trim_end();
    assert!(url.starts_with("http://127.0.0.1:") && !url.ends_with(":0"), "{line}");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let status = runtime.expect("a runtime").block_on(async {
        // Built together with the client, reqwest has TLS and asks for a provider, used or not.
        let _ = rustls::crypto::ring::default_provider().install_default();
        reqwest::get(format!("{url}/healthz")).await.expect("the server answers").status()
    });
    assert_eq!(status, 200);
    let pid = rustix::process::Pid::from_child(&server);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).expect("it runs");
    assert_eq!(server.wait().expect("it ends").code(), Some(0));
    let mut rest = String::new();
    out.read_to_string(&mut rest).expect("text");
    assert_eq!(rest, "", "more than the address on standard output");
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let Built { folder: _folder, dataset, .. } = built();
    let mut inspect = lodestream(&["inspect", &dataset])
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    drop(inspect.stdout.take());
    assert_eq!(inspect.wait().expect("it ends").code(), Some(0));
}
