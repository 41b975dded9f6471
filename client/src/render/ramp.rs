//! Colour ramps: 256 steps from a number between 0 and 1.
//!
//! Elevation takes Turbo (many distinguishable steps, for reading heights), levels take Viridis
//! and intensity takes greys (both perceptually even). The WGSL twin is `shaders/ramps.wgsl`.

/// A ramp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ramp {
    Elevation,
    Intensity,
    Level,
}

impl Ramp {
    /// The ramps that shaders look colours up in, in the order of their table.
    pub const IN_SHADERS: [Self; 2] = [Self::Elevation, Self::Intensity];

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
    fn intensity_and_level_grow_lighter_all_the_way() {
        for ramp in [Ramp::Intensity, Ramp::Level] {
            let lightness = |[r, g, b]: [u8; 3]| {
                0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
            };
            let table = ramp.table().map(lightness);
            assert!(table.windows(2).all(|w| w[1] >= w[0] - 1.0), "{ramp:?}");
            assert!(table[255] > table[0] + 100.0);
        }
    }
}
