//! `inspect`: what a dataset holds, and what it takes.

use std::{path::Path, process::ExitCode};

use anyhow::Context;
use clap::Args;
use lodestream_preprocess::FileSource;
use lodestream_protocol::{Dataset, ReadAt};

use super::{print, print_json};
use crate::describe::{describe, render};

/// Tell what a dataset holds: counts, bounds, levels, bytes per column, what is absent
#[derive(Debug, Clone, Args)]
pub struct InspectArgs {
    /// The dataset
    #[arg(value_name = "NAME.lods")]
    pub source: String,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Inspects a local file.
///
/// # Errors
/// Where the file cannot be read as a dataset.
pub fn run(args: InspectArgs) -> anyhow::Result<ExitCode> {
    let source = FileSource::open(Path::new(&args.source))?;
    inspect(&args, source)
}

/// Inspects a dataset from any source.
///
/// # Errors
/// Where the bytes cannot be had or are no dataset.
pub fn inspect(args: &InspectArgs, source: impl ReadAt) -> anyhow::Result<ExitCode> {
    let description = Dataset::open(source)
        .and_then(|dataset| describe(&dataset))
        .with_context(|| args.source.clone())?;
    if args.json {
        print_json(&description)?;
    } else {
        print(&format!("{}\n{}", args.source, render(&description)))?;
    }
    Ok(ExitCode::SUCCESS)
}
