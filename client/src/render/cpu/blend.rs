//! Blending: the weighted mean of the splats that make up the foremost surface. (Botsch et al. 2005,
//! as Radner 2018, 4.6 asks)
//!
//! Sums are of integers, so that their order is all the same: any number of threads gives the same
//! picture. Equal colours stay equal, as the weights cancel exactly.

use std::sync::atomic::{AtomicU64, Ordering};

/// The weight of a splat's centre. Errors of 2^-21 in weights of at least `exp(-3)` are far below
/// half a step of a colour.
const ONE: f64 = (1u64 << 20) as f64;

/// So many splats on one pixel cannot make a sum overflow: `2^36 * 2^20 * 255 < 2^64`.
pub(super) const MOST_POINTS: u64 = 1 << 36;

/// Weighted sums of red, green and blue, and the sum of the weights.
#[derive(Debug, Default)]
#[repr(align(32))]
pub(super) struct Sums([AtomicU64; 4]);

impl Sums {
    /// Takes a colour at a place within its splat.
    #[inline]
    pub fn add(&self, color: [u8; 3], r_squared: f64) {
        let weight = ((-3.0 * r_squared).exp() * ONE).round() as u64;
        for (sum, component) in self.0.iter().zip(color) {
            sum.fetch_add(weight * u64::from(component), Ordering::Relaxed);
        }
        self.0[3].fetch_add(weight, Ordering::Relaxed);
    }

    /// The mean, to the nearest; black where nothing was taken.
    pub fn mean(&mut self) -> [u8; 3] {
        let [red, green, blue, weight] = self.0.each_mut().map(|sum| *sum.get_mut());
        [red, green, blue].map(|sum| {
            let mean = (sum + weight / 2).checked_div(weight).unwrap_or(0);
            u8::try_from(mean).unwrap_or(u8::MAX)
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_mean_is_weighted_by_the_place_within_the_splat() {
        let mut sums = Sums::default();
        sums.add([255, 0, 90], 0.0);
        sums.add([0, 255, 90], 1.0);
        // 1 / (1 + exp(-3)) = 0.95257
        assert_eq!(sums.mean(), [243, 12, 90]);
        assert_eq!(Sums::default().mean(), [0; 3]);
    }

    #[test]
    fn as_many_points_as_may_be_do_not_overflow() {
        let mut sums = Sums::default();
        sums.add([255; 3], 0.0);
        for sum in &mut sums.0 {
            let all = u128::from(*sum.get_mut()) * u128::from(MOST_POINTS);
            // With what rounding adds.
            *sum.get_mut() = u64::try_from(all).expect("in range");
        }
        assert_eq!(sums.mean(), [255; 3]);
    }

    proptest! {
        #[test]
        fn equal_colours_stay_equal(color: [u8; 3], places in prop::collection::vec(0.0..=1.0, 1..50)) {
            let mut sums = Sums::default();
            for r_squared in places {
                sums.add(color, r_squared);
            }
            prop_assert_eq!(sums.mean(), color);
        }
    }
}
