//! Free ranges of a page: first fit, neighbours joined.

use std::collections::BTreeMap;

/// The free part of `0 .. len`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FreeRanges {
    len: u32,
    /// Start to length; no two touch.
    free: BTreeMap<u32, u32>,
}

impl FreeRanges {
    pub fn new(len: u32) -> Self {
        Self { len, free: (len > 0).then_some((0, len)).into_iter().collect() }
    }

    /// The start of `len` (above 0) units that were free, or `None` where no range is that long.
    pub fn take(&mut self, len: u32) -> Option<u32> {
        let (&start, &found) = self.free.iter().find(|(_, found)| **found >= len)?;
        self.free.remove(&start);
        if found > len {
            self.free.insert(start + len, found - len);
        }
        Some(start)
    }

    /// Gives back what [`take`](Self::take) gave.
    pub fn give(&mut self, start: u32, len: u32) {
        let (mut first, mut end) = (start, start + len);
        if let Some((&before, &before_len)) = self.free.range(..start).next_back()
            && before + before_len == first
        {
            self.free.remove(&before);
            first = before;
        }
        if let Some(after_len) = self.free.remove(&end) {
            end += after_len;
        }
        self.free.insert(first, end - first);
    }

    /// Whether all is free.
    pub fn is_unused(&self) -> bool {
        self.free.get(&0) == Some(&self.len)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn ranges_never_overlap_and_all_come_back(steps in prop::collection::vec((1u32..40, any::<bool>(), any::<prop::sample::Index>()), 1..200)) {
            let mut ranges = FreeRanges::new(256);
            let mut taken: Vec<(u32, u32)> = Vec::new();
            for (len, give, which) in steps {
                if give && !taken.is_empty() {
                    let (start, len) = taken.swap_remove(which.index(taken.len()));
                    ranges.give(start, len);
                } else if let Some(start) = ranges.take(len) {
                    prop_assert!(start + len <= 256);
                    let apart = |&(s, l): &(u32, u32)| start + len <= s || s + l <= start;
                    prop_assert!(taken.iter().all(apart));
                    taken.push((start, len));
                }
            }
            for (start, len) in taken {
                ranges.give(start, len);
            }
            prop_assert!(ranges.is_unused());
            prop_assert_eq!(ranges, FreeRanges::new(256));
        }
    }

    #[test]
    fn a_range_longer_than_any_hole_is_refused() {
        let mut ranges = FreeRanges::new(10);
        let first = ranges.take(4).expect("free");
        assert!(ranges.take(7).is_none());
        ranges.take(6).expect("the rest");
        ranges.give(first, 4);
        assert!(ranges.take(5).is_none());
        assert_eq!(ranges.take(4), Some(first));
    }
}
