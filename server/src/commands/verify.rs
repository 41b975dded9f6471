//! `verify`: proof that a dataset is what it should be.

use std::{path::PathBuf, process::ExitCode};

use anyhow::bail;
use clap::Args;
use indicatif::HumanCount;
use lodestream_preprocess::{self as preprocess, VerifyConfig, VerifyReport};

use super::{TerminalProgress, cancel_on_interrupt, print, print_json};

/// Check a dataset: checksums, tree, distances; and, beside its inputs, that no point is missing
#[derive(Debug, Clone, Args)]
pub struct VerifyArgs {
    /// The dataset
    #[arg(value_name = "NAME.lods")]
    pub dataset: PathBuf,
    /// The inputs it was built from: accounts for every point, bit by bit
    #[arg(long, value_name = "INPUT", num_args = 1..)]
    pub against: Vec<String>,
    /// What the columns of text inputs are, as for the build
    #[arg(long, value_name = "NAME,…", requires = "against")]
    pub columns: Option<String>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// Verifies; says on standard output what was found.
///
/// # Errors
/// Where something is wrong with the dataset, or it or an input cannot be read.
pub fn run(args: VerifyArgs) -> anyhow::Result<ExitCode> {
    let config = VerifyConfig {
        dataset: args.dataset,
        against: args.against,
        columns: args.columns,
        cancel: cancel_on_interrupt()?,
    };
    let progress = TerminalProgress::default();
    let report = preprocess::verify(&config, &progress)?;
    progress.finish();
    let name = config.dataset.display();
    if args.json {
        print_json(&report)?;
    } else {
        print(&format!("{name}: {}", summary(&report)))?;
    }
    if report.is_sound() {
        return Ok(ExitCode::SUCCESS);
    }
    let findings = report.findings.len() as u64 + report.further_findings;
    bail!("{name}: not sound: {} things are wrong with it", HumanCount(findings))
}

fn summary(report: &VerifyReport) -> String {
    let mut text = format!(
        "{} points in {} nodes; {} of them checked for their distance, {} pairs too close\n",
        HumanCount(report.points),
        HumanCount(report.nodes),
        HumanCount(report.spacing_checked),
        HumanCount(report.spacing_violations),
    );
    if let Some(against) = &report.against {
        text += &format!(
            "inputs: {} points, {} dropped; {}; largest coordinate error {}\n",
            HumanCount(against.input_points),
            HumanCount(against.dropped),
            if against.identical { "the same, bit by bit" } else { "not the same" },
            against.largest_coordinate_error,
        );
        if !against.attributes_left_out.is_empty() {
            text += &format!("left out: {}\n", against.attributes_left_out.join(", "));
        }
    }
    for finding in &report.findings {
        text += &format!("wrong: {finding}\n");
    }
    if report.further_findings > 0 {
        text += &format!("and {} more\n", HumanCount(report.further_findings));
    }
    if report.is_sound() {
        text += "sound\n";
    }
    text
}
