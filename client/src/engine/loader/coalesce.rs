//! From wanted ranges to few requests.

use std::ops::Range;

use super::super::config::Coalesce;
use crate::source::BatchLimits;

/// A range that is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted {
    /// Position in the caller's list, most important first.
    pub rank: usize,
    /// File offset in bytes.
    pub offset: u64,
    /// Length in bytes.
    pub len: u64,
    /// Whether it must not share a request with others.
    pub alone: bool,
}

impl Wanted {
    const fn end(&self) -> u64 {
        self.offset.saturating_add(self.len)
    }
}

/// One request: the ranges that it brings, by offset and without overlap; those of a batch by rank.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// Never empty.
    pub parts: Vec<Wanted>,
    /// Whether it names its parts, instead of all from the first to the last.
    pub is_batch: bool,
}

impl Run {
    /// From the first byte of the first part to the last of the last.
    pub fn bytes(&self) -> Range<u64> {
        let start = self.parts.first().map_or(0, |part| part.offset);
        start..self.parts.last().map_or(start, Wanted::end)
    }

    /// Rank of the most important part.
    pub fn rank(&self) -> usize {
        self.parts.iter().map(|part| part.rank).min().unwrap_or(usize::MAX)
    }
}

/// Joins neighbours within the limits. Every range is in exactly one run; runs come most important
/// first.
pub fn coalesce(mut wanted: Vec<Wanted>, limits: Coalesce) -> Vec<Run> {
    wanted.sort_by_key(|w| (w.offset, w.len));
    let mut runs: Vec<Run> = Vec::new();
    for part in wanted {
        let fits = runs.last().is_some_and(|run| {
            let bytes = run.bytes();
            // Parts that overlap cannot both be cut from one stream.
            let apart = part.offset.checked_sub(bytes.end);
            apart.is_some_and(|gap| gap <= limits.gap_bytes)
                && part.end() - bytes.start <= limits.span_bytes
                && !part.alone
                && !run.parts[0].alone
        });
        match runs.last_mut() {
            Some(run) if fits => run.parts.push(part),
            _ => runs.push(Run { parts: vec![part], is_batch: false }),
        }
    }
    runs.sort_by_key(Run::rank);
    runs
}

/// Puts what matters most into one request, then what matters next into another, each of a span's bytes
/// at most; a single range may be longer.
/// Every range is in exactly one run; runs come most important first.
pub fn batch(wanted: Vec<Wanted>, limits: BatchLimits, span_bytes: u64) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut bytes = 0;
    for part in wanted {
        bytes += part.len;
        match runs.last_mut() {
            Some(run)
                if bytes <= span_bytes.min(limits.bytes)
                    && run.parts.len() < limits.parts
                    && !part.alone
                    && !run.parts[0].alone =>
            {
                run.parts.push(part);
                run.is_batch = true;
            }
            _ => {
                bytes = part.len;
                // A part alone is a range like any other.
                runs.push(Run { parts: vec![part], is_batch: false });
            }
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: Coalesce = Coalesce { gap_bytes: 10, span_bytes: 100 };

    fn wanted(ranges: &[(u64, u64)]) -> Vec<Wanted> {
        let parts = ranges.iter().enumerate();
        parts.map(|(rank, &(offset, len))| Wanted { rank, offset, len, alone: false }).collect()
    }

    fn spans(runs: &[Run]) -> Vec<Range<u64>> {
        runs.iter().map(Run::bytes).collect()
    }

    #[test]
    fn neighbours_share_a_request_and_the_most_important_goes_first() {
        let runs = coalesce(wanted(&[(500, 20), (530, 5), (0, 10), (20, 10), (41, 5)]), LIMITS);
        assert_eq!(spans(&runs), [500..535, 0..30, 41..46]);
    }

    #[test]
    fn a_part_longer_than_a_span_is_a_request_of_its_own() {
        let runs = coalesce(wanted(&[(0, 10), (10, 200), (210, 10)]), LIMITS);
        assert_eq!(spans(&runs), [0..10, 10..210, 210..220]);
    }

    #[test]
    fn a_part_that_is_to_be_alone_is() {
        let mut parts = wanted(&[(0, 10), (10, 10), (20, 10)]);
        parts[1].alone = true;
        assert_eq!(spans(&coalesce(parts, LIMITS)), [0..10, 10..20, 20..30]);
    }

    #[test]
    fn a_batch_takes_parts_by_rank_within_the_limits() {
        let limits = BatchLimits { parts: 3, bytes: 1000 };
        let ranks = |runs: &[Run]| -> Vec<(Vec<usize>, bool)> {
            let ranks = |run: &Run| run.parts.iter().map(|part| part.rank).collect();
            runs.iter().map(|run| (ranks(run), run.is_batch)).collect()
        };
        let parts = wanted(&[(900, 10), (0, 10), (500, 10), (5, 10), (300, 95), (200, 200)]);
        let found = [(vec![0, 1, 2], true), (vec![3], false), (vec![4], false), (vec![5], false)];
        assert_eq!(ranks(&batch(parts, limits, 100)), found);
        let mut parts = wanted(&[(900, 10), (0, 10), (500, 10)]);
        parts[1].alone = true;
        let apart = [(vec![0], false), (vec![1], false), (vec![2], false)];
        assert_eq!(ranks(&batch(parts, limits, 100)), apart);
    }

    proptest! {
        #[test]
        fn runs_hold_exactly_the_wanted_ranges_within_the_limits(
            ranges in prop::collection::vec((0u64..2000, 1u64..150, any::<bool>()), 0..80),
        ) {
            let parts: Vec<_> = ranges
                .iter()
                .enumerate()
                .map(|(rank, &(offset, len, alone))| Wanted { rank, offset, len, alone })
                .collect();
            let runs = coalesce(parts.clone(), LIMITS);
            let mut found: Vec<_> = runs.iter().flat_map(|run| run.parts.clone()).collect();
            found.sort_by_key(|part| part.rank);
            prop_assert_eq!(found, parts);
            for run in &runs {
                let bytes = run.bytes();
                prop_assert!(bytes.end - bytes.start <= LIMITS.span_bytes || run.parts.len() == 1);
                prop_assert!(run.parts.len() == 1 || run.parts.iter().all(|part| !part.alone));
                for pair in run.parts.windows(2) {
                    prop_assert!(pair[0].end() <= pair[1].offset);
                    prop_assert!(pair[1].offset - pair[0].end() <= LIMITS.gap_bytes);
                }
            }
            prop_assert!(runs.windows(2).all(|pair| pair[0].rank() < pair[1].rank()));
        }
    }
}
