//! Seconds, peak memory and bytes per point of `lodestream build`, beside a rival and `laz` alone
//!
//! `./dev bench build [INPUT] [--runs N]`. INPUT is a LAS or LAZ file; without one, a simulated
//! courtyard of 10 million points is written as LAS first. Where `LODESTREAM_POTREE_CONVERTER` names
//! the program of PotreeConverter 2, the two run alternately, so that a drift of the machine's speed
//! meets both. For a LAZ file the time that decoding alone takes, on all cores, is told too.

use std::{
    env,
    error::Error,
    fs::{self, File},
    io::Cursor,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    thread::available_parallelism,
    time::Instant,
};

use laz::ParLasZipDecompressor;
use lodestream_protocol::Boot;
use lodestream_tests::{Options, median, program};
use wait4::Wait4;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const RIVAL_VARIABLE: &str = "LODESTREAM_POTREE_CONVERTER";
const DEFAULT_SCAN: &str = "sim:courtyard?points=10M&seed=1";

fn main() -> Result<()> {
    let Options { input, runs } = Options::parse(DEFAULT_SCAN)?;
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bench_build");
    fs::create_dir_all(&folder)?;
    let ours = program("lodestream")?;
    let input = if input == DEFAULT_SCAN { simulated_las(&ours, &folder)? } else { input.into() };

    let dataset = folder.join("ours.lods");
    let rival_folder = folder.join("rival");
    let rival = env::var_os(RIVAL_VARIABLE);
    let mut our_runs = Vec::new();
    let mut rival_runs = Vec::new();
    for run in 1..=runs {
        eprintln!("run {run} of {runs}");
        remove(&dataset)?;
        let mut command = Command::new(&ours);
        command.arg("build").arg(&input).arg("-o").arg(&dataset);
        our_runs.push(measure(command, &folder)?);
        if let Some(rival) = &rival {
            remove(&rival_folder)?;
            let mut command = Command::new(rival);
            command.arg(&input).arg("-o").arg(&rival_folder).args(["-m", "poisson"]);
            rival_runs.push(measure(command, &folder)?);
        }
    }

    let points = Boot::parse(&fs::read(&dataset)?)?.manifest.points;
    println!(
        "{}: {points} points, {} cores, {runs} runs\n",
        input.file_name().unwrap_or_default().display(),
        available_parallelism()?
    );
    println!("| program | median s | min | max | peak MiB | bytes/point |");
    println!("| --- | --- | --- | --- | --- | --- |");
    let us = Summary::of(&our_runs, size_bytes(&dataset)?, points);
    us.print("lodestream build");
    if rival.is_some() {
        let them = Summary::of(&rival_runs, size_bytes(&rival_folder)?, points);
        them.print("PotreeConverter -m poisson");
        println!(
            "\nlodestream: {:.2}x as fast, {:.2}x the memory, {:.2}x the bytes",
            them.median / us.median,
            us.peak_mib / them.peak_mib,
            us.bytes_per_point / them.bytes_per_point
        );
    } else {
        println!("\n{RIVAL_VARIABLE} is not set: no rival was run");
    }
    if input.extension().is_some_and(|e| e.eq_ignore_ascii_case("laz")) {
        let mut seconds: Vec<f64> = (0..runs).map(|_| decode_laz(&input)).collect::<Result<_>>()?;
        let alone = median(&mut seconds);
        println!(
            "\nlaz alone decodes the file in {alone:.2} s: build takes {:.2}x",
            us.median / alone
        );
    }
    Ok(())
}

/// What one run took.
struct Run {
    seconds: f64,
    peak_bytes: u64,
}

/// Runs a command to its end; what it prints goes to a file, to be shown if it fails.
fn measure(mut command: Command, folder: &Path) -> Result<Run> {
    let log = folder.join("log.txt");
    let output = File::create(&log)?;
    command.stdin(Stdio::null()).stdout(output.try_clone()?).stderr(output);
    let start = Instant::now();
    let mut child = command.spawn().map_err(|e| format!("{command:?}: {e}"))?;
    let usage = child.wait4()?;
    let seconds = start.elapsed().as_secs_f64();
    if !usage.status.success() {
        let said = String::from_utf8_lossy(&fs::read(&log)?).into_owned();
        return Err(format!("{command:?}: {}\n{said}", usage.status).into());
    }
    Ok(Run { seconds, peak_bytes: usage.rusage.maxrss })
}

/// What several runs took.
struct Summary {
    median: f64,
    min: f64,
    max: f64,
    peak_mib: f64,
    bytes_per_point: f64,
}

impl Summary {
    fn of(runs: &[Run], bytes: u64, points: u64) -> Self {
        let mut seconds: Vec<f64> = runs.iter().map(|run| run.seconds).collect();
        let peak = runs.iter().map(|run| run.peak_bytes).max().unwrap_or(0);
        Self {
            median: median(&mut seconds),
            min: seconds[0],
            max: seconds[seconds.len() - 1],
            peak_mib: peak as f64 / f64::from(1 << 20),
            bytes_per_point: bytes as f64 / points as f64,
        }
    }

    fn print(&self, name: &str) {
        let Self { median, min, max, peak_mib, bytes_per_point } = self;
        println!(
            "| {name} | {median:.2} | {min:.2} | {max:.2} | {peak_mib:.0} | {bytes_per_point:.2} |"
        );
    }
}

/// The default input, through our own dataset, which keeps every point.
fn simulated_las(ours: &Path, folder: &Path) -> Result<PathBuf> {
    eprintln!("writing {DEFAULT_SCAN} as LAS");
    let (dataset, las) = (folder.join("courtyard.lods"), folder.join("courtyard.las"));
    let mut build = Command::new(ours);
    build.args(["build", DEFAULT_SCAN, "-o"]).arg(&dataset);
    measure(build, folder)?;
    let mut export = Command::new(ours);
    export.arg("export").arg(&dataset).arg("-o").arg(&las);
    measure(export, folder)?;
    Ok(las)
}

fn remove(path: &Path) -> Result<()> {
    match fs::symlink_metadata(path) {
        Ok(meta) if meta.is_dir() => Ok(fs::remove_dir_all(path)?),
        Ok(_) => Ok(fs::remove_file(path)?),
        Err(_) => Ok(()),
    }
}

/// Bytes of a file, or of the binary files (those that hold points and tree) directly in a folder.
fn size_bytes(path: &Path) -> Result<u64> {
    if path.is_file() {
        return Ok(fs::metadata(path)?.len());
    }
    let mut bytes = 0;
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        if entry.path().extension().is_some_and(|e| e == "bin") {
            bytes += entry.metadata()?.len();
        }
    }
    Ok(bytes)
}

/// Seconds that `laz` takes to read and decode a file, all of it, on all cores.
fn decode_laz(path: &Path) -> Result<f64> {
    /// As fast as one buffer for all points, or faster: its pages stay in the cache.
    const POINTS_AT_ONCE: usize = 1_000_000;
    let start = Instant::now();
    let file = fs::read(path)?;
    let mut source = Cursor::new(&file[..]);
    let header = las::Header::new(&mut source)?;
    source.set_position(las::raw::Header::read_from(&file[..])?.offset_to_point_data.into());
    let vlr = header.laz_vlr()?;
    let record_bytes = usize::try_from(vlr.items_size())?;
    let mut left = usize::try_from(header.number_of_points())?;
    let mut records = vec![0; POINTS_AT_ONCE.min(left) * record_bytes];
    let mut decompressor = ParLasZipDecompressor::new(source, vlr)?;
    while left > 0 {
        let count = POINTS_AT_ONCE.min(left);
        decompressor.decompress_many(&mut records[..count * record_bytes])?;
        left -= count;
    }
    Ok(start.elapsed().as_secs_f64())
}
