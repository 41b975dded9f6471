//! Where a picture shows nothing but should, and the other way round.

use serde::{Deserialize, Serialize};

use crate::render::Picture;

/// A number of pixels, as shares. Both are 0 to 1, but for spill, which can be many times what the
/// truth covers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Share {
    /// Of the pixels that the truth covers; `None` where it covers none.
    pub of_covered: Option<f64>,
    /// Of all pixels; `None` where there are none.
    pub of_all: Option<f64>,
}

impl Share {
    fn of(count: usize, covered: usize, all: usize) -> Self {
        let share = |of: usize| (of > 0).then(|| count as f64 / of as f64);
        Self { of_covered: share(covered), of_all: share(all) }
    }
}

/// Which pixels are covered: those whose depth is finite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CoverageError {
    /// Pixels that the truth covers, the picture not.
    pub holes: Share,
    /// Pixels that the picture covers, the truth not.
    pub spill: Share,
}

impl CoverageError {
    /// Of pictures of one size.
    pub(super) fn between(picture: &Picture, truth: &Picture) -> Self {
        let (mut holes, mut spill, mut covered) = (0, 0, 0);
        for (here, there) in picture.depth.iter().zip(&truth.depth) {
            let (here, there) = (here.is_finite(), there.is_finite());
            holes += usize::from(there && !here);
            spill += usize::from(here && !there);
            covered += usize::from(there);
        }
        let share = |count| Share::of(count, covered, truth.depth.len());
        Self { holes: share(holes), spill: share(spill) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::depths;

    const FAR: f32 = f32::INFINITY;

    #[test]
    fn holes_and_spill_are_counted_apart() {
        let truth = depths(4, &[1.0, 1.0, 1.0, 1.0, FAR, FAR, FAR, FAR]);
        let picture = depths(4, &[2.0, FAR, 1.0, 1.0, 5.0, FAR, 5.0, f32::NAN]);
        let CoverageError { holes, spill } = CoverageError::between(&picture, &truth);
        assert_eq!(holes, Share { of_covered: Some(0.25), of_all: Some(0.125) });
        assert_eq!(spill, Share { of_covered: Some(0.5), of_all: Some(0.25) });
    }

    #[test]
    fn of_nothing_there_is_no_share() {
        let (bare, full) = (depths(1, &[FAR]), depths(1, &[1.0]));
        let spill = CoverageError::between(&full, &bare).spill;
        assert_eq!(spill, Share { of_covered: None, of_all: Some(1.0) });
        let holes = CoverageError::between(&bare, &full).holes;
        assert_eq!(holes, Share { of_covered: Some(1.0), of_all: Some(1.0) });
        let empty = depths(0, &[]);
        let none = Share { of_covered: None, of_all: None };
        assert_eq!(
            CoverageError::between(&empty, &empty),
            CoverageError { holes: none, spill: none }
        );
    }
}
