//! `orbit`: around the cloud, looking at its middle.

use super::{
    Extent,
    extent::direction,
    options::Options,
    spec::{Common, Keys},
};
use crate::path::PathError;

/// Keys of a full turn: the curve between them is within 0.02 % of the circle.
const KEYS_PER_TURN: f64 = 24.0;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Orbit {
    /// Counter-clockwise as seen from above; backwards where negative.
    turns: f64,
    /// Above the horizon.
    elevation_degrees: f64,
    /// In distances from which the whole cloud is seen all the way round.
    distance: f64,
}

impl Orbit {
    pub fn read(options: &mut Options) -> Result<Self, PathError> {
        let turns = options.number("turns", 1.0, -1000.0..=1000.0)?;
        if turns.abs() < 0.001 {
            return Err(PathError::Spec(format!("orbit: turns={turns} is no movement")));
        }
        Ok(Self {
            turns,
            elevation_degrees: options.number("elevation", 30.0, -89.0..=89.0)?,
            distance: options.number("distance", 1.0, 0.01..=1000.0)?,
        })
    }

    pub fn keys(&self, common: &Common, extent: &Extent) -> Keys {
        let tau = std::f64::consts::TAU;
        let begin = common.variation().map_or(0.0, |mut random| tau * random.unit());
        let elevation = self.elevation_degrees.to_radians();
        // Bounded by the limits of `turns`.
        let steps = (KEYS_PER_TURN * self.turns.abs()).ceil().max(2.0) as usize;
        let away = |step: usize| {
            direction(begin + tau * self.turns * (step as f64 / steps as f64), elevation)
        };
        let fits = (0..=steps).map(|step| extent.fit_distance(away(step), common.fov_y()));
        let distance = self.distance * fits.fold(0.0, f64::max);
        let center = extent.center();
        let mut keys: Vec<_> = (0..=steps)
            .map(|step| {
                common.key(common.time(step, steps), center + distance * away(step), center)
            })
            .collect();
        let is_loop = self.turns.fract() == 0.0;
        if is_loop {
            // The sine of a full turn is not that of none to the last digit.
            keys[steps].position = keys[0].position;
        }
        Keys { keys, is_loop }
    }
}
