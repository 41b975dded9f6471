//! What a picture is to look like.

use std::str::FromStr;

use serde::Serialize;

use crate::{camera::Camera, render::RenderError};

/// Most pixels along one side of a picture, for every renderer.
pub const LARGEST_SIDE_PX: u32 = 16_384;

/// Splats are drawn at least this large, so that none is lost between pixels.
pub const SMALLEST_SPLAT_PX: f64 = 1.0;

/// Splats are drawn at most this large: one that touches the eye must not cost the whole frame.
pub const LARGEST_SPLAT_PX: f64 = 1024.0;

/// What a point covers on the picture. Its depth is that of its centre everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Splat {
    /// The pixel that holds its centre, whatever the splat size.
    Point,
    /// A square that faces the picture: every pixel whose middle lies in it (lower and left edges
    /// excluded, upper and right ones included, in pixel coordinates that grow right and down).
    Square,
    /// A circle that faces the picture: every pixel whose middle lies in it, and the one that holds
    /// its centre.
    Circle,
}

/// Side of a square, diameter of a circle; drawn within [`SMALLEST_SPLAT_PX`] and
/// [`LARGEST_SPLAT_PX`]. Written `2px` or `0.05w`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SplatSize {
    /// Pixels, the same at every distance.
    Pixels(f32),
    /// World units: the splat shrinks with the distance of its centre along the view direction.
    World(f64),
}

/// Where colours come from. A cloud that lacks the attribute is coloured as
/// [`Coloring`](crate::render::Coloring) tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ColorMode {
    /// The points' own colours.
    Rgb,
    /// Height, over the range of all clouds.
    Elevation,
    /// Strength of the return, over the range of the cloud.
    Intensity,
    /// Level in the octree.
    Level,
}

impl ColorMode {
    /// As it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Elevation => "elevation",
            Self::Intensity => "intensity",
            Self::Level => "level",
        }
    }

    /// The attribute that it needs, if any.
    #[must_use]
    pub const fn attribute(self) -> Option<&'static str> {
        match self {
            Self::Rgb => Some("color"),
            Self::Intensity => Some("intensity"),
            Self::Elevation | Self::Level => None,
        }
    }
}

/// What a picture is to look like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Width and height, 1 to [`LARGEST_SIDE_PX`] each.
    pub size_px: [u32; 2],
    /// The view.
    pub camera: Camera,
    /// What a point covers.
    pub splat: Splat,
    /// How large it is.
    pub splat_size: SplatSize,
    /// Where its colour comes from.
    pub color: ColorMode,
    /// Red, green, blue where nothing is drawn.
    pub background: [u8; 3],
}

impl RenderSettings {
    /// Whether the numbers can be those of a picture.
    ///
    /// # Errors
    /// [`RenderError::Settings`] says which cannot.
    pub fn check(&self) -> Result<(), RenderError> {
        let [width, height] = self.size_px;
        if !(1..=LARGEST_SIDE_PX).contains(&width) || !(1..=LARGEST_SIDE_PX).contains(&height) {
            return Err(RenderError::Settings(format!(
                "a picture of {width}x{height} pixels: each side must be 1 to {LARGEST_SIDE_PX}"
            )));
        }
        self.camera.check().map_err(|e| RenderError::Settings(e.to_string()))?;
        let size = match self.splat_size {
            SplatSize::Pixels(pixels) => f64::from(pixels),
            SplatSize::World(world) => world,
        };
        if !(size > 0.0 && size.is_finite()) {
            return Err(RenderError::Settings(format!("splat size {size}: must be above 0")));
        }
        Ok(())
    }

    /// Width over height.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.size_px[0]) / f64::from(self.size_px[1])
    }
}

impl FromStr for Splat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "point" => Ok(Self::Point),
            "square" => Ok(Self::Square),
            "circle" => Ok(Self::Circle),
            _ => Err("expected point, square or circle".into()),
        }
    }
}

impl FromStr for SplatSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |digits: &str| {
            digits.parse::<f64>().ok().filter(|size| *size > 0.0 && size.is_finite())
        };
        let size = if let Some(digits) = text.strip_suffix("px") {
            number(digits).map(|pixels| Self::Pixels(pixels as f32))
        } else {
            text.strip_suffix('w').and_then(number).map(Self::World)
        };
        size.ok_or_else(|| "expected a size like 2px (pixels) or 0.05w (world units)".into())
    }
}

impl FromStr for ColorMode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "rgb" => Ok(Self::Rgb),
            "elevation" => Ok(Self::Elevation),
            "intensity" => Ok(Self::Intensity),
            "level" => Ok(Self::Level),
            _ => Err("expected rgb, elevation, intensity or level".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splat_sizes_are_read_with_their_unit() {
        assert_eq!("2px".parse(), Ok(SplatSize::Pixels(2.0)));
        assert_eq!("0.05w".parse(), Ok(SplatSize::World(0.05)));
        for bad in ["2", "px", "-1px", "0w", "infw", "nanpx", "1 m"] {
            assert!(bad.parse::<SplatSize>().is_err(), "{bad}");
        }
    }
}
