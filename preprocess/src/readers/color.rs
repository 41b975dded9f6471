//! Colours without a declared range: floating point, or numbers in text.

/// The range that colour components run over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum ColorRange {
    /// From 0 to 1, in fractions.
    Unit,
    /// From 0 to 255, whole.
    Byte,
    /// From 0 to 255, in fractions.
    FractionalByte,
    /// From 0 to 65535.
    Word,
}

/// Fractions may overshoot 1 (light baked into a texture) and still mean 0 to 1; colours of which
/// none exceeds 16 of 255 would be black.
const OVERSHOOT: f64 = 16.0;

impl ColorRange {
    /// The range that a sample of components tells. Components beyond any range do not count.
    pub fn of(components: impl Iterator<Item = f64>) -> Self {
        let (mut most, mut whole) = (0.0_f64, true);
        for component in components.filter(|c| (0.0..=65535.0).contains(c)) {
            most = most.max(component);
            whole &= component.fract() == 0.0;
        }
        if most <= 1.0 || (!whole && most <= OVERSHOOT) {
            Self::Unit
        } else if most > 255.0 {
            Self::Word
        } else if whole {
            Self::Byte
        } else {
            Self::FractionalByte
        }
    }

    /// Steps of a stored 16-bit colour per unit. Whole numbers stay as they are.
    pub fn scale(self) -> f64 {
        match self {
            Self::Unit => 65535.0,
            Self::FractionalByte => 257.0,
            Self::Byte | Self::Word => 1.0,
        }
    }

    /// How the range is understood, for the user.
    pub fn note(self) -> String {
        let (range, stored) = match self {
            Self::Unit => ("0 to 1", "0 to 65535"),
            Self::Byte => ("0 to 255", "they are, in 16 bits"),
            Self::FractionalByte => ("0 to 255, with fractions", "0 to 65535"),
            Self::Word => ("0 to 65535", "they are"),
        };
        format!("colour: numbers are taken to run from {range}; stored as {stored}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_is_told_by_the_largest_component_and_by_fractions() {
        for (components, range) in [
            (&[0.0, 0.5, 1.0][..], ColorRange::Unit),
            (&[0.0, 1.0], ColorRange::Unit),
            (&[], ColorRange::Unit),
            (&[0.2, 1.3], ColorRange::Unit),
            (&[0.2, -1.0, f64::NAN, 1e9], ColorRange::Unit),
            (&[2.0, 3.0], ColorRange::Byte),
            (&[117.0, 255.0], ColorRange::Byte),
            (&[117.5, 255.0], ColorRange::FractionalByte),
            (&[117.0, 256.0], ColorRange::Word),
        ] {
            assert_eq!(ColorRange::of(components.iter().copied()), range, "{components:?}");
        }
    }
}
