//! Colour ramps: 256 steps from a number between 0 and 1.
//!
//! Elevation takes Turbo (many distinguishable steps, for reading heights), levels take Viridis,
//! counts Cividis (from blue to yellow, as D. Schütz 2021, 4.1), intensity greys and differences
//! between pictures Magma, which begins in black (all perceptually even). Classes have no order, and
//! a table. The WGSL twin is `shaders/ramps.wgsl`.

/// A ramp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ramp {
    Elevation,
    Intensity,
    Level,
    Density,
    Class,
    Difference,
}

/// Colours of the classes of the LAS specification (1.4, table 17), in the manner of maps.
const CLASSES: [[u8; 3]; 19] = [
    [160, 160, 160], // 0 created, never classified
    [200, 200, 200], // 1 unclassified
    [166, 118, 70],  // 2 ground
    [178, 223, 138], // 3 low vegetation
    [98, 184, 74],   // 4 medium vegetation
    [28, 120, 48],   // 5 high vegetation
    [226, 74, 51],   // 6 building
    [255, 0, 200],   // 7 low point (noise)
    [255, 235, 130], // 8 model key point (reserved since 1.4)
    [49, 120, 216],  // 9 water
    [110, 64, 130],  // 10 rail
    [90, 90, 100],   // 11 road surface
    [235, 220, 160], // 12 overlap (reserved since 1.4)
    [255, 180, 60],  // 13 wire, guard
    [255, 210, 0],   // 14 wire, conductor
    [150, 100, 190], // 15 transmission tower
    [240, 140, 90],  // 16 wire-structure connector
    [140, 140, 200], // 17 bridge deck
    [255, 80, 255],  // 18 high noise
];

/// Colour of a class that the specification reserves or leaves to users.
const OTHER_CLASS: [u8; 3] = [120, 200, 200];

impl Ramp {
    /// The ramps that shaders look colours up in, in the order of their table.
    pub const IN_SHADERS: [Self; 4] =
        [Self::Elevation, Self::Intensity, Self::Class, Self::Density];

    /// The step for `t`, of which 0 to 1 is the range of the ramp. NaN is step 0.
    pub fn step(t: f64) -> u8 {
        (t.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
    }

    /// The colour of a step.
    pub fn color(self, step: u8) -> [u8; 3] {
        let t = f64::from(step) / 255.0;
        let color = match self {
            Self::Elevation => colorous::TURBO.eval_continuous(t),
            // The scheme runs from white to black. Its darkest tenth is left out: a weak return is
            // still a point, not background.
            Self::Intensity => colorous::GREYS.eval_continuous(0.9 * (1.0 - t)),
            Self::Level => colorous::VIRIDIS.eval_continuous(t),
            Self::Density => colorous::CIVIDIS.eval_continuous(t),
            Self::Difference => colorous::MAGMA.eval_continuous(t),
            Self::Class => {
                return CLASSES.get(usize::from(step)).copied().unwrap_or(OTHER_CLASS);
            }
        };
        color.as_array()
    }

    /// All steps.
    pub fn table(self) -> [[u8; 3]; 256] {
        std::array::from_fn(|step| self.color(u8::try_from(step).unwrap_or(u8::MAX)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_cover_the_range_and_stay_in_it() {
        assert_eq!([0.0, 0.5, 1.0].map(Ramp::step), [0, 128, 255]);
        assert_eq!([-3.0, 7.0, f64::NAN].map(Ramp::step), [0, 255, 0]);
    }

    #[test]
    fn ordered_ramps_grow_lighter_all_the_way() {
        for ramp in [Ramp::Intensity, Ramp::Level, Ramp::Density, Ramp::Difference] {
            let lightness = |[r, g, b]: [u8; 3]| {
                0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
            };
            let table = ramp.table().map(lightness);
            assert!(table.windows(2).all(|w| w[1] >= w[0] - 1.0), "{ramp:?}");
            assert!(table[255] > table[0] + 100.0);
        }
    }
}
