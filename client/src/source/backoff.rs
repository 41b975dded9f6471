//! How long to wait before trying again.

use std::time::Duration;

/// Exponential backoff with jitter, bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Backoff {
    /// Longest wait after the first failure.
    pub first: Duration,
    /// Longest wait after any number of failures.
    pub most: Duration,
}

impl Default for Backoff {
    /// From 100 ms to 5 s.
    fn default() -> Self {
        Self { first: Duration::from_millis(100), most: Duration::from_secs(5) }
    }
}

impl Backoff {
    /// The wait after `failures` failures in a row: doubled with each, then shortened by up to a
    /// half at random, so that clients which lost a server together do not return together.
    #[must_use]
    pub fn delay(&self, failures: u32) -> Duration {
        let doublings = failures.saturating_sub(1).min(20);
        let longest = self.first.saturating_mul(1 << doublings).min(self.most);
        longest.mul_f64(0.5 + 0.5 * fastrand::f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waits_double_up_to_the_bound_and_vary_by_half() {
        let backoff = Backoff { first: Duration::from_millis(100), most: Duration::from_secs(1) };
        for (failures, longest_ms) in
            [(0, 100), (1, 100), (2, 200), (4, 800), (5, 1000), (99, 1000)]
        {
            for _ in 0..100 {
                let delay = backoff.delay(failures).as_secs_f64() * 1e3;
                let longest = f64::from(longest_ms);
                assert!((0.5 * longest..=longest).contains(&delay), "{delay} after {failures}");
            }
        }
    }
}
