//! `build`: scans in, one dataset file out.

use std::{num::NonZeroUsize, path::PathBuf, process::ExitCode};

use clap::{Args, ValueEnum};
use indicatif::{BinaryBytes, HumanCount};
use lodestream_preprocess::{self as preprocess, BuildConfig, BuildReport, preview::write_preview};

use super::{TerminalProgress, cancel_on_interrupt, parse_size, print, write_report};

/// Build a level-of-detail dataset from scans
#[derive(Debug, Clone, Args)]
pub struct BuildArgs {
    /// LAS, LAZ, PLY, XYZ, CSV or TXT files, folders of them, or a simulated scan such as
    /// 'sim:courtyard?points=2M&seed=1'; all together make one dataset
    #[arg(required = true, value_name = "INPUT")]
    pub inputs: Vec<String>,
    /// The dataset file to write
    #[arg(short, long, value_name = "NAME.lods", value_parser = dataset_path)]
    pub output: PathBuf,
    /// How levels of detail are made
    #[arg(long, value_enum, default_value_t = MethodName::Poisson)]
    pub method: MethodName,
    /// Grid cells per node side: a power of two from 4 to 1024; the minimum distance between points
    /// of a level is the node's side over this
    #[arg(long, value_name = "CELLS", default_value_t = 128, value_parser = grid)]
    pub grid: u32,
    /// Memory to stay under; what does not fit goes through temporary files beside the output
    #[arg(long, value_name = "SIZE", default_value = "4GiB", value_parser = parse_size)]
    pub memory: u64,
    /// Threads [default: as many as the machine has]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Write what was done, in figures, to this file as JSON
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Draw no picture for lists of datasets beside the dataset (NAME.preview.png)
    #[arg(long)]
    pub no_preview: bool,
    /// Attributes to leave out
    #[arg(long, value_name = "ATTR,…", value_delimiter = ',')]
    pub drop: Vec<String>,
    /// What the columns of text inputs are, such as 'x,y,z,intensity,-,red,green,blue' [default:
    /// detected]
    #[arg(long, value_name = "NAME,…")]
    pub columns: Option<String>,
    /// Lattice step in world units [default: the inputs' own, or far below the point spacing]
    #[arg(long, value_name = "STEP", value_parser = step)]
    pub scale: Option<f64>,
    /// Cells per spacing that positions are told to at first, a power of two up to 256; what is finer lies apart,
    /// for views that show it, and so do the last bits of colours. 0: all in one part
    #[arg(long, value_name = "CELLS", default_value_t = preprocess::CELLS_PER_SPACING)]
    pub cells: u32,
}

/// Methods, as the command line names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodName {
    /// Nested octree of Poisson-disk samples; no point is lost or moved
    Poisson,
}

impl From<MethodName> for preprocess::Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Poisson => Self::Poisson,
        }
    }
}

/// Builds; says on standard output what came of it.
///
/// # Errors
/// What [`preprocess::build()`] says; where the report cannot be written.
pub fn run(args: BuildArgs) -> anyhow::Result<ExitCode> {
    let config = BuildConfig {
        inputs: args.inputs,
        output: args.output,
        method: args.method.into(),
        grid: args.grid,
        memory_bytes: args.memory,
        threads: args.threads.map(NonZeroUsize::get),
        drop_attributes: args.drop,
        columns: args.columns,
        scale: args.scale,
        cells_per_spacing: args.cells,
        cancel: cancel_on_interrupt()?,
    };
    let progress = TerminalProgress::default();
    let report = preprocess::build(&config, &progress)?;
    progress.finish();
    if !args.no_preview {
        // The dataset is complete without it.
        if let Err(e) = write_preview(&config.output) {
            eprintln!("warning: no preview was drawn: {e}");
        }
    }
    if let Some(path) = &args.report {
        write_report(path, &report)?;
    }
    print(&summary(&report))?;
    Ok(ExitCode::SUCCESS)
}

fn summary(report: &BuildReport) -> String {
    let per_point = report.file_bytes as f64 / report.points_written.max(1) as f64;
    let mut text = format!(
        "{}: {} points, {} nodes, {} levels, {} ({per_point:.2} bytes per point) in {:.2} s\n",
        report.output.display(),
        HumanCount(report.points_written),
        HumanCount(report.nodes),
        report.levels,
        BinaryBytes(report.file_bytes),
        report.total_seconds,
    );
    for dropped in &report.dropped {
        text += &format!("dropped {} points: {}\n", HumanCount(dropped.points), dropped.reason);
    }
    text
}

fn dataset_path(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let has_suffix = path.extension().is_some_and(|extension| extension == "lods");
    if has_suffix { Ok(path) } else { Err("a dataset's name ends in .lods".into()) }
}

fn grid(text: &str) -> Result<u32, String> {
    let cells = text.parse().ok().filter(|c: &u32| c.is_power_of_two() && (4..=1024).contains(c));
    cells.ok_or_else(|| "not a power of two from 4 to 1024".into())
}

fn step(text: &str) -> Result<f64, String> {
    let step = text.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0);
    step.ok_or_else(|| "not a finite number above zero".into())
}
