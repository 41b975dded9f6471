//! Hundreds of clouds at once: time to open, CPU per plan, memory, threads and sockets
//!
//! `./dev bench clouds [--most N]`. Small clouds side by side (about 25,000 points in 70 nodes each), from
//! one server and from files; 300 at most without more said. Each count runs in a process of its own: opens all
//! of them with one view over all and one budget of a million points, settles, then orbits for five
//! seconds, 60 views a second.

use std::{
    env,
    error::Error,
    net::{Ipv4Addr, SocketAddr},
    path::Path,
    process::Command,
    time::{Duration, Instant},
};

use glam::DVec3;
use lodestream_client::{
    camera::Camera,
    engine::{Engine, EngineConfig, View},
    source::Source,
};
use lodestream_server::{ServeConfig, spawn};

#[path = "../../client/tests/common/dataset.rs"]
#[allow(dead_code)]
mod dataset;
#[path = "support/process.rs"]
#[allow(dead_code)]
mod process;

use dataset::Recipe;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const PATIENCE: Duration = Duration::from_secs(300);

/// World units from one to the next.
const PITCH: f64 = 70.0;

fn main() -> Result<()> {
    let arguments: Vec<_> = env::args().skip(1).filter(|a| a != "--bench").collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["--one", folder, server, clouds] => one(folder, server, clouds.parse()?),
        [] => all(300),
        ["--most", most] => all(most.parse()?),
        _ => Err("usage: clouds [--most N]".into()),
    }
}

fn all(most: usize) -> Result<()> {
    let folder = tempfile::tempdir()?;
    let per_row = (most as f64).sqrt().ceil() as usize;
    for number in 0..most {
        let (x, y) = ((number % per_row) as f64, (number / per_row) as f64);
        let corner = [PITCH * x, PITCH * y, 0.0];
        let recipe = Recipe {
            seed: number as u64,
            levels: 3,
            node_points: 700,
            corner,
            ..Recipe::default()
        };
        std::fs::write(folder.path().join(format!("{number}.lods")), dataset::dataset(recipe))?;
    }
    let address = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    let server = spawn(ServeConfig::new(folder.path(), address))?;
    println!(
        "| clouds | from | open ms | settled ms | requests | MB | nodes | ms a plan | CPU % in flight | \
         threads | sockets, files | MiB |"
    );
    println!("|{}", " ---: |".repeat(12));
    for clouds in [1, 10, 100, most].into_iter().filter(|&clouds| clouds <= most) {
        for from in ["files", &server.url()] {
            let path = folder.path().to_str().ok_or("the folder's name is no text")?;
            let count = clouds.to_string();
            let status =
                Command::new(env::current_exe()?).args(["--one", path, from, &count]).status()?;
            if !status.success() {
                return Err(format!("{clouds} clouds from {from}: failed").into());
            }
        }
    }
    Ok(())
}

fn one(folder: &str, server: &str, clouds: usize) -> Result<()> {
    let before = process::resident_mib();
    let sources = (0..clouds).map(|number| {
        Source::parse(&match server {
            "files" => Path::new(folder).join(format!("{number}.lods")).display().to_string(),
            server => format!("{server}/{number}"),
        })
    });
    let sources = sources.collect::<std::result::Result<Vec<_>, _>>()?;
    let begin = Instant::now();
    let engine = Engine::start(sources, EngineConfig { min_size_px: 5.0, ..Default::default() })?;
    let boots = engine.wait_open(PATIENCE)?;
    let open_ms = begin.elapsed().as_secs_f64() * 1e3;
    let corners = boots.iter().filter_map(|boot| boot.manifest.bounds_world());
    let corners = corners.map(|(min, max)| (DVec3::from(min), DVec3::from(max)));
    let room = corners.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
    let (min, max) = room.ok_or("no points")?;
    let camera = Camera::overview(min, max, 1.5);
    engine.set_view(View { camera, size_px: [960, 640] });
    let plan = engine.wait_settled(PATIENCE)?;
    let settled_ms = begin.elapsed().as_secs_f64() * 1e3;
    let loaded = engine.stats().since_start.totals;

    let (cpu, flight) = (process::cpu_seconds(), Instant::now());
    let arm = camera.eye - camera.target;
    for frame in 0..300 {
        let turn = glam::DQuat::from_rotation_z(f64::from(frame) / 300.0 * std::f64::consts::TAU);
        let eye = camera.target + turn * (0.5 * arm);
        engine.set_view(View { camera: Camera { eye, ..camera }, size_px: [960, 640] });
        std::thread::sleep(Duration::from_micros(16_667));
    }
    let cpu = (process::cpu_seconds() - cpu) / flight.elapsed().as_secs_f64();
    let totals = engine.stats().since_start.totals;
    let plan_ms = (totals.plan_ms - loaded.plan_ms) / (totals.plans - loaded.plans).max(1) as f64;
    println!(
        "| {clouds} | {} | {open_ms:.0} | {settled_ms:.0} | {} | {:.1} | {} | {plan_ms:.2} | {:.0} | {} | {} | \
         {:.0} |",
        if server == "files" { "files" } else { "server" },
        loaded.requests,
        loaded.bytes as f64 / 1e6,
        plan.nodes.len(),
        100.0 * cpu,
        process::threads(),
        process::descriptors(),
        process::resident_mib() - before,
    );
    Ok(())
}
