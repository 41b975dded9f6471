//! Kinds of splats.

use std::str::FromStr;

use lodestream_shaders::Footprint;
use serde::Serialize;

/// What a point covers on the picture, and how far away its parts are.
///
/// The rules, which the CPU renderer follows to the letter: `c` is the splat's centre on the picture,
/// `s` its size in pixels, `z` the distance of the centre along the view direction, `R` the world
/// radius that `s / 2` pixels are at that distance, `r` the distance of a pixel's middle from `c` in
/// units of `s / 2`, at most 1. Every splat covers the pixel that holds its centre: none falls
/// between pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(into = "&'static str")]
pub enum Splat {
    /// The pixel that holds the centre, whatever the size. (Fraiss 2017, 3.3.1)
    Point,
    /// Every pixel whose middle lies in the square around `c` (lower and left edges excluded, upper
    /// and right ones included, in pixel coordinates that grow right and down), at distance `z`.
    /// (Fraiss 2017, 3.3.2, 3.3.3)
    Square,
    /// Every pixel whose middle lies in the circle around `c`, at distance `z`.
    Circle,
    /// A circle whose parts are at `z + r R`: the splat whose centre is nearest to a pixel wins it.
    /// (Fraiss 2017, 3.3.4; there the centre comes forward instead of the rim going back, which
    /// orders splats alike, but moves large splats behind the eye.)
    Cone,
    /// A circle whose parts are at `z + r² R`. (Fraiss 2017, listing 3.6)
    Paraboloid,
    /// The paraboloid as 8 triangles, at least 1.54 pixels across. (Fraiss 2017, 3.3.4)
    Paraboloid8,
    /// The paraboloid as 16 triangles.
    Paraboloid16,
    /// The paraboloid as 32 triangles.
    Paraboloid32,
    /// The paraboloid as 48 triangles. (Fraiss 2017, fig. 3.10)
    Paraboloid48,
    /// A disc of radius `R` across the normal, seen in perspective; its parts are where the pixels'
    /// rays meet it. Faces the picture where there is no normal. (Radner 2018, 4.3)
    Disc,
    /// An ellipse of half axes `axis_u` and `axis_v`, scaled so that the longer one is `R`; a disc
    /// where there are none. (Radner 2018, 4.2.2)
    Ellipse,
    /// Circles, of which those within `R` behind the nearest are averaged, weighted by `exp(-3 r²)`.
    /// (Botsch et al. 2005, as Radner 2018, 4.6 asks)
    Blended,
    /// The same of discs.
    BlendedDisc,
    /// The same of ellipses.
    BlendedEllipse,
}

impl Splat {
    /// All of them, with their names.
    pub const ALL: [(Self, &'static str); 14] = [
        (Self::Point, "point"),
        (Self::Square, "square"),
        (Self::Circle, "circle"),
        (Self::Cone, "cone"),
        (Self::Paraboloid, "paraboloid"),
        (Self::Paraboloid8, "paraboloid8"),
        (Self::Paraboloid16, "paraboloid16"),
        (Self::Paraboloid32, "paraboloid32"),
        (Self::Paraboloid48, "paraboloid48"),
        (Self::Disc, "disc"),
        (Self::Ellipse, "ellipse"),
        (Self::Blended, "blended"),
        (Self::BlendedDisc, "blended-disc"),
        (Self::BlendedEllipse, "blended-ellipse"),
    ];

    /// As it is written.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(splat, _)| *splat == self).map_or("", |(_, name)| name)
    }

    /// The pixels it covers, and their depths.
    #[must_use]
    pub const fn footprint(self) -> Footprint {
        match self {
            Self::Point => Footprint::Point,
            Self::Square => Footprint::Square,
            Self::Circle | Self::Blended => Footprint::Circle,
            Self::Cone => Footprint::Cone,
            Self::Paraboloid => Footprint::Paraboloid,
            Self::Paraboloid8 => Footprint::Paraboloid8,
            Self::Paraboloid16 => Footprint::Paraboloid16,
            Self::Paraboloid32 => Footprint::Paraboloid32,
            Self::Paraboloid48 => Footprint::Paraboloid48,
            Self::Disc | Self::BlendedDisc => Footprint::Disc,
            Self::Ellipse | Self::BlendedEllipse => Footprint::Ellipse,
        }
    }

    /// Whether overlapping splats are averaged.
    #[must_use]
    pub const fn is_blended(self) -> bool {
        matches!(self, Self::Blended | Self::BlendedDisc | Self::BlendedEllipse)
    }
}

impl From<Splat> for &'static str {
    fn from(splat: Splat) -> Self {
        splat.name()
    }
}

impl FromStr for Splat {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(_, name)| *name == text);
        found.map(|(splat, _)| *splat).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|(_, name)| *name).collect();
            format!("expected one of {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_splat_is_read_as_it_is_written() {
        for (splat, name) in Splat::ALL {
            assert_eq!(name.parse(), Ok(splat));
            assert_eq!(splat.name(), name);
        }
        assert!("triangle".parse::<Splat>().is_err_and(|e| e.contains("blended-disc")));
    }
}
