//! The depths of a picture, so that one look tells whether a rectangle lies behind what was drawn.
//!
//! A pyramid of the largest depths (Greene, Kass and Miller 1993, "Hierarchical Z-buffer visibility"):
//! every level has half the columns and rows of the one below, and each of its cells the farthest of
//! the four that it covers. Pixels on which nothing was drawn are infinitely far, so a hole, however
//! small, hides nothing.

/// Farthest depths of the parts of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthPyramid {
    /// The picture first, a single cell last.
    levels: Vec<Level>,
}

#[derive(Debug, Clone, PartialEq)]
struct Level {
    width: usize,
    height: usize,
    /// Row by row from the upper left corner.
    farthest: Vec<f32>,
}

impl Level {
    /// Half as many columns and rows, rounded up.
    fn halved(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut farthest = Vec::with_capacity(width * height);
        for row in 0..height {
            let above = self.row(2 * row);
            let below = self.row((2 * row + 1).min(self.height - 1));
            let pairs = above.chunks(2).zip(below.chunks(2));
            let largest = |cells: &[f32]| cells.iter().copied().fold(0.0, f32::max);
            farthest.extend(pairs.map(|(a, b)| largest(a).max(largest(b))));
        }
        Self { width, height, farthest }
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.farthest[row * self.width..][..self.width]
    }
}

impl DepthPyramid {
    /// Of a picture of `size_px` columns and rows: distances along the view direction in world units,
    /// row by row from the upper left corner, infinite where nothing was drawn. `None` where these are
    /// not as many as pixels, or where there is no pixel.
    #[must_use]
    pub fn new(size_px: [u32; 2], depth: &[f32]) -> Option<Self> {
        let [width, height] = size_px.map(|side| side as usize);
        if width == 0 || height == 0 || width.checked_mul(height) != Some(depth.len()) {
            return None;
        }
        // What is no number hides nothing.
        let known = |depth: &f32| if depth.is_nan() { f32::INFINITY } else { *depth };
        let mut levels = vec![Level { width, height, farthest: depth.iter().map(known).collect() }];
        while let Some(last) = levels.last().filter(|last| last.farthest.len() > 1) {
            levels.push(last.halved());
        }
        Some(Self { levels })
    }

    /// Columns and rows of the picture.
    #[must_use]
    pub fn size_px(&self) -> [u32; 2] {
        // As it was made.
        [self.levels[0].width as u32, self.levels[0].height as u32]
    }

    /// Whether every pixel of the columns and rows from `first` up to and with `last` (those beside the
    /// picture left aside) is nearer than `distance`.
    pub(crate) fn is_nearer(&self, first: [i64; 2], last: [i64; 2], distance: f64) -> bool {
        let [width, height] = self.size_px().map(i64::from);
        let first = first.map(|c| c.max(0));
        let last = [last[0].min(width - 1), last[1].min(height - 1)];
        if first[0] > last[0] || first[1] > last[1] {
            return true;
        }
        // Not negative, and inside the picture.
        let [first, last] = [first, last].map(|corner| corner.map(|c| c as usize));
        self.look(self.levels.len() - 1, [0, 0], first, last, distance)
    }

    /// The same for the part of the rectangle that lies in a cell of a level.
    fn look(
        &self,
        level: usize,
        cell: [usize; 2],
        first: [usize; 2],
        last: [usize; 2],
        distance: f64,
    ) -> bool {
        let Level { width, height, farthest } = &self.levels[level];
        if cell[0] >= *width || cell[1] >= *height {
            return true;
        }
        if (0..2).any(|a| cell[a] > last[a] >> level || cell[a] < first[a] >> level) {
            return true;
        }
        if f64::from(farthest[cell[1] * width + cell[0]]) < distance {
            return true;
        }
        // Nearer cells are done with above; one pixel that is not nearer decides.
        level > 0
            && [[0, 0], [1, 0], [0, 1], [1, 1]].iter().all(|[x, y]| {
                self.look(level - 1, [2 * cell[0] + x, 2 * cell[1] + y], first, last, distance)
            })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_rectangle_is_behind_where_every_pixel_of_it_is_nearer(
            size in [1u32..20, 1u32..20], seed in any::<u64>(),
            first in [-5i64..25, -5i64..25], extent in [0i64..25, 0i64..25], distance in 0.0..1.2,
        ) {
            let mut random = fastrand::Rng::with_seed(seed);
            let depth: Vec<f32> = (0..size[0] * size[1])
                .map(|_| if random.u8(..) == 0 { f32::INFINITY } else { random.f32() })
                .collect();
            let pyramid = DepthPyramid::new(size, &depth).expect("as many as pixels");
            let last = [first[0] + extent[0], first[1] + extent[1]];
            let inside = |pixel: usize| {
                let at = [pixel as i64 % i64::from(size[0]), pixel as i64 / i64::from(size[0])];
                (0..2).all(|a| first[a] <= at[a] && at[a] <= last[a])
            };
            let expected = (0..depth.len())
                .all(|pixel| !inside(pixel) || f64::from(depth[pixel]) < distance);
            prop_assert_eq!(pyramid.is_nearer(first, last, distance), expected);
        }
    }

    #[test]
    fn a_hole_hides_nothing() {
        for hole in [f32::INFINITY, f32::NAN] {
            let mut depth = vec![1.0; 35];
            let full = DepthPyramid::new([7, 5], &depth).expect("as many as pixels");
            assert!(full.is_nearer([0, 0], [6, 4], 2.0));
            depth[17] = hole;
            let pyramid = DepthPyramid::new([7, 5], &depth).expect("as many as pixels");
            assert!(!pyramid.is_nearer([0, 0], [6, 4], 2.0));
            assert!(pyramid.is_nearer([0, 0], [2, 4], 2.0));
        }
    }

    #[test]
    fn depths_that_are_not_as_many_as_pixels_are_no_pyramid() {
        assert_eq!(DepthPyramid::new([7, 5], &[1.0; 34]), None);
        assert_eq!(DepthPyramid::new([0, 5], &[]), None);
    }
}
