//! Waiting that an interrupt ends.

use std::{
    sync::atomic::AtomicBool,
    time::{Duration, Instant},
};

use crate::{
    engine::{Engine, EngineError},
    interrupt::go_on,
};

/// How long a wait may go on before it looks for an interrupt.
const TURN: Duration = Duration::from_millis(50);

/// Waits for the engine in short turns, `timeout` in all.
///
/// # Errors
/// As `turn`; where the flag is set.
pub(super) fn wait<T>(
    cancel: &AtomicBool,
    timeout: Duration,
    turn: impl Fn(Duration) -> Result<T, EngineError>,
) -> anyhow::Result<T> {
    let start = Instant::now();
    loop {
        go_on(cancel)?;
        let left = timeout.saturating_sub(start.elapsed());
        match turn(left.min(TURN)) {
            Err(EngineError::Timeout { .. }) if !left.is_zero() => {}
            // Not after the last turn, but after all of them.
            Err(EngineError::Timeout { missing, .. }) => {
                let seconds = timeout.as_secs_f64();
                return Err(EngineError::Timeout { seconds, missing }.into());
            }
            outcome => return Ok(outcome?),
        }
    }
}

/// Waits until a moment, whatever the engine does meanwhile.
///
/// # Errors
/// Where a source can no longer be read; where the flag is set.
pub(super) fn wait_until(
    moment: Instant,
    cancel: &AtomicBool,
    engine: &Engine,
) -> anyhow::Result<()> {
    loop {
        go_on(cancel)?;
        if let Some(failure) = engine.clouds().into_iter().find_map(|cloud| cloud.failure) {
            return Err(EngineError::Cloud(failure).into());
        }
        let left = moment.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(());
        }
        std::thread::sleep(left.min(TURN));
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering;

    use super::*;

    fn late() -> EngineError {
        EngineError::Timeout { seconds: 0.0, missing: "2 nodes".into() }
    }

    #[test]
    fn a_wait_ends_with_what_it_waited_for_or_says_how_long_it_was() {
        let cancel = AtomicBool::new(false);
        let error = wait::<()>(&cancel, Duration::ZERO, |_| Err(late())).expect_err("no time");
        assert_eq!(error.to_string(), "not complete after 0.0 s: 2 nodes");
        let turns = std::cell::Cell::new(0);
        let third = |turn| {
            turns.set(turns.get() + 1);
            if turns.get() == 3 { Ok(turn) } else { Err(late()) }
        };
        let last = wait(&cancel, Duration::from_secs(3600), third).expect("at the third turn");
        assert_eq!(last, TURN);
    }

    #[test]
    fn an_interrupt_ends_a_wait() {
        let cancel = AtomicBool::new(false);
        let never = |_| {
            cancel.store(true, Ordering::Relaxed);
            Err(late())
        };
        let error = wait::<()>(&cancel, Duration::from_secs(3600), never).expect_err("interrupted");
        assert_eq!(error.to_string(), "interrupted");
    }
}
