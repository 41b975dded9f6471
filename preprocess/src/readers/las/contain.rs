//! Panics of a decoder, contained.
//!
//! The LAZ decoder indexes its tables with what the bytes say: a damaged file can make it panic.
//! For a user that is a damaged file, one line, and not a report of a crash; so the default panic
//! message is held back on the thread that is inside [`contain`], and only there.

use std::{
    cell::Cell,
    panic::{self, AssertUnwindSafe},
    sync::Once,
};

thread_local! {
    static CONTAINED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work`; a panic in it comes back as its message.
///
/// `work` must leave nothing half changed that is used afterwards: callers drop their decoder.
pub(super) fn contain<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !CONTAINED.get() {
                report(info);
            }
        }));
    });
    let outer = CONTAINED.replace(true);
    let outcome = panic::catch_unwind(AssertUnwindSafe(work));
    CONTAINED.set(outer);
    outcome.map_err(|payload| {
        payload
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| payload.downcast_ref::<&str>().map(|text| (*text).to_owned()))
            .unwrap_or_else(|| "unknown".to_owned())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn returns_what_the_work_returns() {
        assert_eq!(contain(|| 7), Ok(7));
    }

    #[test]
    fn turns_a_panic_into_its_message() {
        let numbers = [1, 2, 3];
        let index = std::hint::black_box(3);
        let message = contain(|| numbers[index]).expect_err("the index is out of bounds");
        assert!(message.contains("out of bounds"), "{message}");
    }
}
