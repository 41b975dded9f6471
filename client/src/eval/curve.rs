//! Numbers that say in one what a curve of quality over time or bytes says.

use serde::{Deserialize, Serialize};

/// A moment of a run that streams.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Milliseconds since the view was set.
    pub ms: f64,
    /// Bytes received since then.
    pub bytes: u64,
    /// Requests sent since then.
    pub requests: u64,
    /// Points drawn.
    pub points: u64,
    /// Structural similarity to the truth.
    pub ssim: f64,
    /// Mean squared error against the truth, squares of 0 to 255.
    pub mse: f64,
    /// Share of the truth's covered pixels that are not covered.
    pub holes: f64,
}

/// When a quality is reached, and stays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Milliseconds since the view was set.
    pub ms: f64,
    /// Bytes received by then.
    pub bytes: u64,
}

/// When the similarity first is at least `level` for the rest of the run; `None` where it never is. What shows
/// nothing is right nowhere, however much background there is.
#[must_use]
pub fn reached(samples: &[Sample], level: f64) -> Option<Reached> {
    let last_below = samples.iter().rposition(|s| s.ssim < level || s.points == 0);
    let first = samples.get(last_below.map_or(0, |last| last + 1))?;
    Some(Reached { ms: first.ms, bytes: first.bytes })
}

/// Seconds times missing similarity, from 0 to `horizon_ms`: the area between the curve and 1. Before
/// the first sample nothing is seen; after the last it stays.
#[must_use]
pub fn area(samples: &[Sample], horizon_ms: f64) -> f64 {
    let Some(first) = samples.first() else { return horizon_ms / 1e3 };
    let mut area = first.ms.min(horizon_ms);
    for (index, sample) in samples.iter().enumerate() {
        let end = samples.get(index + 1).map_or(horizon_ms, |next| next.ms).min(horizon_ms);
        area += (1.0 - sample.ssim) * (end - sample.ms).max(0.0);
    }
    area / 1e3
}

/// How many bytes more (above 0) or fewer (below 0) `ours` takes than `baseline` for the same
/// similarity, as a part of the baseline's: the mean over all similarities that both reach.
/// (Bjøntegaard 2001, VCEG-M33, with straight lines between samples instead of cubics, which
/// overshoot.) `None` where there is no such similarity.
#[must_use]
pub fn bytes_at_equal_error(ours: &[Sample], baseline: &[Sample]) -> Option<f64> {
    const STEPS: u32 = 256;
    let (ours, baseline) = (rising(ours), rising(baseline));
    let low = ours.first()?.0.max(baseline.first()?.0);
    let high = ours.last()?.0.min(baseline.last()?.0);
    if high <= low {
        return None;
    }
    let mean = (0..STEPS).map(|step| {
        let at = low + (high - low) * (f64::from(step) + 0.5) / f64::from(STEPS);
        at_similarity(&ours, at) - at_similarity(&baseline, at)
    });
    Some((mean.sum::<f64>() / f64::from(STEPS)).exp() - 1.0)
}

/// Similarity and the logarithm of the bytes it took, where it is higher than all before.
fn rising(samples: &[Sample]) -> Vec<(f64, f64)> {
    let mut best = f64::NEG_INFINITY;
    let higher = samples.iter().filter(|sample| {
        sample.bytes > 0 && {
            let higher = sample.ssim > best;
            best = best.max(sample.ssim);
            higher
        }
    });
    higher.map(|sample| (sample.ssim, (sample.bytes as f64).ln())).collect()
}

fn at_similarity(curve: &[(f64, f64)], similarity: f64) -> f64 {
    let next = curve.partition_point(|point| point.0 < similarity).clamp(1, curve.len() - 1);
    let (a, b) = (curve[next - 1], curve[next]);
    a.1 + (b.1 - a.1) * ((similarity - a.0) / (b.0 - a.0)).clamp(0.0, 1.0)
}

/// Which of `(cost, quality)` no other beats in both.
#[must_use]
pub fn pareto(points: &[(f64, f64)]) -> Vec<bool> {
    let beaten = |a: &(f64, f64)| {
        points.iter().any(|b| b.0 <= a.0 && b.1 >= a.1 && (b.0 < a.0 || b.1 > a.1))
    };
    points.iter().map(|point| !beaten(point)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(points: &[(f64, u64, f64)]) -> Vec<Sample> {
        let sample = |&(ms, bytes, ssim)| Sample {
            ms,
            bytes,
            ssim,
            requests: 0,
            points: 1,
            mse: 0.0,
            holes: 0.0,
        };
        points.iter().map(sample).collect()
    }

    #[test]
    fn a_level_is_reached_when_it_is_not_lost_again() {
        let run = samples(&[(0.0, 1, 0.1), (50.0, 2, 0.95), (100.0, 3, 0.9), (150.0, 4, 0.96)]);
        assert_eq!(reached(&run, 0.95), Some(Reached { ms: 150.0, bytes: 4 }));
        assert_eq!(reached(&run, 0.05).map(|r| r.ms), Some(0.0));
        assert_eq!(reached(&run, 0.97), None);
        assert_eq!(reached(&[], 0.5), None);
        let mut nothing = run;
        nothing[0].points = 0;
        assert_eq!(reached(&nothing, 0.05).map(|r| r.ms), Some(50.0), "nothing is not right");
    }

    #[test]
    fn the_area_is_what_is_missing_over_time() {
        let run = samples(&[(500.0, 1, 0.5), (1500.0, 2, 0.9)]);
        // Half a second of nothing, a second of half, half a second of a tenth missing.
        assert!((area(&run, 2000.0) - (0.5 + 0.5 + 0.05)).abs() < 1e-12);
        assert!((area(&run, 250.0) - 0.25).abs() < 1e-12);
        assert!((area(&[], 1000.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn half_the_bytes_for_everything_is_minus_one_half() {
        let baseline = samples(&[(0.0, 1000, 0.2), (1.0, 4000, 0.6), (2.0, 16_000, 0.9)]);
        let ours = samples(&[(0.0, 500, 0.2), (1.0, 2000, 0.6), (2.0, 8000, 0.9)]);
        let saved = bytes_at_equal_error(&ours, &baseline).expect("they overlap");
        assert!((saved + 0.5).abs() < 1e-12, "{saved}");
        assert!(bytes_at_equal_error(&baseline, &baseline).is_some_and(|s| s.abs() < 1e-12));
        let never = samples(&[(0.0, 10, 0.95)]);
        assert_eq!(bytes_at_equal_error(&never, &baseline), None);
    }

    #[test]
    fn what_is_beaten_is_not_on_the_front() {
        let points = [(1.0, 0.5), (2.0, 0.4), (2.0, 0.9), (3.0, 0.9), (0.5, 0.1)];
        assert_eq!(pareto(&points), [true, false, true, false, true]);
    }
}
