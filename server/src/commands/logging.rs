//! Log lines on standard error.

use std::io::IsTerminal;

use tracing::level_filters::LevelFilter;

/// Sends this process's log to standard error, one compact line per event. Where a log is set up
/// already, that one stays.
pub fn log_to_stderr(is_verbose: bool) {
    let level = if is_verbose { LevelFilter::DEBUG } else { LevelFilter::INFO };
    // An error only says that there is a subscriber already.
    let _ = tracing_subscriber::fmt()
        .compact()
        .with_max_level(level)
        .with_target(false)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .try_init();
}
