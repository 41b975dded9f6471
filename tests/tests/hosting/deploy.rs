//! The files that operators start from: `deploy/` and `docker/`.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use rustix::process::Signal;

use crate::{process::Process, server};

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

fn read(name: &str) -> String {
    fs::read_to_string(shipped(name)).expect("shipped")
}

fn printed(arguments: &[&str], variables: &[(&str, &str)]) -> String {
    let all = [&["serve", "--print-config"], arguments].concat();
    let output = server::command(&all).envs(variables.iter().copied()).output().expect("starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn the_shipped_configuration_has_every_setting_with_its_default() {
    let config = shipped("deploy/lodestream.toml");
    let theirs = printed(&["--config", config.to_str().expect("a plain path")], &[]);
    let plain = printed(&["/srv/lodestream", "--trusted-proxy", "127.0.0.1"], &[]);
    assert_eq!(theirs, plain);
    let text = read("deploy/lodestream.toml");
    for line in plain.lines().filter_map(|line| line.split_once(" = ")) {
        assert!(text.contains(&format!("\n{} = ", line.0)), "{} is not in the file", line.0);
    }
    // What is commented out is right, too.
    let mut full = String::new();
    for line in text.lines() {
        let bare = line.strip_prefix("# ").unwrap_or(line);
        let is_word =
            |name: &str| name.chars().all(|c| c.is_ascii_lowercase() || "_0123456789".contains(c));
        let is_setting =
            bare.starts_with('[') || bare.split_once(" = ").is_some_and(|(name, _)| is_word(name));
        full += &format!("{}\n", if is_setting { bare } else { "" });
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("full.toml");
    fs::write(&path, full).expect("writable");
    let all = printed(&["--config", path.to_str().expect("a plain path")], &[]);
    for part in ["[tls]", "[storage]", "signing_keys = ", "[[access.tokens]]", "site-*"] {
        assert!(all.contains(part), "{part} is not in {all}");
    }
}

#[test]
fn a_flag_counts_before_a_variable_before_the_file_before_the_default() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.toml");
    fs::write(
        &path,
        "data = \"file\"\n[limits]\nburst = 1\nmax_connections = 1\ndrain_delay_secs = 1\n",
    )
    .expect("writable");
    let file = ["--config", path.to_str().expect("a plain path")];
    let variables = [("LODESTREAM_BURST", "2"), ("LODESTREAM_MAX_CONNECTIONS", "2")];
    let printed = printed(&[&file[..], &["--burst", "3"]].concat(), &variables);
    for line in [
        "burst = 3",
        "max_connections = 2",
        "drain_delay_secs = 1",
        "drain_timeout_secs = 10",
        "data = \"file\"",
    ] {
        assert!(printed.lines().any(|l| l == line), "no {line} in {printed}");
    }
    let secret = [("AWS_SECRET_ACCESS_KEY", "hush"), ("AWS_REGION", "eu-1")];
    let printed = self::printed(&["s3://bucket/scans"], &secret);
    assert!(printed.contains("aws_region = \"eu-1\"") && !printed.contains("hush"), "{printed}");
}

#[test]
fn the_shipped_unit_is_sound_and_hardened() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let unit = folder.path().join("lodestream.service");
    let text = read("deploy/lodestream.service");
    assert!(text.contains("/usr/local/bin/lodestream-server serve --config"));
    // systemd wants the program to be there.
    fs::write(&unit, text.replace("/usr/local/bin/lodestream-server", "/bin/true")).expect("ours");
    let analyze = |arguments: &[&str]| {
        let output = Command::new("systemd-analyze").args(arguments).arg(&unit).output();
        let output = output.expect("./dev test installs systemd");
        let said = [output.stdout, output.stderr].concat();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&said));
    };
    analyze(&["verify", "--man=no"]);
    // Tenths of what a service could do to its machine; most units have 90.
    analyze(&["security", "--offline=true", "--no-pager", "--threshold=20"]);
}

#[tokio::test]
async fn rules_are_read_again_at_a_hangup_and_tokens_stay_out_of_the_log() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    server::build(&folder.path().join("a.lods"), "5k", 1);
    let token = String::from_utf8(server::command(&["token"]).output().expect("starts").stdout);
    let token = token.expect("text").trim().to_owned();
    fs::write(place("token"), &token).expect("writable");
    fs::write(place("key"), "0123456789abcdef0123456789abcdef\n").expect("writable");
    let config = |datasets: &str| {
        let text = format!(
            "data = {:?}\nlisten = \"127.0.0.1:0\"\n[log]\nformat = \"json\"\nrequests = true\n[access]\n\
             signing_keys = [{:?}]\n[[access.tokens]]\nname = \"team\"\nfile = {:?}\ndatasets = [\"{datasets}\"]\n",
            folder.path(),
            place("key"),
            place("token"),
        );
        fs::write(place("config.toml"), text).expect("writable");
    };
    config("b");
    let log = fs::File::create(place("log")).expect("writable");
    let mut command = server::command(&["serve", "--config", &place("config.toml")]);
    command.stderr(log);
    let (process, url) = Process::start(command, false, |line| Some(line.to_owned()));
    let client = reqwest::Client::new();
    let status = async |address: &str| {
        let request = client.get(address).bearer_auth(&token);
        request.send().await.expect("an answer").status().as_u16()
    };
    let dataset = format!("{url}/datasets/a.lods");
    assert_eq!(status(&dataset).await, 404);
    config("a");
    process.signal(Signal::HUP);
    while status(&dataset).await != 200 {
        tokio::task::yield_now().await;
    }
    let sign = ["sign", "a", "--key", &place("key"), "--for", "1h", "--server", &url];
    let link = String::from_utf8(server::command(&sign).output().expect("starts").stdout);
    let link = link.expect("text").trim().to_owned();
    let answer = reqwest::get(&link).await.expect("an answer");
    assert_eq!(answer.status(), 200, "{link}");
    answer.bytes().await.expect("a body");
    let signature = link.rsplit_once('=').expect("signed").1;
    // A bad configuration changes nothing.
    fs::write(place("config.toml"), "nonsense").expect("writable");
    process.signal(Signal::HUP);
    assert_eq!(status(&dataset).await, 200);
    process.signal(Signal::TERM);
    process.wait();
    let log = fs::read_to_string(place("log")).expect("written");
    for line in log.lines() {
        serde_json::from_str::<serde_json::Value>(line).unwrap_or_else(|e| panic!("{line}: {e}"));
    }
    assert!(log.contains("\"path\":\"/datasets/a.lods\"") && log.contains("\"token\":\"team\""));
    assert!(!log.contains(&token) && !log.contains(signature), "a secret is in the log");
}

#[test]
fn ping_tells_whether_a_server_is_ready() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (process, url) = server::serve(folder.path().to_str().expect("a plain path"), &[]);
    let ping = || server::command(&["ping", &url]).output().expect("it starts");
    assert_eq!(String::from_utf8_lossy(&ping().stdout), "ready\n");
    fs::remove_dir(folder.path()).expect("empty");
    let away = ping();
    assert_eq!(away.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&away.stderr).contains("not ready"));
    process.kill();
    assert!(String::from_utf8_lossy(&ping().stderr).contains("no answer"));
}

#[test]
fn the_toolbox_shows_its_token_and_keeps_a_links_query() {
    use lodestream_tests::program;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let place = |name: &str| folder.path().join(name).to_str().expect("a plain path").to_owned();
    server::build(&folder.path().join("a.lods"), "5k", 1);
    fs::write(place("token"), "a-token-of-more-than-22-bytes-and-32\n").expect("writable");
    fs::write(place("config.toml"), format!("[access]\nsigning_keys = [{:?}]", place("token")))
        .expect("writable");
    let options = ["--token-file", &place("token"), "--config", &place("config.toml")];
    let (_server, url) = server::serve(folder.path().to_str().expect("a plain path"), &options);
    let inspect = |source: &str, token: Option<&str>| {
        let mut command = Command::new(program("lodestream").expect("built along"));
        command.args(["inspect", source]).env_remove("LODESTREAM_TOKEN");
        token.map(|token| command.env("LODESTREAM_TOKEN", token));
        command.output().expect("it starts")
    };
    let source = format!("{url}/a");
    assert!(inspect(&source, Some("a-token-of-more-than-22-bytes-and-32")).status.success());
    let denied = inspect(&source, None);
    let told = String::from_utf8_lossy(&denied.stderr).into_owned();
    assert!(!denied.status.success() && told.contains("token"), "{told}");
    let sign = ["sign", "a", "--key", &place("token"), "--server", &url];
    let link = String::from_utf8(server::command(&sign).output().expect("starts").stdout);
    assert!(inspect(link.expect("text").trim(), None).status.success());
}
