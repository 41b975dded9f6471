//! `inspect`: like the server's, and of URLs too.

use std::process::ExitCode;

use clap::Args;
use lodestream_protocol::Dataset;
use lodestream_server::{
    commands::{print, print_json},
    describe,
};

use crate::source::{BlockingSource, Source};

/// Tell what a dataset holds: counts, bounds, levels, bytes, and what is absent
#[derive(Debug, Clone, Args)]
pub struct InspectArgs {
    /// A dataset file, its URL, or a server's address with the dataset's name
    #[arg(value_name = "NAME.lods|URL")]
    pub source: String,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Prints the description.
///
/// # Errors
/// Where the dataset cannot be read.
pub fn run(args: InspectArgs) -> anyhow::Result<ExitCode> {
    let source = BlockingSource::new(Source::parse(&args.source)?)?;
    let dataset =
        Dataset::open(source).map_err(|e| anyhow::anyhow!("{}: {e}", args.source))?;
    let description =
        describe::describe(&dataset).map_err(|e| anyhow::anyhow!("{}: {e}", args.source))?;
    if args.json {
        print_json(&description)?;
    } else {
        print(&describe::render(&description))?;
    }
    Ok(ExitCode::SUCCESS)
}
