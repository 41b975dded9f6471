//! The commands of the command line that need no GPU, for both binaries.
//!
//! Each has its arguments and a `run`. Exit codes: 0 done, 1 failed, 2 bad usage (by clap).
//! Results go to standard output, all else to standard error.

pub mod build;
pub mod inspect;
pub mod ping;
pub mod preview;
pub mod serve;
pub mod sign;
pub mod token;
pub mod verify;

mod interrupt;
mod logging;
mod progress;
mod size;

use std::{io::Write, path::Path, process::ExitCode};

use anyhow::Context;
use serde::Serialize;

pub use interrupt::cancel_on_interrupt;
pub use logging::log_to_stderr_as;
pub use progress::TerminalProgress;
pub use size::parse_size;

/// Ends a command: an error becomes one line, `error: …`, on standard error.
#[must_use]
pub fn finish(outcome: anyhow::Result<ExitCode>) -> ExitCode {
    outcome.unwrap_or_else(|e| {
        eprintln!("error: {}", one_line(&e));
        ExitCode::FAILURE
    })
}

/// An error and its causes; those whose text an outer one tells already are not repeated.
fn one_line(error: &anyhow::Error) -> String {
    let mut line = String::new();
    for cause in error.chain().map(|cause| cause.to_string().replace(['\n', '\r'], " ")) {
        if !line.contains(&cause) {
            line += if line.is_empty() { "" } else { ": " };
            line += &cause;
        }
    }
    line
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no failure.
///
/// # Errors
/// Where standard output cannot be written.
pub fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        outcome => outcome.context("cannot write to standard output"),
    }
}

/// Prints a value as indented JSON and a line end.
///
/// # Errors
/// As for [`print()`].
pub fn print_json(value: &impl Serialize) -> anyhow::Result<()> {
    print(&(serde_json::to_string_pretty(value)? + "\n"))
}

/// Writes a `--report` file.
///
/// # Errors
/// Where the file cannot be written.
pub fn write_report(path: &Path, report: &impl Serialize) -> anyhow::Result<()> {
    let json = serde_json::to_string_pretty(report)? + "\n";
    std::fs::write(path, json).with_context(|| format!("{}: cannot write", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_is_one_line_without_repetition() {
        let error = anyhow::anyhow!("line one\nline two")
            .context("a.lods: cannot read: line one line two")
            .context("outer");
        assert_eq!(one_line(&error), "outer: a.lods: cannot read: line one line two");
    }
}
