//! What there is to say of many errors: their mean, and how bad the worst are.

use serde::{Deserialize, Serialize};

/// Mean and upper end of errors that are not negative, in the unit of the errors.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// How many errors.
    pub count: u64,
    /// Their mean.
    pub mean: f64,
    /// The least error that at least 99 % of all do not exceed.
    pub p99: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// Of finite errors; `None` where there are none. Reorders them.
    pub(super) fn of(errors: &mut [f64]) -> Option<Self> {
        let count = errors.len();
        // In their order, before that is lost: the same sum on any number of cores.
        let mean = errors.iter().sum::<f64>() / count as f64;
        let max = errors.iter().copied().reduce(f64::max)?;
        let rank = (count - count / 100).saturating_sub(1);
        let (_, p99, _) = errors.select_nth_unstable_by(rank, f64::total_cmp);
        Some(Self { count: count as u64, mean, p99: *p99, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_in_a_hundred_may_be_worse_than_the_99th_percentile() {
        for (count, p99) in
            [(1, 1.0), (2, 2.0), (99, 99.0), (100, 99.0), (101, 100.0), (1000, 990.0)]
        {
            let mut errors: Vec<f64> = (1..=count).rev().map(f64::from).collect();
            let spread = Spread::of(&mut errors).expect("some");
            assert_eq!((spread.p99, spread.max), (p99, f64::from(count)), "{count}");
            assert_eq!(spread.mean, 0.5 * f64::from(count + 1));
            let within = errors.iter().filter(|e| **e <= p99).count();
            assert!(100 * within >= 99 * errors.len(), "{count}");
        }
        assert_eq!(Spread::of(&mut []), None);
    }
}
