//! How far what is seen lies from where it should.

use serde::{Deserialize, Serialize};

use super::Spread;
use crate::render::Picture;

/// Differences of distances along the view direction, world units (metres, where the cloud's are),
/// over the pixels that both pictures cover.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthError {
    /// Root of the mean square.
    pub rmse: f64,
    /// The differences without their sign.
    pub absolute: Spread,
}

impl DepthError {
    /// Of pictures of one size; `None` where they cover no pixel in common.
    pub(super) fn between(picture: &Picture, truth: &Picture) -> Option<Self> {
        let pairs = picture.depth.iter().zip(&truth.depth);
        let both = pairs.filter(|(here, there)| here.is_finite() && there.is_finite());
        let mut errors: Vec<_> =
            both.map(|(here, there)| (f64::from(*here) - f64::from(*there)).abs()).collect();
        // Squares of differences of f32 are far inside of f64.
        let squares: f64 = errors.iter().map(|e| e * e).sum();
        let rmse = (squares / errors.len() as f64).sqrt();
        Some(Self { absolute: Spread::of(&mut errors)?, rmse })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::depths;

    #[test]
    fn depth_is_compared_where_both_pictures_have_one() {
        let truth = depths(5, &[10.0, 20.0, f32::INFINITY, 5.0, f32::NAN]);
        let picture = depths(5, &[13.0, 16.0, 1.0, f32::INFINITY, 1.0]);
        let error = DepthError::between(&picture, &truth).expect("two pixels");
        assert_eq!(error.rmse, 12.5_f64.sqrt());
        assert_eq!(error.absolute, Spread { count: 2, mean: 3.5, p99: 4.0, max: 4.0 });
        assert_eq!(DepthError::between(&truth, &truth).expect("covered").rmse, 0.0);
    }

    #[test]
    fn what_is_covered_nowhere_has_no_depth_error() {
        let (left, right) = (depths(2, &[1.0, f32::INFINITY]), depths(2, &[f32::INFINITY, 1.0]));
        assert_eq!(DepthError::between(&left, &right), None);
        assert_eq!(DepthError::between(&depths(0, &[]), &depths(0, &[])), None);
    }

    #[test]
    fn the_largest_depths_have_finite_errors() {
        let (near, far) = (depths(1, &[f32::MIN_POSITIVE]), depths(1, &[f32::MAX]));
        let error = DepthError::between(&near, &far).expect("covered");
        assert!(error.rmse.is_finite() && error.rmse == error.absolute.max);
    }
}
