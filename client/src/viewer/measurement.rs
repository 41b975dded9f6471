//! Distances between two points.

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// From one point to another, in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// The first point.
    pub from: [f64; 3],
    /// The second point.
    pub to: [f64; 3],
}

impl Measurement {
    fn step(&self) -> DVec3 {
        DVec3::from(self.to) - DVec3::from(self.from)
    }

    /// Straight from one to the other.
    #[must_use]
    pub fn distance(&self) -> f64 {
        self.step().length()
    }

    /// How much higher the second is.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.step().z
    }

    /// On a map.
    #[must_use]
    pub fn horizontal(&self) -> f64 {
        self.step().truncate().length()
    }

    /// Whether all coordinates are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.from.iter().chain(&self.to).all(|c| c.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_measured_straight_on_the_map_and_in_height() {
        let step = Measurement { from: [1.0, 2.0, 3.0], to: [4.0, 6.0, -9.0] };
        assert_eq!((step.distance(), step.horizontal(), step.height()), (13.0, 5.0, -12.0));
    }
}
