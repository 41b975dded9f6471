//! `eval`: error against run time, of every method, budget and policy.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context;
use clap::Args;
use lodestream_server::commands::{cancel_on_interrupt, print};

use crate::{
    commands::command_line,
    engine::Policy,
    eval::{self, EvalConfig, Report, ViewSize},
    render::{Splat, SplatSize},
    source::LinkSpec,
};

/// Measure error against run time: building, drawing, streaming, leaving out
#[derive(Debug, Clone, Args)]
pub struct EvalArgs {
    /// Datasets: files, URLs, a server's address with a dataset's name; or anything that `build` takes,
    /// each built apart
    #[arg(required_unless_present = "compare", value_name = "SOURCE|INPUT")]
    pub inputs: Vec<String>,
    /// Folder for eval.html, eval.json and tables of CSV; made if it is missing
    #[arg(short, long, value_name = "DIR", required_unless_present = "compare")]
    pub output: Option<PathBuf>,
    /// How inputs are built
    #[arg(long, value_name = "METHOD,…", value_delimiter = ',', default_value = "poisson",
          value_parser = ["poisson"])]
    pub methods: Vec<String>,
    /// Most points of a frame
    #[arg(long, value_name = "POINTS,…", value_delimiter = ',',
          default_values_t = [100_000, 300_000, 1_000_000, 3_000_000])]
    pub budgets: Vec<u64>,
    /// Ways to draw: SPLAT:SIZE as in `shot`
    #[arg(long, value_name = "SPLAT:SIZE,…", value_delimiter = ',', value_parser = way,
          default_value = "point:1px,square:2px,circle:adaptive:1.6,blended:adaptive:1.6")]
    pub splats: Vec<(Splat, SplatSize)>,
    /// Ways to fetch: ours, and those of the rivals
    #[arg(
        long,
        value_name = "POLICY,…",
        value_delimiter = ',',
        default_value = "ours,potree-brotli,potree,fraiss"
    )]
    pub policies: Vec<Policy>,
    /// Links: bandwidth / round trip / loss
    #[arg(
        long,
        value_name = "LINK,…",
        value_delimiter = ',',
        default_value = "20mbit/40ms,100mbit/20ms,4mbit/100ms/1%"
    )]
    pub links: Vec<LinkSpec>,
    /// Camera paths to follow without waiting: files or generators, as in `shot --path`
    #[arg(long, value_name = "PATH,…", value_delimiter = ',')]
    pub paths: Vec<String>,
    /// Distances to look from
    #[arg(long, value_name = "SIZE,…", value_delimiter = ',', default_value = "near,medium,far")]
    pub sizes: Vec<ViewSize>,
    /// Most points while streaming
    #[arg(long, value_name = "POINTS", default_value_t = 1_000_000)]
    pub stream_budget: u64,
    /// Width of the pictures in pixels; they are 16 : 9
    #[arg(long, value_name = "PIXELS", default_value_t = 960, value_parser = clap::value_parser!(u32).range(64..=7680))]
    pub width: u32,
    /// Where samples lie and which packets are lost
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    pub seed: u64,
    /// Small pictures, few budgets, one link: a minute instead of many
    #[arg(long)]
    pub quick: bool,
    /// Compare two eval.json instead; fails where the second is worse beyond noise
    #[arg(long, num_args = 2, value_names = ["BEFORE.json", "AFTER.json"],
          conflicts_with_all = ["inputs", "output"])]
    pub compare: Vec<PathBuf>,
}

/// Reads `circle:adaptive:1.6`.
fn way(text: &str) -> Result<(Splat, SplatSize), String> {
    let (splat, size) = text.split_once(':').ok_or("expected SPLAT:SIZE, such as circle:2px")?;
    let splat = splat.parse().map_err(|e| format!("{splat}: {e}"))?;
    let size = size.parse().map_err(|e| format!("{size}: {e}"))?;
    Ok((splat, size))
}

/// Evaluates and writes the reports, or compares two.
///
/// # Errors
/// Where an input cannot be built or read, a picture cannot be drawn, or a file cannot be written.
pub fn run(args: EvalArgs) -> anyhow::Result<ExitCode> {
    if let [before, after] = args.compare.as_slice() {
        return compare(before, after);
    }
    let Some(folder) = &args.output else { anyhow::bail!("where to? Add -o DIR") };
    if args.budgets.contains(&0) || args.stream_budget == 0 {
        anyhow::bail!("a budget of 0 points draws nothing: give at least 1");
    }
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create", folder.display()))?;
    let mut config = EvalConfig {
        inputs: args.inputs.clone(),
        methods: args.methods.clone(),
        budgets: args.budgets.clone(),
        splats: args.splats.clone(),
        policies: args.policies.clone(),
        links: args.links.clone(),
        paths: args.paths.clone(),
        path_frames: 12,
        views: args.sizes.clone(),
        size_px: [args.width, (args.width * 9).div_ceil(16)],
        samples: 4,
        runs: 5,
        stream_budget: args.stream_budget,
        seed: args.seed,
        command: command_line(),
    };
    if args.quick {
        config.size_px = [320, 180];
        config.budgets.truncate(2);
        config.links.truncate(1);
        config.runs = 2;
        config.path_frames = 4;
    }
    let cancel = cancel_on_interrupt()?;
    let start = std::time::Instant::now();
    let say = |what: &str| eprintln!("{:>7.1} s  {what}", start.elapsed().as_secs_f64());
    let (report, exhibits) = eval::run(&config, &cancel, &say)?;
    let page = eval::page(&report, &exhibits);
    let summary = page.summary.clone();
    let mut files = report.tables();
    files.push(("eval.json", report.json()));
    files.push(("eval.html", page.render()));
    for (name, text) in files {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("{}: cannot write", path.display()))?;
    }
    print(&format!("{summary}\n{}\n", folder.join("eval.html").display()))?;
    Ok(ExitCode::SUCCESS)
}

fn compare(before: &Path, after: &Path) -> anyhow::Result<ExitCode> {
    let read = |path: &Path| -> anyhow::Result<Report> {
        let name = || path.display().to_string();
        let text = std::fs::read_to_string(path).with_context(name)?;
        let report: Report = serde_json::from_str(&text)
            .with_context(|| format!("{}: not an eval.json of this version", name()))?;
        if report.format != "lodestream-eval" || report.version != 1 {
            anyhow::bail!("{}: not an eval.json of this version", name());
        }
        Ok(report)
    };
    let (earlier, later) = (read(before)?, read(after)?);
    let settings = |report: &Report| {
        let [width, height] = report.size_px;
        let (samples, seed) = (report.samples, report.seed);
        format!("{width} x {height} pixels, {samples} x {samples} samples, seed {seed}")
    };
    let [ours, theirs] = [&later, &earlier].map(settings);
    if ours != theirs {
        let [after, before] = [after, before].map(Path::display);
        anyhow::bail!("{after}: of {ours}, but {before}: of {theirs}; evaluate both alike");
    }
    let (differences, missing) = eval::compare(&earlier, &later);
    let mut text = String::new();
    for difference in &differences {
        let mark = if difference.is_regression { "WORSE" } else { "" };
        let (what, before, after) = (&difference.what, difference.before, difference.after);
        let change = match before {
            0.0 => "from nothing".to_owned(),
            _ => format!("{:+.1} %", 100.0 * (after - before) / before.abs()),
        };
        text += &format!("{mark:5} {what}: {before:.5} -> {after:.5} ({change})\n");
    }
    for what in &missing {
        text += &format!("GONE  {what}\n");
    }
    let worse = differences.iter().filter(|d| d.is_regression).count() + missing.len();
    let same = differences.len() + missing.len() - worse;
    text += &format!("{worse} worse or gone, {same} different within noise or better\n");
    print(&text)?;
    Ok(if worse == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
