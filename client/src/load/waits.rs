//! How long something took that may not have come at all: quantiles of waits.
//!
//! A wait begins when something was due, not when somebody got round to asking for it: so a slow server
//! is not spared by a client that it keeps from asking (the coordinated omission of G. Tene 2015). Nor
//! is it spared by what was given up: of those waits it is known that they would have been longer, and
//! the quantiles are those of Kaplan and Meier (1958), which are made for that.

use std::{iter::Peekable, time::Duration};

use hdrhistogram::{Counter, Histogram};
use serde::{Deserialize, Serialize};

/// The longest wait that is told apart.
const LONGEST: Duration = Duration::from_secs(3600);

/// Waits in microseconds.
#[derive(Debug, Clone)]
pub struct Waits {
    came: Histogram<u64>,
    given_up: Histogram<u64>,
}

/// Waits at some quantiles. None where too few came to tell: the wait is longer than all that are
/// known.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct WaitReport {
    /// What came.
    pub came: u64,
    /// What was given up before it came.
    pub given_up: u64,
    /// Half of all took at most this many milliseconds.
    pub p50_ms: Option<f64>,
    /// 90 % of all.
    pub p90_ms: Option<f64>,
    /// 99 % of all.
    pub p99_ms: Option<f64>,
    /// 99.9 % of all.
    pub p999_ms: Option<f64>,
    /// The longest wait of what came.
    pub max_ms: Option<f64>,
}

impl Waits {
    /// Nothing yet; times are told apart by so many significant digits.
    #[must_use]
    pub fn new(digits: u8) -> Self {
        let longest = u64::try_from(LONGEST.as_micros()).unwrap_or(u64::MAX);
        let empty = Histogram::new_with_max(longest, digits).expect("an hour in a few digits");
        Self { came: empty.clone(), given_up: empty }
    }

    /// It came after this time.
    pub fn came(&mut self, wait: Duration) {
        self.came.saturating_record(microseconds(wait));
    }

    /// It was given up after this time.
    pub fn gave_up(&mut self, wait: Duration) {
        self.given_up.saturating_record(microseconds(wait));
    }

    /// How much came.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.came.len()
    }

    /// Milliseconds within which a part `quantile` of all comes. `None` where that cannot be told.
    #[must_use]
    pub fn quantile_ms(&self, quantile: f64) -> Option<f64> {
        self.survival().find(|&(_, left)| left <= 1.0 - quantile + 1e-12).map(|(ms, _)| ms)
    }

    /// The part that has come, after so many milliseconds: from the first that came to the last.
    #[must_use]
    pub fn curve(&self) -> Vec<(f64, f64)> {
        self.survival().map(|(ms, left)| (ms, 1.0 - left)).collect()
    }

    /// The quantiles that are told.
    #[must_use]
    pub fn report(&self) -> WaitReport {
        let max = (!self.came.is_empty()).then(|| self.came.max() as f64 / 1e3);
        WaitReport {
            came: self.came.len(),
            given_up: self.given_up.len(),
            p50_ms: self.quantile_ms(0.5),
            p90_ms: self.quantile_ms(0.9),
            p99_ms: self.quantile_ms(0.99),
            p999_ms: self.quantile_ms(0.999),
            max_ms: max,
        }
    }

    /// After which milliseconds which part is still waited for.
    fn survival(&self) -> impl Iterator<Item = (f64, f64)> {
        let mut at_risk = self.came.len() + self.given_up.len();
        let mut given_up = recorded(&self.given_up).peekable();
        let mut left = 1.0;
        recorded(&self.came).map(move |(microseconds, came)| {
            // What was given up at the same time was waited for until then.
            at_risk -= before(&mut given_up, microseconds);
            left *= 1.0 - came as f64 / at_risk as f64; // Kaplan and Meier 1958, eq. 2a
            at_risk -= came;
            (microseconds as f64 / 1e3, left)
        })
    }
}

/// How many there are of less than `limit`.
fn before(values: &mut Peekable<impl Iterator<Item = (u64, u64)>>, limit: u64) -> u64 {
    let mut count = 0;
    while let Some((_, more)) = values.next_if(|&(value, _)| value < limit) {
        count += more;
    }
    count
}

fn recorded<T: Counter>(histogram: &Histogram<T>) -> impl Iterator<Item = (u64, u64)> {
    histogram
        .iter_recorded()
        .map(|step| (step.value_iterated_to(), step.count_since_last_iteration()))
}

fn microseconds(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}

/// The same quantiles of times that are all known.
#[must_use]
pub fn quantiles(times_us: &Histogram<u64>) -> WaitReport {
    let ms = |quantile| {
        (!times_us.is_empty()).then(|| times_us.value_at_quantile(quantile) as f64 / 1e3)
    };
    WaitReport {
        came: times_us.len(),
        given_up: 0,
        p50_ms: ms(0.5),
        p90_ms: ms(0.9),
        p99_ms: ms(0.99),
        p999_ms: ms(0.999),
        max_ms: ms(1.0),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn what_was_given_up_makes_the_others_count_for_more() {
        // Freireich 1963, the 6-MP arm: weeks of remission, and (+) those lost from sight.
        let mut waits = Waits::new(3);
        [6, 6, 6, 7, 10, 13, 16, 22, 23].into_iter().for_each(|w| waits.came(ms(w)));
        [6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35]
            .into_iter()
            .for_each(|w| waits.gave_up(ms(w)));
        let left: Vec<_> = waits.curve().iter().map(|(_, came)| 1.0 - came).collect();
        let known = [0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448];
        assert_eq!(left.len(), known.len());
        assert!(left.iter().zip(known).all(|(a, b)| (a - b).abs() < 6e-4), "{left:?}");
        let median = waits.quantile_ms(0.5).expect("reached");
        assert!((median - 23.0).abs() < 0.1, "{median}");
        assert_eq!(waits.quantile_ms(0.9), None, "too few came");
    }

    #[test]
    fn nothing_has_no_quantiles() {
        let mut waits = Waits::new(3);
        assert_eq!(waits.report(), WaitReport::default());
        waits.gave_up(ms(5));
        assert_eq!(waits.report().p50_ms, None);
    }

    proptest! {
        #[test]
        fn where_all_came_the_quantiles_are_the_ordinary_ones(
            times in prop::collection::vec(1u64..100_000, 1..300),
        ) {
            let mut waits = Waits::new(3);
            times.iter().for_each(|&t| waits.came(Duration::from_micros(t)));
            let mut sorted = times.clone();
            sorted.sort_unstable();
            for quantile in [0.5, 0.9, 0.99, 0.999] {
                let rank = (quantile * sorted.len() as f64 - 1e-9).ceil() as usize;
                let expected = sorted[rank.max(1) - 1] as f64 / 1e3;
                let found = waits.quantile_ms(quantile).expect("all came");
                prop_assert!((found - expected).abs() <= 2e-3 * expected + 1e-3, "{found} {expected}");
            }
        }

        #[test]
        fn more_that_is_given_up_never_makes_a_wait_shorter(
            times in prop::collection::vec(1u64..1000, 1..50),
            given_up in prop::collection::vec(1u64..1000, 1..50),
        ) {
            let mut waits = Waits::new(3);
            times.iter().for_each(|&t| waits.came(ms(t)));
            let before = waits.quantile_ms(0.9).expect("all came");
            given_up.iter().for_each(|&t| waits.gave_up(ms(t)));
            prop_assert!(waits.quantile_ms(0.9).is_none_or(|after| after >= before));
        }
    }
}
