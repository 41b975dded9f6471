//! `stability`: every algorithm on stiff and extreme cases, beside a reference.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context;
use clap::Args;
use lodestream_server::commands::print;

use crate::{report::machine, stability};

/// Try every algorithm on stiff and extreme cases, against a reference of many digits
#[derive(Debug, Clone, Args)]
pub struct StabilityArgs {
    /// Folder for stability.csv, stability.json and stability.html; made if it is missing
    #[arg(short, long, value_name = "DIR")]
    pub output: PathBuf,
    /// Only algorithms and cases whose names contain this
    #[arg(long, value_name = "NAME")]
    pub case: Option<String>,
}

/// Prints the table and writes the reports; fails where an error is beyond its tolerance.
///
/// # Errors
/// Where no case is so named, a case cannot be tried, or a file cannot be written.
pub fn run(args: StabilityArgs) -> anyhow::Result<ExitCode> {
    let table = stability::run(args.case.as_deref())?;
    let folder = &args.output;
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create", folder.display()))?;
    let version = env!("CARGO_PKG_VERSION").to_owned();
    let facts = vec![("machine".into(), machine()), ("lodestream".into(), version)];
    let page = stability::page(&table, command(&args), facts).render();
    for (name, text) in
        [("stability.csv", table.csv()), ("stability.json", table.json()), ("stability.html", page)]
    {
        write(&folder.join(name), &text)?;
    }
    print(&table.text())?;
    let has_passed = table.missed().next().is_none();
    Ok(if has_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    std::fs::write(path, text).with_context(|| format!("{}: cannot write", path.display()))
}

/// The command line that does the same.
fn command(args: &StabilityArgs) -> String {
    let folder = args.output.display();
    let case = args.case.as_ref().map_or(String::new(), |case| format!(" --case {case:?}"));
    format!("lodestream stability -o {folder}{case}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_three_reports_and_refuses_names_of_nothing() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let output = folder.path().join("new/folder");
        let args = |case: &str| StabilityArgs { output: output.clone(), case: Some(case.into()) };
        let code = run(args("eigen")).expect("runs");
        assert_eq!(format!("{code:?}"), format!("{:?}", ExitCode::SUCCESS));
        let read = |name: &str| std::fs::read_to_string(output.join(name)).expect(name);
        let csv = read("stability.csv");
        assert!(csv.lines().skip(1).all(|line| line.contains("eigen")), "{csv}");
        assert!(read("stability.json").contains("lodestream-stability"));
        assert!(read("stability.html").contains("--case &quot;eigen&quot;"));
        let error = run(args("no such thing")).expect_err("no case").to_string();
        assert!(error.contains("no such thing") && error.contains("covariance"), "{error}");
    }
}
