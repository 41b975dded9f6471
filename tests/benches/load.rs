//! What a server holds: waits, throughput and memory with 1 to 1,000 clients, the knee, and rivals' ways to fetch
//!
//! `./dev bench load [INPUT] [--runs N]`. INPUT is a dataset or anything that `lodestream build` takes;
//! without one, a simulated courtyard of 4 million points. A server of the same build hosts it in a
//! process of its own; `lodestream load` looks at it, first with 1, 10, 100 and 1,000 clients as fast
//! as it comes, then N times with six clients by each policy, each of them on 20 Mbit/s and 40 ms, in turn. The rivals'
//! policies know no positions in two parts: they fetch from a twin that has them in one, and Potree's also from
//! one whose nodes are what PotreeConverter 2 makes of them with `--encoding BROTLI`: its way and its bytes.
//! Server and clients share this machine. The pages stay where the last lines say.

use std::{
    error::Error,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
};

use lodestream_client::{
    engine::Policy,
    eval::potree_payload,
    load::{LoadReport, Ratios, RunReport, ratios},
};
use lodestream_preprocess::{FileSource, with_foreign_payloads, with_whole_positions};
use lodestream_protocol::Dataset;
use lodestream_tests::{Options, median, program};

#[path = "support/dataset.rs"]
mod dataset;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Clients of the first part. They begin within ten seconds and look around for thirty.
const CLIENTS: &str = "1,10,100,1000";
const HOLDS: [&str; 8] =
    ["--path", "orbit?seconds=30", "--duration", "40", "--ramp", "10", "--views-per-second", "5"];

/// The second part: six places, each stayed at for ten seconds, and a client that begins at each, by a link of
/// its own.
const FETCHES: [&str; 8] = [
    "--clients",
    "6",
    "--path",
    "teleport?seconds=60&stops=6&factor=10",
    "--loops",
    "1",
    "--link",
    "20mbit/40ms",
];

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse("sim:courtyard?points=4M&seed=1")?;
    let dataset = dataset::dataset(&input, "bench_load.lods")?;
    let server = Server::start(&dataset)?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));

    let held = load(
        &server,
        &folder.join("bench_load_clients"),
        &[&["--clients", CLIENTS], &HOLDS[..]].concat(),
    )?;
    println!(
        "\n| clients | nodes/s | MB/s | node p50 | p99 | p99.9 | not in time | first picture | settled | server cores | clients' cores | server memory | errors |"
    );
    println!(
        "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    );
    for run in &held.runs {
        println!("{}", held_row(run));
    }
    for knee in &held.knees {
        let beyond = if knee.is_reached { "" } else { " or beyond" };
        println!("\nThe knee is at {} clients{beyond}.", knee.clients);
    }

    let twin_folder = folder.join("bench_load_twin");
    std::fs::create_dir_all(&twin_folder)?;
    let twin = twin_folder.join("whole.lods");
    let foreign = twin_folder.join("potree.lods");
    let opened = Dataset::open(FileSource::open(&dataset)?)?;
    with_whole_positions(&opened, &twin)?;
    with_foreign_payloads(&opened, &foreign, potree_payload)?;
    let size = |path: &Path| std::fs::metadata(path).map(|file| file.len() as f64 / 1e6);
    println!(
        "\n{:.1} MB; in one part {:.1} MB, in Potree's encoding {:.1} MB",
        size(&dataset)?,
        size(&twin)?,
        size(&foreign)?
    );
    let (twin, foreign) = (Server::start(&twin)?, Server::start(&foreign)?);
    let mut rounds = Vec::new();
    for run in 1..=runs {
        let fetch = |server: &Server, policies: &str| {
            let name = format!("bench_load_{}_{}_{run}", server.name, policies.replace(',', "_"));
            load(server, &folder.join(name), &[&FETCHES[..], &["--policy", policies]].concat())
        };
        let mut all = fetch(&server, "ours")?.runs;
        let by_its_bytes = fetch(&foreign, "potree")?.runs.into_iter();
        all.extend(by_its_bytes.map(|run| RunReport { policy: Policy::PotreeBrotli, ..run }));
        all.extend(fetch(&twin, "potree,fraiss")?.runs);
        rounds.push(ratios(&all));
    }
    println!("\nTimes ours, medians of {runs} (each run's median over its pictures):\n");
    println!(
        "| policy | cold: settled | first picture | bytes | requests | after jumps: settled | first picture | bytes | requests |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    let others = rounds[0].iter().map(|ratio| ratio.policy);
    for policy in others {
        let of = |value: fn(&Ratios) -> Option<f64>| {
            let mut values: Vec<_> = rounds
                .iter()
                .flatten()
                .filter(|ratio| ratio.policy == policy)
                .filter_map(value)
                .collect();
            format!("{:.2}x", median(&mut values))
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            policy.name(),
            of(|r| r.cold_settled),
            of(|r| r.cold_first),
            of(|r| r.cold_bytes),
            of(|r| r.cold_requests),
            of(|r| r.jump_settled),
            of(|r| r.jump_first),
            of(|r| r.jump_bytes),
            of(|r| r.jump_requests),
        );
    }
    Ok(())
}

fn held_row(run: &RunReport) -> String {
    let ms = |value: Option<f64>| value.map_or("-".into(), |ms| format!("{ms:.1} ms"));
    let (server, own) = (run.server.as_ref(), run.own.as_ref());
    format!(
        "| {} | {:.0} | {:.1} | {} | {} | {} | {:.1} % | {} | {} | {} | {} | {} | {} |",
        run.clients,
        run.nodes_per_second,
        run.bytes.per_second / 1e6,
        ms(run.nodes.p50_ms),
        ms(run.nodes.p99_ms),
        ms(run.nodes.p999_ms),
        100.0 * run.nodes.given_up_share(),
        ms(run.cold.first.p50_ms),
        ms(run.cold.settled.p50_ms),
        server.map_or("-".into(), |s| format!("{:.2}", s.cores)),
        own.map_or("-".into(), |s| format!("{:.2}", s.cores)),
        server.map_or("-".into(), |s| format!(
            "{:.0} MiB",
            s.memory_peak_bytes as f64 / f64::from(1 << 20)
        )),
        run.errors,
    )
}

/// Runs the load test, which shows what it does, and reads its report.
fn load(server: &Server, folder: &Path, args: &[&str]) -> Result<LoadReport> {
    let source = format!("{}/{}", server.url, server.name);
    let status = Command::new(program("lodestream")?)
        .args(["load", &source, "-o"])
        .arg(folder)
        .args(args)
        .status()?;
    let report = folder.join("load.json");
    println!("{} ({status})", folder.join("load.html").display());
    Ok(serde_json::from_str(&std::fs::read_to_string(report)?)?)
}

/// A server in a process of its own.
struct Server {
    process: Child,
    url: String,
    name: String,
}

impl Server {
    fn start(dataset: &Path) -> Result<Self> {
        let folder = dataset.parent().map_or_else(PathBuf::new, Path::to_path_buf);
        let name =
            dataset.file_stem().ok_or("a dataset has a name")?.to_string_lossy().into_owned();
        let mut process = Command::new(program("lodestream")?)
            .args(["serve", "--listen", "127.0.0.1:0"])
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let mut url = String::new();
        let stdout = process.stdout.take().ok_or("its output is piped")?;
        BufReader::new(stdout).read_line(&mut url)?;
        Ok(Self { process, url: url.trim().to_owned(), name })
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
