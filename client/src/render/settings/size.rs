//! Sizes of splats.

use std::{fmt, str::FromStr};

/// Splats are drawn at least this large, so that none is lost between pixels.
pub const SMALLEST_SPLAT_PX: f64 = 1.0;

/// Splats are drawn at most this large: one that touches the eye must not cost the whole frame.
pub const LARGEST_SPLAT_PX: f64 = 1024.0;

/// Side of a square, diameter of everything else. Drawn within [`SizeLimits`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SplatSize {
    /// Pixels, the same at every distance. Written `2px`.
    Pixels(f32),
    /// World units: the splat shrinks with the distance of its centre along the view direction.
    /// Written `0.05w`.
    World(f64),
    /// So many times the spacing of the node that holds the point: large in coarse nodes, small in
    /// fine ones. Written `level` or `level:1.5`. (Radner 2018, 5.2.1)
    Level(f64),
    /// So many times the spacing of the finest node drawn where the point is: large where little
    /// detail is there, small where there is much. Written `adaptive` or `adaptive:1.5`.
    /// (Radner 2018, 5.2.3)
    Adaptive(f64),
    /// What the points say: twice their `radius`, or the longer of their two axes; `adaptive` for
    /// clouds without. Written `own`.
    Own,
}

/// So many times the spacing makes neighbouring splats of a Poisson-disk sample close the surface:
/// no place of a complete sample is farther than one spacing from a point, few are farther than
/// 0.8.
pub(crate) const CLOSED_SURFACE: f64 = 1.6;

/// Smallest and largest size of a splat in pixels, whatever [`SplatSize`] says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SizeLimits {
    /// At least [`SMALLEST_SPLAT_PX`].
    pub min_px: f64,
    /// At most [`LARGEST_SPLAT_PX`].
    pub max_px: f64,
}

impl Default for SizeLimits {
    fn default() -> Self {
        Self { min_px: SMALLEST_SPLAT_PX, max_px: LARGEST_SPLAT_PX }
    }
}

impl SizeLimits {
    /// Whether they are in their range and in order.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn check(&self) -> Result<(), String> {
        let range = SMALLEST_SPLAT_PX..=LARGEST_SPLAT_PX;
        if range.contains(&self.min_px)
            && range.contains(&self.max_px)
            && self.min_px <= self.max_px
        {
            return Ok(());
        }
        Err(format!(
            "splat size limits of {} to {} pixels: both must be {SMALLEST_SPLAT_PX} to \
             {LARGEST_SPLAT_PX}, the smaller first",
            self.min_px, self.max_px
        ))
    }
}

impl SplatSize {
    /// Whether the number is a size.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn check(&self) -> Result<(), String> {
        let size = match *self {
            Self::Pixels(pixels) => f64::from(pixels),
            Self::World(size) | Self::Level(size) | Self::Adaptive(size) => size,
            Self::Own => return Ok(()),
        };
        if size > 0.0 && size.is_finite() {
            Ok(())
        } else {
            Err(format!("splat size {size}: must be above 0"))
        }
    }
}

impl fmt::Display for SplatSize {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Pixels(pixels) => write!(f, "{pixels}px"),
            Self::World(world) => write!(f, "{world}w"),
            Self::Level(times) => write!(f, "level:{times}"),
            Self::Adaptive(times) => write!(f, "adaptive:{times}"),
            Self::Own => f.write_str("own"),
        }
    }
}

impl FromStr for SplatSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |digits: &str| {
            digits.parse::<f64>().ok().filter(|size| *size > 0.0 && size.is_finite())
        };
        let size = match text {
            "own" => Some(Self::Own),
            "level" => Some(Self::Level(CLOSED_SURFACE)),
            "adaptive" => Some(Self::Adaptive(CLOSED_SURFACE)),
            _ => {
                if let Some(digits) = text.strip_suffix("px") {
                    number(digits).map(|pixels| Self::Pixels(pixels as f32))
                } else if let Some(digits) = text.strip_prefix("level:") {
                    number(digits).map(Self::Level)
                } else if let Some(digits) = text.strip_prefix("adaptive:") {
                    number(digits).map(Self::Adaptive)
                } else {
                    text.strip_suffix('w').and_then(number).map(Self::World)
                }
            }
        };
        // A size that is too small for its type is no size.
        size.filter(|size| size.check().is_ok()).ok_or_else(|| {
            "expected a size like 2px (pixels), 0.05w (world units), level, level:1.5, adaptive, \
             adaptive:1.5 (times the spacing) or own"
                .into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_with_their_unit() {
        assert_eq!("2px".parse(), Ok(SplatSize::Pixels(2.0)));
        assert_eq!("0.05w".parse(), Ok(SplatSize::World(0.05)));
        assert_eq!("level".parse(), Ok(SplatSize::Level(CLOSED_SURFACE)));
        assert_eq!("adaptive:2".parse(), Ok(SplatSize::Adaptive(2.0)));
        for bad in
            ["2", "px", "-1px", "0w", "infw", "nanpx", "1 m", "level:0", "adaptive:", "1e-60px"]
        {
            assert!(bad.parse::<SplatSize>().is_err(), "{bad}");
        }
    }

    #[test]
    fn sizes_are_written_as_they_are_read() {
        for text in ["2.5px", "0.05w", "level:1.6", "adaptive:2", "own"] {
            assert_eq!(text.parse::<SplatSize>().expect(text).to_string(), text);
        }
    }

    #[test]
    fn limits_are_in_order() {
        assert!(SizeLimits::default().check().is_ok());
        for (min_px, max_px) in [(0.5, 3.0), (3.0, 2.0), (1.0, 2000.0), (f64::NAN, 2.0)] {
            assert!(SizeLimits { min_px, max_px }.check().is_err());
        }
    }
}
