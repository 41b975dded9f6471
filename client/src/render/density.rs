//! Points per pixel: what a picture coloured by [`ColorMode::Density`] counts, and how it is told.
//!
//! [`ColorMode::Density`]: crate::render::ColorMode::Density

use serde::Serialize;

use crate::render::ramp::Ramp;

/// How many points fall on the pixels of a picture. (D. Schütz 2021, 4.1)
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointsPerPixel {
    /// Counts in a bin: 1 as long as [`MOST_BINS`](Self::MOST_BINS) bins hold all counts.
    pub bin_width: u32,
    /// Pixels per bin: bin `i` holds those of `i * bin_width + 1` to `(i + 1) * bin_width` points.
    pub bins: Vec<u64>,
    /// Most points of a pixel.
    pub largest: u32,
    /// The commonest count above 0, the smallest of several; 0 where there are no points.
    pub most_frequent: u32,
    /// Mean over the pixels with points; 0 where there are none.
    pub mean: f64,
    /// Pixels with points.
    pub covered_pixels: u64,
}

impl PointsPerPixel {
    /// Most bins.
    pub const MOST_BINS: u32 = 255;

    /// The histogram of the pixels' counts, in any order.
    #[must_use]
    pub fn of(counts: &[u32]) -> Self {
        let mut covered: Vec<u32> = counts.iter().copied().filter(|count| *count > 0).collect();
        covered.sort_unstable();
        let largest = covered.last().copied().unwrap_or(0);
        let bin_width = largest.div_ceil(Self::MOST_BINS).max(1);
        let mut bins = vec![0; largest.div_ceil(bin_width) as usize];
        let (mut most_frequent, mut frequency, mut points) = (0, 0, 0u128);
        for run in covered.chunk_by(|a, b| a == b) {
            let count = run[0];
            bins[((count - 1) / bin_width) as usize] += run.len() as u64;
            points += u128::from(count) * run.len() as u128;
            if run.len() > frequency {
                (most_frequent, frequency) = (count, run.len());
            }
        }
        let mean = points as f64 / covered.len().max(1) as f64;
        let covered_pixels = covered.len() as u64;
        Self { bin_width, bins, largest, most_frequent, mean, covered_pixels }
    }
}

/// The colour of a pixel of `count` points (above 0) in a picture whose fullest has `largest`: step
/// `255 * count / largest` of the ramp, rounded to the nearest, halves up. In integers, so that
/// every renderer has the same.
pub(crate) fn color(count: u32, largest: u32) -> [u8; 3] {
    let (count, largest) = (u64::from(count), u64::from(largest.max(1)));
    let step = (510 * count + largest) / (2 * largest);
    Ramp::Density.color(u8::try_from(step).unwrap_or(u8::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_counts_have_a_bin_each() {
        let found = PointsPerPixel::of(&[3, 0, 1, 1, 0, 5, 3, 3]);
        assert_eq!(found.bins, [2, 0, 3, 0, 1]);
        assert_eq!((found.bin_width, found.largest, found.most_frequent), (1, 5, 3));
        assert_eq!((found.mean, found.covered_pixels), (16.0 / 6.0, 6));
    }

    #[test]
    fn bins_grow_wider_where_there_are_too_many_counts() {
        let all: Vec<u32> = (0..=255).collect();
        assert_eq!(PointsPerPixel::of(&all).bins, [1; 255]);
        let all: Vec<u32> = (0..=256).collect();
        let found = PointsPerPixel::of(&all);
        assert_eq!((found.bin_width, found.bins.len()), (2, 128));
        assert_eq!(found.bins, [2; 128]);
        let found = PointsPerPixel::of(&[1, u32::MAX, u32::MAX]);
        assert_eq!((found.bins[0], found.bins.last()), (1, Some(&2)));
        assert!(found.bins.len() <= 255);
        assert_eq!(found.most_frequent, u32::MAX);
    }

    #[test]
    fn a_picture_without_points_has_no_bins() {
        for counts in [&[][..], &[0, 0]] {
            let found = PointsPerPixel::of(counts);
            assert_eq!((found.bins.len(), found.largest, found.most_frequent), (0, 0, 0));
            assert_eq!((found.mean, found.covered_pixels), (0.0, 0));
        }
    }

    #[test]
    fn the_fullest_pixel_is_at_the_end_of_the_ramp() {
        assert_eq!(color(7, 7), Ramp::Density.color(255));
        assert_eq!(color(1, 2), Ramp::Density.color(128));
        assert_eq!(color(1, u32::MAX), Ramp::Density.color(0));
        assert_eq!(color(u32::MAX, u32::MAX), Ramp::Density.color(255));
    }
}
