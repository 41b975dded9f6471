//! Peak memory by point budget and cache size along a path, and whether it grows with repetitions
//!
//! `./dev bench memory [INPUT] [--seconds N] [--repetitions N]`. INPUT is a dataset or anything that
//! `lodestream build` takes; without one, a simulated courtyard of 12 million points. A flight through the
//! cloud of 40 seconds, 60 views a second, from a server on this machine; each pair of budget and cache in a
//! process of its own, and one of them ten times in a row. MiB of resident memory: less what the process
//! had before the engine. Beside it what the engine accounts for: decoded nodes, needed and kept. (The
//! like of Fraiss 2017, 4.5 and fig. 4.2)

use std::{
    env,
    error::Error,
    ffi::OsString,
    net::{Ipv4Addr, SocketAddr},
    process::Command,
    time::{Duration, Instant},
};

use lodestream_client::{
    engine::{Engine, EngineConfig, View},
    path::{CameraPath, Extent, PathSpec},
    source::Source,
};
use lodestream_server::{ServeConfig, spawn};

#[path = "support/overview.rs"]
#[allow(dead_code)]
mod overview;
#[path = "support/process.rs"]
#[allow(dead_code)]
mod process;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const BUDGETS: [u64; 4] = [500_000, 1_000_000, 2_500_000, 5_000_000];
const CACHES_MIB: [u64; 3] = [0, 128, 512];
const SIZE_PX: [u32; 2] = [1280, 720];
const PATIENCE: Duration = Duration::from_secs(60);

const USAGE: &str = "usage: memory [INPUT] [--seconds N] [--repetitions N]";

fn main() -> Result<()> {
    let mut input: OsString = "sim:courtyard?points=12M&seed=1".into();
    let (mut seconds, mut repetitions) = (40.0, 10);
    let mut arguments = env::args_os().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().and_then(|v| v.into_string().ok()).ok_or(USAGE);
        match argument.to_str() {
            Some("--bench") => {}
            Some("--one") => {
                let (source, budget, cache) = (value()?, value()?.parse()?, value()?.parse()?);
                return fly(&source, budget, cache, value()?.parse()?, value()?.parse()?);
            }
            Some("--seconds") => seconds = value()?.parse()?,
            Some("--repetitions") => repetitions = value()?.parse()?,
            Some(option) if option.starts_with('-') => return Err(USAGE.into()),
            _ => input = argument,
        }
    }
    let dataset = overview::dataset(&input, "bench_memory.lods")?;
    let dataset = dataset.canonicalize()?;
    let (folder, name) = (dataset.parent().ok_or("no folder")?, dataset.file_stem());
    let name = name.and_then(|name| name.to_str()).ok_or("the file's name is no text")?;
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = spawn(ServeConfig::new(folder, address))?;
    let source = format!("{}/{name}", server.url());
    let fly = |budget: u64, cache: u64, times: u32| -> Result<()> {
        let numbers =
            [budget.to_string(), cache.to_string(), seconds.to_string(), times.to_string()];
        let mut child = Command::new(env::current_exe()?);
        let status = child.arg("--one").arg(&source).args(numbers).status()?;
        if status.success() { Ok(()) } else { Err("a flight failed".into()) }
    };
    println!("a flight of {seconds} s\n");
    println!(
        "| budget | cache MiB | repetition | most MiB | in the end | decoded, most | points, most |"
    );
    println!("|{}", " ---: |".repeat(7));
    for budget in BUDGETS {
        for cache in CACHES_MIB {
            fly(budget, cache, 1)?;
        }
    }
    println!();
    fly(1_000_000, 128, repetitions)
}

fn fly(source: &str, budget: u64, cache_mib: u64, seconds: f64, times: u32) -> Result<()> {
    let before = process::resident_mib();
    let config = EngineConfig {
        point_budget: budget,
        cache_bytes: cache_mib << 20,
        min_size_px: 10.0,
        ..EngineConfig::default()
    };
    let engine = Engine::start(vec![Source::parse(source)?], config)?;
    let boots = engine.wait_open(PATIENCE)?;
    let (min, max) = boots[0].manifest.bounds_world().ok_or("no points")?;
    let spec = format!("flythrough?seconds={}&seed=1", seconds.max(1.0));
    let path = PathSpec::parse(&spec)?.path(&Extent::new(min, max)?)?;
    for repetition in 1..=times {
        process::forget_peak();
        let (decoded, points) = once(&engine, &path);
        println!(
            "| {budget} | {cache_mib} | {repetition} | {:.0} | {:.0} | {:.0} | {points} |",
            process::peak_mib() - before,
            process::resident_mib() - before,
            decoded as f64 / f64::from(1 << 20),
        );
    }
    Ok(())
}

/// Once along the path; the most bytes of decoded nodes, and the most points drawn.
fn once(engine: &Engine, path: &CameraPath) -> (u64, u64) {
    let (begin, mut most) = (Instant::now(), (0, 0));
    loop {
        let time = begin.elapsed().as_secs_f64();
        if time > path.duration() {
            return most;
        }
        engine.set_view(View { camera: path.at(path.start() + time), size_px: SIZE_PX });
        let (plan, stats) = (engine.plan(), engine.stats());
        most.0 = most.0.max(stats.pinned_bytes + stats.cached_bytes);
        most.1 = most.1.max(plan.points);
        std::thread::sleep(Duration::from_micros(16_667));
    }
}
