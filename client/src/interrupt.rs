//! Long work that an interrupt ends.

use std::sync::atomic::{AtomicBool, Ordering};

/// Fails once the flag is set.
pub(crate) fn go_on(cancel: &AtomicBool) -> anyhow::Result<()> {
    anyhow::ensure!(!cancel.load(Ordering::Relaxed), "interrupted");
    Ok(())
}
