//! Ctrl-C and the termination signal, for work that can be cancelled.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use anyhow::Context;

/// A flag that the first Ctrl-C (or termination signal) sets; the second ends the process at once,
/// with exit code 1. To be called once in a process.
///
/// # Errors
/// Where the system does not let the signals be handled.
pub fn cancel_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let flag = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&flag);
    ctrlc::set_handler(move || {
        if seen.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
        eprintln!("stopping; interrupt again to stop at once");
    })
    .context("cannot handle Ctrl-C")?;
    Ok(flag)
}
