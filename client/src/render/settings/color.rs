//! Sources of colour.

use std::str::FromStr;

use serde::Serialize;

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
    /// What the point is of, by the classes of the LAS specification.
    Classification,
    /// Level in the octree. (Radner 2018, fig. 4.5)
    Level,
    /// Direction of the normal: x, y, z from -1 to 1 as red, green, blue.
    Normal,
    /// How many points fall on the pixel, from none to the most of the picture; splats, sizes and
    /// shading play no part. (D. Schütz 2021, 4.1)
    Density,
}

impl ColorMode {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Rgb,
        Self::Elevation,
        Self::Intensity,
        Self::Classification,
        Self::Level,
        Self::Normal,
        Self::Density,
    ];

    /// As it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Elevation => "elevation",
            Self::Intensity => "intensity",
            Self::Classification => "classification",
            Self::Level => "level",
            Self::Normal => "normal",
            Self::Density => "density",
        }
    }

    /// The attribute that it needs, if any.
    #[must_use]
    pub const fn attribute(self) -> Option<&'static str> {
        match self {
            Self::Rgb => Some("color"),
            Self::Intensity => Some("intensity"),
            Self::Classification => Some("classification"),
            Self::Normal => Some("normal"),
            Self::Elevation | Self::Level | Self::Density => None,
        }
    }
}

impl FromStr for ColorMode {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|mode| mode.name() == text)
            .ok_or_else(|| format!("expected one of {}", Self::ALL.map(Self::name).join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mode_is_read_as_it_is_written() {
        for mode in ColorMode::ALL {
            assert_eq!(mode.name().parse(), Ok(mode));
        }
        assert!("colour".parse::<ColorMode>().is_err_and(|e| e.contains("density")));
    }
}
