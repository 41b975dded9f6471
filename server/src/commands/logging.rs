//! Log lines on standard error.

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;

use super::serve::LogFormat;

/// Sends this process's log to standard error, a line per event, from level `info` on. Where a log
/// is set up already, that one stays.
pub fn log_to_stderr_as(format: LogFormat) {
    let lines = tracing_subscriber::fmt()
        .with_max_level(LevelFilter::INFO)
        .with_target(false)
        .with_writer(std::io::stderr);
    // An error only says that there is a subscriber already.
    let _ = match format {
        LogFormat::Human => lines.compact().with_ansi(std::io::stderr().is_terminal()).try_init(),
        LogFormat::Json => lines.json().flatten_event(true).with_target(true).try_init(),
    };
}
