//! What a dataset in an object store costs beside one on the local disk: milliseconds for ranges, first and again.
//!
//! `./dev bench storage`. One range from each mebibyte of a file, so that no block was read before it is asked for; then
//! the same again. The object store is a program on this machine (moto, in Python), which takes longer than any server in
//! between: so it is asked itself, too, for the blocks of 256 KiB that the server asks it for. Real stores add their distance.

#[path = "../tests/hosting/process.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod process;
#[path = "../tests/hosting/s3.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod s3;
#[path = "../tests/hosting/server.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod server;

use std::{ops::Range, time::Instant};

use process::Process;
use reqwest::Client;

const RANGE_BYTES: u64 = 64 << 10;

/// What the server reads of a store at a time.
const BLOCK_BYTES: u64 = 256 << 10;

/// From one range to the next.
const STEP_BYTES: u64 = 1 << 20;

/// Ranges are asked for in steps of so many, modulo their number: a prime, so that all of them are.
const STRIDE: u64 = 61;

fn main() {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build();
    runtime.expect("a runtime").block_on(measure());
}

async fn measure() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.lods");
    server::build(&path, "16M", 1);
    let bytes = std::fs::read(&path).expect("built");
    let s3 = s3::S3::start().await;
    s3.put("a.lods", bytes.clone()).await;
    let (_disk, disk) = server::serve(folder.path().to_str().expect("a plain path"), &[]);
    let mut command =
        server::command(&["serve", "s3://bucket", "--listen", "127.0.0.1:0", "--cache", "1GiB"]);
    command.envs(s3.variables());
    let (_store, store) = Process::start(command, false, |line| Some(line.to_owned()));

    println!("| ranges of 64 KiB, one at a time | first: median, p99 | again: median, p99 |");
    println!("| --- | --- | --- |");
    let mut medians = Vec::new();
    for (name, url) in [("local disk", &disk), ("object store", &store)] {
        let url = format!("{url}/a.lods");
        let first = ask(&url, &bytes, RANGE_BYTES).await;
        let again = ask(&url, &bytes, RANGE_BYTES).await;
        let told = |times: &[f64]| {
            format!("{:.2}, {:.2} ms", median(times), times[times.len() * 99 / 100])
        };
        println!("| {name} | {} | {} |", told(&first), told(&again));
        medians.push((median(&first), median(&again)));
    }
    let itself = ask(&format!("{}/bucket/a.lods", s3.endpoint), &bytes, BLOCK_BYTES).await;
    let itself = median(&itself);
    println!(
        "object store over local disk: again {:.2}x; first {:.2} ms, of these {itself:.2} ms the store itself for a block of 256 KiB",
        medians[1].1 / medians[0].1,
        medians[1].0,
    );
    let figures = Client::new().get(format!("{store}/metrics")).send().await.expect("an answer");
    let figures = figures.text().await.expect("text");
    for line in figures
        .lines()
        .filter(|l| l.starts_with("lodestream_cache") || l.starts_with("lodestream_store"))
    {
        println!("{line}");
    }
}

fn median(sorted: &[f64]) -> f64 {
    sorted[sorted.len() / 2]
}

/// Milliseconds of each range, sorted.
async fn ask(url: &str, bytes: &[u8], length: u64) -> Vec<f64> {
    let client = Client::new();
    let get = |range: Range<u64>| {
        let range = format!("bytes={}-{}", range.start, range.end - 1);
        // The store wants to see that somebody signed.
        client.get(url).header("range", range).header("authorization", s3::SIGNED).send()
    };
    // The connection stands before anything is timed.
    get(0..1).await.expect("an answer");
    let mut times = Vec::new();
    let count = bytes.len() as u64 / STEP_BYTES;
    assert!(!count.is_multiple_of(STRIDE), "{count} steps: another prime is needed");
    for index in 0..count {
        // Not in the order of the file: nothing may be read ahead.
        let start = index * STRIDE % count * STEP_BYTES + STEP_BYTES / 3;
        let began = Instant::now();
        let response = get(start..start + length).await;
        let body = response.expect("an answer").bytes().await.expect("a body");
        times.push(began.elapsed().as_secs_f64() * 1e3);
        assert!(body == bytes[start as usize..(start + length) as usize]);
    }
    times.sort_by(f64::total_cmp);
    times
}
