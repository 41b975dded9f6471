//! A load test from addresses to a report.

use std::sync::{Arc, atomic::AtomicBool};

use anyhow::Context;
use lodestream_protocol::{Dataset, Manifest};

use super::{
    config::{LoadConfig, MOST_SECONDS},
    crowd::{self, Standing},
    itinerary::Itinerary,
    process,
    report::{FORMAT, LoadReport, RunReport, VERSION},
};
use crate::{
    engine::Policy,
    path::Extent,
    report::machine,
    source::{BlockingSource, Source, Wire, is_local},
};

/// Makes the runs. `tell` is told which one is under way and how it is going.
///
/// # Errors
/// Where something is out of bounds, a source cannot be opened, or the system gives no threads.
pub fn run(
    config: &LoadConfig,
    cancel: &AtomicBool,
    tell: &(dyn Fn(Policy, usize, &Standing) + Sync),
) -> anyhow::Result<LoadReport> {
    config.check()?;
    let (clouds, places) = open(&config.sources)?;
    let path = config.path.clone().path(&Extent::of(&clouds)?)?;
    let seconds = path.duration();
    anyhow::ensure!(
        (1.0..=MOST_SECONDS as f64).contains(&seconds),
        "{}: takes {seconds} s; clients follow paths of 1 to {MOST_SECONDS} seconds",
        config.path_name
    );
    let itinerary = Arc::new(Itinerary::new(&path, config.size_px, config.views_per_second));
    let server = match config.server_pid {
        Some(pid) => vec![pid],
        None => servers(&config.sources)?,
    };
    let mut report = LoadReport {
        format: FORMAT.into(),
        version: VERSION,
        lodestream: env!("CARGO_PKG_VERSION").into(),
        machine: machine(),
        command: config.command.clone(),
        sources: places,
        path: config.path_name.clone(),
        path_seconds: seconds,
        path_jumps: itinerary.jumps(),
        link: config.link.map(|link| link.to_string()),
        point_budget: config.engine.point_budget,
        size_px: config.size_px,
        views_per_second: config.views_per_second,
        ramp_seconds: config.ramp.as_secs_f64(),
        keeps: config.keeps,
        batches: config.engine.batches,
        runs: Vec::new(),
        knees: Vec::new(),
        ratios: Vec::new(),
    };
    for &clients in &config.clients {
        for &policy in &config.policies {
            let tell = |standing: &Standing| tell(policy, clients, standing);
            let outcome = crowd::run(config, &itinerary, policy, clients, &server, cancel, &tell)?;
            report.runs.push(RunReport::new(policy, clients, &outcome));
            if outcome.is_interrupted {
                return Ok(report.concluded());
            }
        }
    }
    Ok(report.concluded())
}

/// What the datasets say about themselves, and how they are shown.
fn open(sources: &[String]) -> anyhow::Result<(Vec<Arc<Manifest>>, Vec<String>)> {
    let mut clouds = Vec::new();
    let mut places = Vec::new();
    for text in sources {
        let source = Source::by_wire(text, Wire::default())?;
        places.push(source.describe());
        let dataset = Dataset::open(BlockingSource::new(source)?).with_context(|| text.clone())?;
        clouds.push(Arc::new(dataset.boot().manifest.clone()));
    }
    Ok((clouds, places))
}

/// The processes behind addresses of this machine.
fn servers(sources: &[String]) -> anyhow::Result<Vec<u32>> {
    let mut pids = Vec::new();
    for text in sources {
        let url = Source::parse_url(text)?;
        if let Some(port) = url.port_or_known_default().filter(|_| is_local(&url)) {
            pids.extend(process::listening(port));
        }
    }
    pids.sort_unstable();
    pids.dedup();
    Ok(pids)
}
