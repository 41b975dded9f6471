//! What jumps: the change from one picture to the next that the truth does not make.

use serde::{Deserialize, Serialize};

use super::{MetricsError, same_size, ssim};
use crate::render::Picture;

/// The change between consecutive pictures beyond the truth's own change between the same cameras.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Popping {
    /// Root mean square, over red, green and blue of all pixels, of the picture's change less the
    /// truth's change; components are 0 to 255. 0 where a picture changes as the truth does, however
    /// wrong it is.
    pub rms: f64,
    /// By how much consecutive pictures are less alike (SSIM) than the truths; 0 where they are as
    /// alike or more. `None` where a picture is narrower or lower than the window of SSIM.
    pub ssim_drop: Option<f64>,
}

impl Popping {
    /// From the first picture to the second, beside the truth at the same two cameras; `None` where
    /// the pictures have no pixels.
    ///
    /// # Errors
    /// [`MetricsError::Sizes`] where the four differ in size.
    pub fn between(
        pictures: [&Picture; 2],
        truths: [&Picture; 2],
    ) -> Result<Option<Self>, MetricsError> {
        let mut pixels = 0;
        for other in [pictures[1], truths[0], truths[1]] {
            pixels = same_size(pictures[0], other)?;
        }
        if pixels == 0 {
            return Ok(None);
        }
        // Of integers: exact.
        let squares: u64 = (0..4 * pixels)
            .filter(|component| component % 4 != 3)
            .map(|component| {
                let change = |[before, after]: [&Picture; 2]| {
                    i64::from(after.rgba8[component]) - i64::from(before.rgba8[component])
                };
                change(pictures).abs_diff(change(truths)).pow(2)
            })
            .sum();
        let rms = (squares as f64 / (3 * pixels) as f64).sqrt();
        let ssim_drop = match (ssim(pictures[0], pictures[1]), ssim(truths[0], truths[1])) {
            (Ok(here), Ok(there)) => Some((there - here).max(0.0)),
            // They are of one size: of one that is too small.
            _ => None,
        };
        Ok(Some(Self { rms, ssim_drop }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::testing::{colors, grey, texture};

    fn between(pictures: [&Picture; 2], truths: [&Picture; 2]) -> Popping {
        Popping::between(pictures, truths).expect("of one size").expect("with pixels")
    }

    #[test]
    fn a_picture_that_changes_as_the_truth_does_not_pop() {
        let truths = [grey(20, 20, texture), grey(20, 20, |x, y| texture(x + 3, y))];
        let [before, after] = [&truths[0], &truths[1]];
        let popping = between([before, after], [before, after]);
        assert_eq!(popping, Popping { rms: 0.0, ssim_drop: Some(0.0) });
        // Wrong by the same all the time.
        let darker = |p: &Picture| {
            let at = |x: u32, y: u32| p.rgba8[4 * (y * 20 + x) as usize] / 2;
            grey(20, 20, at)
        };
        let still = [darker(before), darker(before)];
        assert_eq!(between([&still[0], &still[1]], [before, before]).rms, 0.0);
    }

    #[test]
    fn a_change_that_the_truth_does_not_make_pops() {
        let still = grey(20, 20, texture);
        let popped = colors(20, 20, |x, y| match (x, y) {
            (7, 9) => [texture(7, 9), texture(7, 9) ^ 0xff, texture(7, 9)],
            _ => [texture(x, y); 3],
        });
        let popping = between([&still, &popped], [&still, &still]);
        let step = f64::from(texture(7, 9).abs_diff(texture(7, 9) ^ 0xff));
        assert!((popping.rms - (step * step / 1200.0).sqrt()).abs() < 1e-12, "{popping:?}");
        assert!(popping.ssim_drop.is_some_and(|drop| drop > 0.0), "{popping:?}");
        // A picture that stands still where the truth moves is as far behind it.
        assert_eq!(between([&still, &still], [&still, &popped]).rms, popping.rms);
        assert_eq!(between([&still, &still], [&still, &popped]).ssim_drop, Some(0.0));
    }

    #[test]
    fn tiny_and_empty_pictures_have_the_numbers_that_exist() {
        let (one, empty) = (grey(1, 1, texture), grey(0, 0, texture));
        let popping = between([&one, &one], [&one, &one]);
        assert_eq!(popping, Popping { rms: 0.0, ssim_drop: None });
        assert_eq!(Popping::between([&empty; 2], [&empty; 2]), Ok(None));
        assert!(Popping::between([&one, &one], [&one, &empty]).is_err());
    }
}
