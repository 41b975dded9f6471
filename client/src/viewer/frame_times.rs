//! How long the last frames took.

use std::{collections::VecDeque, time::Duration};

/// Frames that are remembered.
const MOST: usize = 240;

/// Times of the last frames in which a picture was drawn.
#[derive(Debug, Clone, Default)]
pub struct FrameTimes {
    times: VecDeque<Duration>,
}

impl FrameTimes {
    /// Notes a frame.
    pub fn note(&mut self, time: Duration) {
        if self.times.len() == MOST {
            self.times.pop_front();
        }
        self.times.push_back(time);
    }

    /// Milliseconds that the given share of the frames took at most; `None` before the first.
    #[must_use]
    pub fn percentile_ms(&self, share: f64) -> Option<f64> {
        let mut times: Vec<_> = self.times.iter().copied().collect();
        times.sort_unstable();
        let last = times.len().checked_sub(1)?;
        let index = (share.clamp(0.0, 1.0) * last as f64).round() as usize;
        Some(times[index].as_secs_f64() * 1e3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_the_last_frames() {
        let mut times = FrameTimes::default();
        assert_eq!(times.percentile_ms(0.5), None);
        (0..1000).for_each(|_| times.note(Duration::from_secs(9)));
        (1..=MOST as u64).rev().for_each(|ms| times.note(Duration::from_millis(ms)));
        assert_eq!(times.percentile_ms(0.0), Some(1.0));
        assert_eq!(times.percentile_ms(1.0), Some(240.0));
        assert!(times.percentile_ms(0.5).is_some_and(|ms| (ms - 120.0).abs() <= 1.0));
    }
}
