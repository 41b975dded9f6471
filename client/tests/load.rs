//! `lodestream load`: the real binaries, real HTTP, and figures that are held to the server's own.

#[path = "common/dataset.rs"]
mod dataset;
#[allow(dead_code, reason = "the engine's tests need more of it")]
#[path = "common/host.rs"]
mod host;

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::Path,
    process::{Child, Command, Output, Stdio},
    sync::mpsc::channel,
    time::Duration,
};

use lodestream_client::{
    engine::Policy,
    load::{LoadReport, WaitReport},
};
use lodestream_preprocess::{FileSource, with_foreign_payloads};
use lodestream_protocol::{Dataset, Node, NodePoints};

use dataset::{Recipe, dataset, write};
use host::{Answer, Host};

/// Long enough for any machine; a test that waits this long has failed.
const LONG: Duration = Duration::from_secs(120);

/// A real server in a process of its own.
struct Server {
    process: Child,
    url: String,
}

impl Server {
    fn start(folder: &Path) -> Self {
        let mut process = Command::new(env!("CARGO_BIN_EXE_lodestream"))
            .args(["serve", "--listen", "127.0.0.1:0"])
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary runs");
        let mut url = String::new();
        let stdout = process.stdout.take().expect("piped");
        BufReader::new(stdout).read_line(&mut url).expect("the address");
        Self { process, url: url.trim().to_owned() }
    }

    fn dataset(&self) -> String {
        format!("{}/dataset", self.url)
    }

    /// What it tells Prometheus of the dataset's requests.
    fn counted(&self) -> Counted {
        let host = self.url.trim_start_matches("http://");
        let mut stream = TcpStream::connect(host).expect("the server accepts");
        write!(stream, "GET /metrics HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\n\r\n")
            .expect("the server reads");
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("an answer");
        let sum = |name: &str, kinds: &[&str]| {
            let lines = text.lines().filter(|line| {
                line.starts_with(&format!("lodestream_{name}_total{{dataset=\"dataset\""))
                    && kinds.iter().any(|kind| line.contains(&format!("kind=\"{kind}\"")))
            });
            let value = |line: &str| line.rsplit(' ').next().and_then(|n| n.parse::<u64>().ok());
            lines.map(|line| value(line).expect("a number")).sum()
        };
        Counted {
            requests: sum("requests", &["file", "batch"]),
            batches: sum("requests", &["batch"]),
            bytes: sum("response_bytes", &["file", "batch"]),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Of the dataset's file, by range and by batch.
#[derive(Debug)]
struct Counted {
    requests: u64,
    batches: u64,
    bytes: u64,
}

fn load(url: &str, folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_lodestream"));
    let output = folder.join("out");
    command.args(["load", url, "-o"]).arg(output).args(["--ramp", "0"]).args(args);
    command.output().expect("the binary runs")
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join("out").join(name)).expect(name)
}

fn report(folder: &Path) -> LoadReport {
    let text = read(folder, "load.json");
    let report: LoadReport = serde_json::from_str(&text).expect("a report");
    assert_eq!(report.json(), text, "nothing is lost by reading");
    report
}

fn expect_success(output: &Output) -> String {
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    said
}

/// Requests that a load test sends to find out where the dataset lies, before there are clients.
fn opening(host: &Host) -> usize {
    let before = host.requests().len();
    let folder = tempfile::tempdir().expect("temporary folder");
    let output = load(&host.url(), folder.path(), &["--path", "orbit?seconds=5000"]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && said.contains("1 to 3600 seconds"), "{said}");
    host.requests().len() - before
}

fn recipe() -> Recipe {
    Recipe { node_points: 2000, ..Recipe::default() }
}

#[test]
fn the_figures_are_the_hosts_own() {
    let file = dataset(recipe());
    let host = Host::good(file.clone());
    let opening = opening(&host);
    let folder = tempfile::tempdir().expect("temporary folder");
    let args = ["--path", "teleport?seconds=4&stops=2", "--loops", "2", "--clients", "3"];
    expect_success(&load(&host.url(), folder.path(), &args));
    let report = report(folder.path());
    let [run] = report.runs.as_slice() else { panic!("one run: {report:?}") };
    assert_eq!((run.visits.begun, run.visits.complete, run.visits.failed), (6, 6, 0));
    assert_eq!((run.errors, run.cold.first.came, run.jumps.first.came), (0, 6, 6), "{run:?}");
    let seen = host.requests().split_off(2 * opening);
    let bytes = |request: &host::Request| {
        let (start, end) = request.range.expect("ranges only");
        end.min(file.len() as u64) - start
    };
    let served: u64 = seen.iter().map(bytes).sum();
    assert_eq!(run.requests.sent as usize, seen.len(), "{run:?}");
    assert_eq!(run.requests.sent, run.requests.complete + run.requests.broken_off);
    if run.requests.broken_off == 0 {
        assert_eq!(run.bytes.received, served, "{run:?}");
    }
    assert!(run.bytes.received <= served && run.bytes.used <= run.bytes.received);
    let summed: u64 = run.intervals.iter().map(|at| at.requests).sum();
    assert_eq!(summed, run.requests.sent, "over time as in all");
    let summed: u64 = run.intervals.iter().map(|at| at.bytes).sum();
    assert_eq!(summed, run.bytes.received);
    let summed: u64 = run.intervals.iter().map(|at| at.nodes.came + at.nodes.given_up).sum();
    assert_eq!(summed, run.nodes.came + run.nodes.given_up);
    assert!(run.nodes.p50_ms <= run.nodes.p99_ms);
    assert!(run.cold.first.p50_ms <= run.cold.settled.p50_ms);
}

#[test]
fn the_server_counts_what_the_report_tells() {
    let (folder, _) = write(&dataset(recipe()));
    let server = Server::start(folder.path());
    // Ours asks a server of ours by batches, the other by ranges alone.
    for policy in ["ours", "potree"] {
        let path = ["--path", "teleport?seconds=2&stops=2", "--loops", "2", "--clients", "3"];
        let args = [&path[..], &["--policy", policy]].concat();
        // What it takes to find out where the dataset lies comes twice: here, before it is refused.
        let before = server.counted();
        load(&server.dataset(), folder.path(), &["--path", "orbit?seconds=5000"]);
        let opened = server.counted();
        expect_success(&load(&server.dataset(), folder.path(), &args));
        let after = server.counted();
        let own = |of: fn(&Counted) -> u64| of(&after) - of(&opened) - (of(&opened) - of(&before));
        let run = &report(folder.path()).runs[0];
        assert_eq!(own(|c| c.requests), run.requests.sent, "{policy}: {run:?}");
        if run.requests.broken_off == 0 {
            assert_eq!(own(|c| c.bytes), run.bytes.received, "{policy}: {run:?}");
        }
        assert_eq!(own(|c| c.batches) > 0, policy == "ours");
    }
}

#[test]
fn a_report_is_written_for_programs_for_people_and_for_the_terminal() {
    let (folder, _) = write(&dataset(recipe()));
    let server = Server::start(folder.path());
    let args = ["--path", "orbit?seconds=2", "--loops", "1", "--clients", "2", "--keep-cache"];
    let said = expect_success(&load(&server.dataset(), folder.path(), &args));
    let report = report(folder.path());
    let run = &report.runs[0];
    assert!(run.nodes.came > 0 && run.bytes.received > 0, "{run:?}");
    if cfg!(target_os = "linux") {
        let process = run.server.as_ref().expect("seen by its port");
        assert_eq!(process.pids, [server.process.id()]);
        assert!(process.memory_peak_bytes > 1 << 20, "{process:?}");
    }
    assert!(said.contains("ours") && said.contains("load.html"), "{said}");
    let html = read(folder.path(), "load.html");
    assert!(html.contains("What each client waited for") && !html.contains("NaN"));
    for name in ["runs.csv", "latency.csv", "intervals.csv"] {
        let table = read(folder.path(), name);
        let columns = |line: &str| line.split(',').count();
        let first = table.lines().next().map(columns);
        assert!(table.lines().count() >= 2, "{name}");
        assert!(table.lines().all(|line| Some(columns(line)) == first), "{name}");
    }
    assert_eq!(read(folder.path(), "errors.csv").lines().count(), 1);
}

#[test]
fn rivals_policies_are_told_as_ratios_and_more_clients_as_a_knee() {
    let (folder, _) = write(&dataset(recipe()));
    let server = Server::start(folder.path());
    let path = ["--path", "teleport?seconds=2&stops=2", "--loops", "1", "--clients", "1,2,3"];
    let policies = ["--policy", "ours,potree", "--link", "100mbit/10ms"];
    let said =
        expect_success(&load(&server.dataset(), folder.path(), &[&path[..], &policies].concat()));
    let report = report(folder.path());
    assert_eq!((report.runs.len(), report.ratios.len(), report.knees.len()), (6, 3, 2));
    for run in &report.runs {
        // Handshake, request and answer.
        assert!(run.cold.first.p50_ms >= Some(20.0), "the link delays: {run:?}");
    }
    let requests_per_node = |policy| {
        let runs = report.runs.iter().filter(move |run| run.policy == policy);
        let sums = runs.map(|run| (run.requests.sent, run.nodes.came));
        let (requests, nodes) = sums.fold((0, 0), |sum, run| (sum.0 + run.0, sum.1 + run.1));
        requests as f64 / nodes as f64
    };
    let (ours, potree) = (requests_per_node(Policy::Ours), requests_per_node(Policy::Potree));
    assert!(potree > 2.0 * ours, "a request for every node: {potree}, ours {ours}");
    assert!(said.contains("potree against ours, 1 client, cold"), "{said}");
    assert!(said.contains("the knee is at"), "{said}");
}

#[test]
fn nodes_in_a_rivals_encoding_are_fetched_whole_and_by_their_own_lengths() {
    let (folder, path) = write(&dataset(recipe()));
    let open =
        |path: &Path| Dataset::open(FileSource::open(path).expect("readable")).expect("a dataset");
    let encode = |points: &NodePoints| vec![7; 100 + 3 * points.positions.len()];
    let twin = folder.path().join("twin.lods");
    let dataset = open(&path);
    with_foreign_payloads(&dataset, &twin, |_, points| Ok(encode(points))).expect("written");
    let bytes = std::fs::read(&twin).expect("readable");
    let by_key = |dataset: &Dataset<FileSource>| {
        let mut nodes = dataset.hierarchy().expect("readable");
        nodes.sort_unstable_by_key(|node| node.key);
        nodes
    };
    let (ours, theirs) = (by_key(&dataset), by_key(&open(&twin)));
    assert_eq!(ours.len(), theirs.len());
    let groups: Vec<usize> = (0..dataset.manifest().groups.len()).collect();
    let mut lengths = Vec::new();
    for (ours, theirs) in ours.iter().zip(&theirs) {
        let expected = encode(&dataset.read_node(ours, &groups).expect("readable"));
        let (payload, others) = theirs.payloads.split_first().expect("a group");
        let begin = payload.offset as usize;
        assert!(bytes[begin..begin + payload.bytes as usize] == expected, "{theirs:?}");
        assert!(others.iter().all(|payload| payload.bytes == 0), "{theirs:?}");
        lengths.push(u64::from(payload.bytes));
        let node =
            Node { payloads: ours.payloads.clone(), child_page: ours.child_page, ..theirs.clone() };
        assert_eq!(node, *ours);
    }
    let host = Host::good(bytes);
    let opening = opening(&host);
    let args = ["--policy", "potree", "--path", "teleport?seconds=2&stops=2", "--loops", "1"];
    expect_success(&load(&host.url(), folder.path(), &args));
    let report = report(folder.path());
    let asked = host.requests().split_off(2 * opening);
    let length = |request: &host::Request| request.range.map(|(start, end)| end - start);
    let of_nodes = asked.iter().filter(|r| length(r).is_some_and(|len| lengths.contains(&len)));
    assert_eq!(of_nodes.count() as u64, report.runs[0].nodes.came, "a range for every node");
}

#[test]
fn a_host_that_dies_midway_gives_errors_by_kind_and_a_failure() {
    let (sender, requests) = channel();
    let mut host = Host::start(dataset(recipe()), move |request| {
        // The test is over before its host.
        let _ = sender.send(request.number);
        Answer::Good
    });
    let folder = tempfile::tempdir().expect("temporary folder");
    let (url, path) = (host.url(), folder.path().to_owned());
    let args = ["--path", "orbit?seconds=1", "--duration", "4", "--clients", "4"];
    let loading = std::thread::spawn(move || load(&url, &path, &args));
    // It is under way once the clients have asked for something.
    for _ in 0..10 {
        requests.recv_timeout(LONG).expect("requests");
    }
    host.stop();
    let output = loading.join().expect("no panic");
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let report = report(folder.path());
    let run = &report.runs[0];
    assert!(run.errors > 0 && run.errors_by_kind.contains_key("no connection"), "{run:?}");
    assert_eq!(run.errors, run.errors_by_kind.values().sum::<u64>());
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("no connection"), "{said}");
    assert!(read(folder.path(), "load.html").contains("What went wrong"));
    assert!(read(folder.path(), "errors.csv").contains("no connection"));
}

/// A host from which the load test learns where the dataset lies, and which then answers as told.
fn opened(manners: impl Fn(usize) -> Answer + Send + 'static) -> Host {
    let host = Host::good(dataset(recipe()));
    let opening = opening(&host);
    host.behave(move |request| match request.number.checked_sub(2 * opening) {
        None => Answer::Good,
        Some(number) => manners(number),
    });
    host
}

#[test]
fn visits_that_fail_count_as_rounds_so_that_a_run_ends_though_its_host_is_dead() {
    let host = opened(|_| Answer::Status(404));
    let folder = tempfile::tempdir().expect("temporary folder");
    let bounded = ["--path", "orbit?seconds=2", "--loops", "3", "--most-requests", "20"];
    // Were visits begun for ever, the requests would be spent.
    load(&host.url(), folder.path(), &[&bounded[..], &["--clients", "2"]].concat());
    let run = &report(folder.path()).runs[0];
    assert_eq!((run.visits.begun, run.visits.complete, run.visits.failed), (6, 0, 6), "{run:?}");
    assert_eq!((run.requests.sent, run.cut_short.as_deref()), (6, None), "{run:?}");
    assert_eq!(run.errors_by_kind.get("status 404"), Some(&6));
    let pictures = [&run.cold.first, &run.cold.settled].map(|w| (w.came, w.given_up));
    assert_eq!(pictures, [(0, 6); 2], "a host that refuses is not a fast one");
}

#[test]
fn a_client_that_keeps_its_cache_comes_back_after_a_failure_for_the_rounds_that_are_left() {
    let host = opened(|number| if number == 0 { Answer::Status(404) } else { Answer::Good });
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = ["--path", "teleport?seconds=2&stops=2", "--loops", "3", "--keep-cache"];
    load(&host.url(), folder.path(), &[&path[..], &["--clients", "1"]].concat());
    let run = &report(folder.path()).runs[0];
    assert_eq!((run.visits.begun, run.visits.complete, run.visits.failed), (2, 1, 1), "{run:?}");
    // Two rounds of two views, of which the very first is no jump; and the visit that failed.
    let pictures = |waits: &WaitReport| waits.came + waits.given_up;
    let found = (pictures(&run.cold.settled), pictures(&run.jumps.settled));
    assert_eq!(found, (2, 3), "{run:?}");
    assert!(run.nodes.came > 0, "{run:?}");
}

#[test]
fn kinds_of_failure_are_told_apart() {
    let host = Host::start(dataset(recipe()), |request| match request.number {
        0 => Answer::Good,
        n if n % 5 == 1 => Answer::Status(503),
        n if n % 5 == 2 => Answer::CutShort { share: 0.5 },
        n if n % 5 == 3 => Answer::WrongRange,
        _ => Answer::Good,
    });
    let folder = tempfile::tempdir().expect("temporary folder");
    let args = ["--path", "orbit?seconds=3", "--loops", "1", "--clients", "3"];
    let output = load(&host.url(), folder.path(), &args);
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let run = &report(folder.path()).runs[0];
    for kind in ["status 503", "broken off", "wrong range"] {
        assert!(run.errors_by_kind.contains_key(kind), "{kind}: {:?}", run.errors_by_kind);
    }
    assert!(run.nodes.came > 0, "engines go on");
}

#[test]
fn what_never_came_is_not_forgotten() {
    let file = dataset(recipe());
    let (reached, _hangs) = tokio::sync::mpsc::unbounded_channel();
    // Two for the opening and for the client's; everything else hangs.
    let host = Host::start(file, move |request| match request.range {
        Some((0, _)) => Answer::Good,
        _ => Answer::Hang { share: 0.5, reached: reached.clone() },
    });
    let folder = tempfile::tempdir().expect("temporary folder");
    let args = ["--path", "orbit?seconds=2", "--loops", "1", "--clients", "1"];
    let output = load(&host.url(), folder.path(), &args);
    let report = report(folder.path());
    let run = &report.runs[0];
    assert_eq!(run.errors, 0, "a slow host is no error: {output:?}");
    assert!(run.nodes.given_up > 0 && run.nodes.p999_ms.is_none(), "{run:?}");
    assert_eq!((run.cold.settled.came, run.cold.settled.given_up), (0, 1));
    assert!(run.requests.broken_off > 0 && run.bytes.wasted_share > 0.0, "{run:?}");
}

#[test]
fn a_run_is_bounded_in_requests_clients_and_time() {
    let host = Host::good(dataset(recipe()));
    let opening = opening(&host);
    let folder = tempfile::tempdir().expect("temporary folder");
    let url = host.url();
    let asked = host.requests().len();
    let refused = |args: &[&str], word: &str| {
        let output = load(&url, folder.path(), args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.starts_with("error: ") && said.contains(word), "{args:?}: {said}");
    };
    refused(&["--clients", "0"], "1 to 10000");
    refused(&["--clients", "10001"], "1 to 10000");
    refused(&["--duration", "3601"], "3600");
    refused(&["--path", "nowhere.json"], "no such file");
    refused(&["--views-per-second", "0"], "0.1 to 120");
    let output = load(&url, folder.path(), &["--policy", "potree-brotli"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stderr).contains("take potree"));
    assert_eq!(host.requests().len(), asked, "what is refused asks for nothing");

    let spent = ["--path", "orbit?seconds=2", "--duration", "60", "--most-requests", "40"];
    let output = load(&url, folder.path(), &[&spent[..], &["--clients", "20"]].concat());
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let report = report(folder.path());
    let run = &report.runs[0];
    assert_eq!(
        (run.requests.sent, run.cut_short.as_deref(), run.errors),
        (40, Some("requests"), 0)
    );
    // Those that were broken off may not have reached the host.
    assert!(host.requests().len() <= asked + opening + 40);
}

#[test]
fn what_cannot_be_loaded_is_refused_with_advice() {
    let (folder, path) = write(&dataset(recipe()));
    let refused = |url: &str, word: &str| {
        let output = load(url, folder.path(), &["--duration", "1"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(1) && said.contains(word), "{url}: {said}");
    };
    refused(&path.display().to_string(), "lodestream serve");
    let server = Server::start(folder.path());
    refused(&format!("{}/nothing", server.url), "not found");
}
