//! Who is near a point: a hierarchy of boxes over points in Morton order.
//!
//! Runs of 16 consecutive points make the leaves, pairs of neighbours the boxes above: in Morton
//! order what is consecutive is near. The tree is as deep as the number of points says, whatever
//! these are, so a million duplicates, one far outlier, or spacings 10^8 apart within one cloud cost
//! nothing; grids and trees that split space have cases for each of these. Distances are integers:
//! exact, and the same on every machine. (The `kiddo` crate would have to be given floats: a copy of
//! the points, and rounded distances.)
//!
//! Sums over points are exact and merge, so boxes that lie wholly within a radius are taken whole.

use std::collections::BinaryHeap;

use lodestream_protocol::LatticeBox;

use super::Moments;

/// Points in a leaf.
const LEAF_POINTS: usize = 16;

/// Square of the distance of two points, lattice units squared.
#[must_use]
pub fn distance_squared(a: [u32; 3], b: [u32; 3]) -> u128 {
    (0..3)
        .map(|axis| {
            let d = u64::from(a[axis].abs_diff(b[axis]));
            u128::from(d * d)
        })
        .sum()
}

/// An index over points.
#[derive(Debug, Clone)]
pub struct Neighbours<'a> {
    points: &'a [[u32; 3]],
    /// A complete binary tree: the root is 1, the halves of `i` are `2 i` and `2 i + 1`. Boxes that
    /// hold nothing fill it up.
    boxes: Vec<LatticeBox>,
    /// Sums over the points of every box, about lattice coordinate zero; empty unless asked for.
    sums: Vec<Moments>,
}

impl<'a> Neighbours<'a> {
    /// An index over points in Morton order. (In another order it works, but slowly.) Takes two
    /// bytes a point.
    ///
    /// # Panics
    /// Beyond 2^32 points: no node has as many.
    #[must_use]
    pub fn new(points: &'a [[u32; 3]]) -> Self {
        assert!(u32::try_from(points.len()).is_ok(), "a node has fewer than 2^32 points");
        let leaves = points.len().div_ceil(LEAF_POINTS).next_power_of_two();
        let mut boxes = vec![LatticeBox::EMPTY; 2 * leaves];
        for (leaf, run) in boxes[leaves..].iter_mut().zip(points.chunks(LEAF_POINTS)) {
            run.iter().for_each(|&q| leaf.grow(q));
        }
        for i in (1..leaves).rev() {
            let mut whole = boxes[2 * i];
            whole.merge(&boxes[2 * i + 1]);
            boxes[i] = whole;
        }
        Self { points, boxes, sums: Vec::new() }
    }

    /// The same with the sums that [`moments_within`](Self::moments_within) takes whole boxes by:
    /// twenty bytes a point.
    #[must_use]
    pub fn with_sums(mut self) -> Self {
        let leaves = self.boxes.len() / 2;
        self.sums = vec![Moments::default(); 2 * leaves];
        for (sums, run) in self.sums[leaves..].iter_mut().zip(self.points.chunks(LEAF_POINTS)) {
            *sums = Moments::of(run);
        }
        for i in (1..leaves).rev() {
            let mut whole = self.sums[2 * i];
            whole.merge(&self.sums[2 * i + 1]);
            self.sums[i] = whole;
        }
        self
    }

    /// The points that are indexed.
    #[must_use]
    pub const fn points(&self) -> &'a [[u32; 3]] {
        self.points
    }

    /// The `k` points nearest to `q`, or fewer where there are fewer no farther than `reach`: their
    /// squared distances and their numbers, nearest first, into `found`. A point of the index is its
    /// own nearest. Which of points equally far is the last one depends on the points alone.
    pub fn nearest(&self, q: [u32; 3], k: usize, reach: u32, found: &mut Vec<(u128, u32)>) {
        found.clear();
        if k == 0 || self.points.is_empty() {
            return;
        }
        let reach = u128::from(reach) * u128::from(reach);
        let mut best = BinaryHeap::from(std::mem::take(found));
        // Distance above which nothing is of use, in excess of one so that `reach` itself counts.
        let mut limit = reach + 1;
        let mut stack = vec![(self.distance(1, q), 1)];
        while let Some((distance, at)) = stack.pop() {
            if distance >= limit {
                continue;
            }
            if let Some(run) = self.run(at) {
                for (point, index) in self.points[run.clone()].iter().zip(run) {
                    let distance = distance_squared(*point, q);
                    if distance >= limit {
                        continue;
                    }
                    if best.len() == k {
                        best.pop();
                    }
                    best.push((distance, index as u32));
                    if best.len() == k {
                        limit = best.peek().map_or(limit, |&(farthest, _)| farthest);
                    }
                }
            } else {
                let halves = [2 * at, 2 * at + 1].map(|half| (self.distance(half, q), half));
                // The nearer one is on top.
                let [first, second] = halves;
                stack.extend(if first.0 <= second.0 { [second, first] } else { [first, second] });
            }
        }
        *found = best.into_sorted_vec();
    }

    /// Exact sums over all points no farther than `radius` from `q`, about `q`.
    #[must_use]
    pub fn moments_within(&self, q: [u32; 3], radius: u32) -> Moments {
        let limit = u128::from(radius) * u128::from(radius);
        let mut whole = Moments::default();
        let mut single = Moments::default();
        let mut stack = vec![1];
        while let Some(at) = stack.pop() {
            if self.distance(at, q) > limit {
                continue;
            }
            if !self.sums.is_empty() && farthest(&self.boxes[at], q) <= limit {
                whole.merge(&self.sums[at]);
            } else if let Some(run) = self.run(at) {
                for point in &self.points[run] {
                    if distance_squared(*point, q) <= limit {
                        single.add(difference(*point, q));
                    }
                }
            } else {
                stack.extend([2 * at, 2 * at + 1]);
            }
        }
        single.merge(&whole.moved(q.map(|c| -i64::from(c))));
        single
    }

    /// The points of a leaf; `None` for boxes above.
    fn run(&self, at: usize) -> Option<std::ops::Range<usize>> {
        let leaf = at.checked_sub(self.boxes.len() / 2)?;
        let points = self.points.len();
        Some((leaf * LEAF_POINTS).min(points)..((leaf + 1) * LEAF_POINTS).min(points))
    }

    /// Squared distance from `q` to a box; beyond all measure where that holds nothing.
    fn distance(&self, at: usize, q: [u32; 3]) -> u128 {
        let bounds = &self.boxes[at];
        if bounds.min[0] > bounds.max[0] {
            return u128::MAX;
        }
        let nearest = std::array::from_fn(|a| q[a].clamp(bounds.min[a], bounds.max[a]));
        distance_squared(nearest, q)
    }
}

/// Squared distance from `q` to the farthest corner of a box.
fn farthest(bounds: &LatticeBox, q: [u32; 3]) -> u128 {
    let corner = |a: usize| {
        let (low, high) = (bounds.min[a], bounds.max[a]);
        if q[a].abs_diff(low) > q[a].abs_diff(high) { low } else { high }
    };
    distance_squared([corner(0), corner(1), corner(2)], q)
}

/// From `q` to `point`.
pub(super) fn difference(point: [u32; 3], q: [u32; 3]) -> [i64; 3] {
    std::array::from_fn(|a| i64::from(point[a]) - i64::from(q[a]))
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::MortonCode;
    use proptest::prelude::*;

    use super::*;

    fn clouds() -> impl Strategy<Value = Vec<[u32; 3]>> {
        // Duplicates, clusters of very different sizes, the whole range.
        let point = prop_oneof![
            Just([5, 5, 5]),
            [0u32..4, 0u32..4, 0u32..4],
            [0u32..1000, 0u32..1000, 0u32..1000],
            any::<[u32; 3]>(),
        ];
        prop::collection::vec(point, 1..200).prop_map(|mut points| {
            points.sort_by_key(|&q| u128::encode(q));
            points
        })
    }

    proptest! {
        #[test]
        fn the_nearest_are_those_that_looking_at_all_finds(
            points in clouds(), at in any::<prop::sample::Index>(), k in 0usize..40,
            reach in prop_oneof![0u32..2000, Just(u32::MAX)],
        ) {
            let q = points[at.index(points.len())];
            let mut found = vec![(1, 1)];
            Neighbours::new(&points).nearest(q, k, reach, &mut found);
            let mut all: Vec<u128> = points.iter().map(|&p| distance_squared(p, q)).collect();
            all.sort_unstable();
            all.retain(|&d| d <= u128::from(reach).pow(2));
            all.truncate(k);
            prop_assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), all);
            for (distance, index) in found {
                prop_assert_eq!(distance_squared(points[index as usize], q), distance);
            }
        }

        #[test]
        fn sums_within_a_radius_are_those_of_the_points_there(
            points in clouds(), at in any::<prop::sample::Index>(),
            radius in prop_oneof![0u32..3000, any::<u32>()],
        ) {
            let q = points[at.index(points.len())];
            let mut expected = Moments::default();
            let limit = u128::from(radius).pow(2);
            let near = points.iter().filter(|&&p| distance_squared(p, q) <= limit);
            near.for_each(|&p| expected.add(difference(p, q)));
            let index = Neighbours::new(&points);
            prop_assert_eq!(index.moments_within(q, radius), expected);
            prop_assert_eq!(index.with_sums().moments_within(q, radius), expected);
        }
    }

    #[test]
    fn nobody_is_near_where_nobody_is() {
        let mut found = vec![(0, 0)];
        Neighbours::new(&[]).nearest([0; 3], 3, u32::MAX, &mut found);
        assert!(found.is_empty());
        assert_eq!(Neighbours::new(&[]).with_sums().moments_within([0; 3], 9).count(), 0);
    }

    #[test]
    fn a_hundred_thousand_duplicates_take_no_longer_than_others() {
        let points = vec![[1_000_000; 3]; 100_000];
        let index = Neighbours::new(&points).with_sums();
        let mut found = Vec::new();
        // Were all looked at for each, this would be 10^10 distances.
        for q in &points {
            index.nearest(*q, 8, u32::MAX, &mut found);
            assert_eq!(found.len(), 8);
        }
        assert_eq!(index.moments_within(points[0], 1).count(), 100_000);
    }
}
