//! `preview`: draws the small pictures that the list of datasets shows.

use std::{path::PathBuf, process::ExitCode};

use clap::Args;
use lodestream_preprocess::preview::write_preview;

use super::print;

/// Draw the previews of datasets, as `build` does
#[derive(Debug, Clone, Args)]
pub struct PreviewArgs {
    /// Datasets; each picture is written beside its dataset, as NAME.preview.png
    #[arg(required = true, value_name = "NAME.lods")]
    pub datasets: Vec<PathBuf>,
}

/// Draws, and says what was written.
///
/// # Errors
/// Where a dataset cannot be read or a picture not be written.
pub fn run(args: &PreviewArgs) -> anyhow::Result<ExitCode> {
    for dataset in &args.datasets {
        match write_preview(dataset)? {
            Some(path) => print(&format!("{}\n", path.display()))?,
            None => print(&format!("{}: no points, no picture\n", dataset.display()))?,
        }
    }
    Ok(ExitCode::SUCCESS)
}
