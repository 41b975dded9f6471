//! The nearest point of a set: a k-d tree on the lattice's integers.
//!
//! Halves are split in the middle of their points, not of their space: a scan is dense at its
//! stations and empty between them, and millions of points may lie on one place. Of the points
//! themselves, without nodes, so that a tree takes 17 bytes a point. (The index of `numerics` is over
//! points in Morton order, and finds several: here they are in none, and a search for one begins with a guess.)

/// Points that are looked through one after the other.
const LEAF_POINTS: usize = 8;

/// Points from which on the halves of a tree are built at the same time.
const TASK_POINTS: usize = 1 << 14;

/// Points in the order of the tree: the middle one divides those before it from those after.
#[derive(Debug)]
pub(super) struct Neighbours {
    points: Vec<Entry>,
    /// Of the middle points: the axis along which they divide.
    axes: Vec<u8>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    place: [u32; 3],
    /// Which point it is.
    index: u32,
}

/// A point of the set.
#[derive(Debug, Clone, Copy)]
pub(super) struct Neighbour {
    /// Which point.
    pub index: u32,
    /// Square of its distance, lattice units. Of exact differences; rounded in f64 beyond 2^26 of
    /// them.
    pub squared: f64,
    /// Where the tree has it.
    entry: usize,
}

impl Neighbours {
    /// Of points numbered from 0; those beyond the numbers of 32 bits are left out.
    pub fn of(places: &[[u32; 3]]) -> Self {
        let numbered = places.iter().zip(0..=u32::MAX);
        let mut points: Vec<_> =
            numbered.map(|(place, index)| Entry { place: *place, index }).collect();
        let mut axes = vec![0; points.len()];
        build(&mut points, &mut axes);
        Self { points, axes }
    }

    /// The point nearest to a place; of several equally near, any. `None` where there is no point.
    /// `near` is a guess, such as the nearest point of a place close by.
    pub fn nearest(&self, place: [u32; 3], near: Option<Neighbour>) -> Option<Neighbour> {
        let guess = near.map_or(0, |near| near.entry);
        let first = self.points.get(guess)?;
        let squared = squared_distance(place, first.place);
        let mut best = Neighbour { index: first.index, squared, entry: guess };
        self.search(0, self.points.len(), place, [0.0; 3], &mut best);
        Some(best)
    }

    /// Looks through the points from `low` to before `high`, which lie at least `beyond` away on
    /// each axis.
    fn search(
        &self,
        low: usize,
        high: usize,
        place: [u32; 3],
        beyond: [f64; 3],
        best: &mut Neighbour,
    ) {
        if high - low <= LEAF_POINTS {
            for entry in low..high {
                self.offer(entry, place, best);
            }
            return;
        }
        let middle = low + (high - low) / 2;
        self.offer(middle, place, best);
        let axis = usize::from(self.axes[middle]);
        let (here, there) = (place[axis], self.points[middle].place[axis]);
        let mut farther = beyond;
        farther[axis] = f64::from(here.abs_diff(there));
        let [near, far] = [(low, middle), (middle + 1, high)];
        let [near, far] = if here <= there { [near, far] } else { [far, near] };
        self.search(near.0, near.1, place, beyond, best);
        if square(farther) < best.squared {
            self.search(far.0, far.1, place, farther, best);
        }
    }

    #[inline]
    fn offer(&self, entry: usize, place: [u32; 3], best: &mut Neighbour) {
        let Entry { place: there, index } = self.points[entry];
        let squared = squared_distance(place, there);
        if squared < best.squared {
            *best = Neighbour { index, squared, entry };
        }
    }
}

fn build(points: &mut [Entry], axes: &mut [u8]) {
    if points.len() <= LEAF_POINTS {
        return;
    }
    let axis = widest(points);
    let middle = points.len() / 2;
    points.select_nth_unstable_by_key(middle, |point| point.place[axis]);
    axes[middle] = axis as u8;
    let (before, after) = points.split_at_mut(middle);
    let (axes_before, axes_after) = axes.split_at_mut(middle);
    let parallel = after.len() > TASK_POINTS;
    let mut first = || build(before, axes_before);
    let mut second = || build(&mut after[1..], &mut axes_after[1..]);
    if parallel {
        rayon::join(first, second);
    } else {
        first();
        second();
    }
}

/// The axis along which the points lie farthest apart.
fn widest(points: &[Entry]) -> usize {
    let (mut low, mut high) = ([u32::MAX; 3], [0; 3]);
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point.place[axis]);
            high[axis] = high[axis].max(point.place[axis]);
        }
    }
    (0..3).max_by_key(|axis| high[*axis].saturating_sub(low[*axis])).unwrap_or(0)
}

#[inline]
fn squared_distance(a: [u32; 3], b: [u32; 3]) -> f64 {
    square(std::array::from_fn(|axis| f64::from(a[axis].abs_diff(b[axis]))))
}

#[inline]
fn square([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn by_search(places: &[[u32; 3]], place: [u32; 3]) -> f64 {
        places.iter().map(|p| squared_distance(place, *p)).fold(f64::INFINITY, f64::min)
    }

    fn check(places: &[[u32; 3]], queries: &[[u32; 3]]) {
        let neighbours = Neighbours::of(places);
        let mut last = None;
        for query in queries {
            let expected = by_search(places, *query);
            for near in [None, last] {
                let found = neighbours.nearest(*query, near).expect("points");
                assert_eq!(found.squared, expected, "{query:?}");
                let place = places[found.index as usize];
                assert_eq!(squared_distance(*query, place), expected, "{query:?}");
                last = Some(found);
            }
        }
    }

    proptest! {
        /// Few values, so that many points share a coordinate or a place.
        #[test]
        fn the_nearest_is_the_one_that_a_search_through_all_finds(
            places in prop::collection::vec([0u32..6, 0u32..6, 0u32..40], 1..300),
            queries in prop::collection::vec([0u32..8, 0u32..8, 0u32..50], 1..40),
        ) {
            check(&places, &queries);
        }

        #[test]
        fn coordinates_may_be_any_of_32_bits(
            places in prop::collection::vec(any::<[u32; 3]>(), 1..100),
            queries in prop::collection::vec(any::<[u32; 3]>(), 1..20),
        ) {
            check(&places, &queries);
        }
    }

    #[test]
    fn a_hundred_thousand_points_on_one_place_are_a_tree() {
        let mut places = vec![[7; 3]; 100_000];
        places.push([9; 3]);
        check(&places, &[[7; 3], [8, 8, 9], [0; 3], [u32::MAX; 3]]);
    }

    #[test]
    fn nothing_is_near_where_there_are_no_points() {
        assert!(Neighbours::of(&[]).nearest([0; 3], None).is_none());
    }
}
