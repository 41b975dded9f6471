//! What arrives first, and what is fetched in vain when the view jumps, in simulated time
//!
//! `./dev bench priority [INPUT]`. INPUT is a dataset or anything that `lodestream build` takes; without
//! one, a simulated courtyard of 4 million points. First table (Fraiss 2017, figs. 3.2, 3.3): a cold start
//! at 20 Mbit/s and 40 ms; how the order of arrival goes with a node's size in the picture (rank
//! correlation: -1 where the largest come first) and, among nodes of the same size, with its distance from
//! the middle (partial rank correlation: 1 where the middle comes first); and how far the loading is, in
//! percent of its time, when the mean node of that kind comes. Second table: five walks of ten places, a second
//! each; bytes received, and which part of them was of no use because the view had left or the request was broken
//! off.

use std::{error::Error, path::Path};

use glam::DVec3;
use lodestream_client::{
    camera::Camera,
    engine::{EngineConfig, Priority, View},
    path::{Extent, PathSpec},
};
use lodestream_preprocess::FileSource;
use lodestream_protocol::Dataset;
use lodestream_tests::Options;

#[path = "../../client/tests/common/arrival.rs"]
mod arrival;
#[path = "support/overview.rs"]
#[allow(dead_code)]
mod overview;

use arrival::{Arrival, arrivals, correlations, jump};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Walks of the second table.
const WALKS: u32 = 5;

const LINKS: [&str; 4] = ["4mbit/100ms", "20mbit/40ms", "20mbit/40ms/1%", "100mbit/20ms"];

fn main() -> Result<()> {
    let Options { input, .. } = Options::parse("sim:courtyard?points=4M&seed=1")?;
    let dataset = overview::dataset(&input, "bench_priority.lods")?;
    let manifest = Dataset::open(FileSource::open(&dataset)?)?.manifest().clone();
    let (min, max) = manifest.bounds_world().ok_or("no points")?;
    println!("| priority | view | nodes | size | middle | largest | smallest | middle | edge |");
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (name, priority) in [("ours", Priority::ErrorPerByte), ("fraiss", Priority::Fraiss)] {
        for (view, camera) in cameras(min.into(), max.into()) {
            order(&dataset, name, priority, view, camera)?;
        }
    }
    println!("\n| link | broken off | MB | in vain | MB without | in vain without |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: |");
    let extent = Extent::new(min, max)?;
    let path = |seed| {
        let path = PathSpec::parse(&format!("teleport?stops=10&seconds=10&seed={seed}"))?;
        path.path(&extent)
    };
    let paths = (1..=WALKS).map(path).collect::<std::result::Result<Vec<_>, _>>()?;
    for link in LINKS {
        let run = |cancels| {
            let config = EngineConfig { cancels, ..EngineConfig::default() };
            let mut sum = (0, 0, 0);
            for path in &paths {
                let totals = jump(&dataset, config.clone(), link.parse()?, path);
                sum.0 += totals.cancelled;
                sum.1 += totals.bytes;
                sum.2 += totals.wasted_bytes();
            }
            Ok::<_, String>(sum)
        };
        let ((broken_off, bytes, wasted), (_, all, without)) = (run(true)?, run(false)?);
        let share = |wasted: u64, bytes: u64| 100.0 * wasted as f64 / bytes as f64;
        println!(
            "| {link} | {broken_off} | {:.1} | {:.1} % | {:.1} | {:.1} % |",
            bytes as f64 / 1e6,
            share(wasted, bytes),
            all as f64 / 1e6,
            share(without, all),
        );
    }
    Ok(())
}

/// From afar, and from inside.
fn cameras(min: DVec3, max: DVec3) -> [(&'static str, Camera); 2] {
    let far = Camera::overview(min, max, 16.0 / 9.0);
    let near = Camera { eye: far.eye + 0.8 * (far.target - far.eye), ..far };
    [("overview", far), ("near", near)]
}

fn order(dataset: &Path, name: &str, priority: Priority, view: &str, camera: Camera) -> Result<()> {
    let config = EngineConfig { priority, ..EngineConfig::default() };
    let view_ = View { camera, size_px: [960, 540] };
    let arrivals = arrivals(dataset, config, "20mbit/40ms".parse()?, view_);
    let (size, offset) = correlations(&arrivals);
    let end = arrivals.last().map_or(1.0, |last| last.at_ms);
    let mean = |of: &[Arrival]| {
        100.0 * of.iter().map(|a| a.at_ms / end).sum::<f64>() / of.len().max(1) as f64
    };
    let thirds = |key: fn(&Arrival) -> f64| {
        let mut sorted = arrivals.clone();
        sorted.sort_by(|a, b| key(a).total_cmp(&key(b)));
        let third = sorted.len() / 3;
        [mean(&sorted[..third]), mean(&sorted[sorted.len() - third..])]
    };
    let [smallest, largest] = thirds(|a| a.size_px);
    let [middle, edge] = thirds(|a| a.offset);
    println!(
        "| {name} | {view} | {} | {size:.2} | {offset:.2} | {largest:.0} | {smallest:.0} | {middle:.0} | \
         {edge:.0} |",
        arrivals.len()
    );
    Ok(())
}
