//! `doctor`: what is wrong between here and a dataset.

use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use lodestream_server::commands::{print, print_json};

use crate::{
    doctor::{self, Verdict},
    source::Source,
};

/// Tell what is wrong between here and a dataset on a host, and what to do about it
#[derive(Debug, Clone, Args)]
pub struct DoctorArgs {
    /// Address of the dataset: a URL, or a server and a dataset
    #[arg(value_name = "URL")]
    pub source: String,
    /// Print what was found as JSON
    #[arg(long)]
    pub json: bool,
    /// Fail for warnings, too
    #[arg(long)]
    pub strict: bool,
}

/// Examines, and says on standard output what was found. Fails where anything has to be repaired.
///
/// # Errors
/// Where the address is none.
pub fn run(args: DoctorArgs) -> anyhow::Result<ExitCode> {
    let url = Source::parse_url(&args.source)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start")?;
    let diagnosis = runtime.block_on(doctor::examine(url));
    // Does not wait for a name server that hangs.
    runtime.shutdown_background();
    let diagnosis = diagnosis?;
    if args.json {
        print_json(&diagnosis)?;
    } else {
        print(&diagnosis.text())?;
    }
    let most = if args.strict { Verdict::Ok } else { Verdict::Warn };
    Ok(if diagnosis.verdict <= most { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}
