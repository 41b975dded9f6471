//! `random-walk`: here and there over and in the cloud, looking ahead.

use glam::DVec3;

use super::{
    Extent,
    options::Options,
    random::Random,
    spec::{Common, Keys},
};
use crate::path::PathError;

/// How much of the new direction is chance: 0 goes straight on, larger ones turn more sharply.
const WHIM: f64 = 0.8;

/// How strongly the cloud's sides turn the walk back to the middle, which is where one sees most.
const PULL: f64 = 2.5;

/// Vertical steps beside horizontal ones.
const CLIMB: f64 = 0.4;

/// How far ahead the camera looks, in strides, and how much of that down.
const AHEAD: f64 = 2.0;
const DOWN: f64 = 0.4;

/// Lowest and highest place, in halves of the cloud's height from its middle: what there is to see
/// lies more often below than above.
const HEIGHTS: [f64; 2] = [0.1, 1.0];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct RandomWalk {
    steps: usize,
    /// Length of a step in halves of the cloud's sides.
    stride: f64,
}

impl RandomWalk {
    pub fn read(options: &mut Options) -> Result<Self, PathError> {
        // At most a hundred thousand: a small number on every machine.
        let steps = options.count("steps", 20, 1..=100_000)? as usize;
        Ok(Self { steps, stride: options.number("stride", 0.2, 0.001..=1.0)? })
    }

    pub fn keys(&self, common: &Common, extent: &Extent) -> Keys {
        let mut random = Random::new(common.seed);
        let half = extent.roomy_half();
        let world = |at: DVec3| extent.center() + half * at;
        // In halves of the sides around the middle.
        let mut at = 0.6 * random.in_cube();
        at.z = at.z.clamp(HEIGHTS[0], HEIGHTS[1]);
        let mut heading = heading(&mut random);
        let keys = (0..=self.steps).map(|step| {
            let ahead = at + AHEAD * self.stride * (heading - DOWN * DVec3::Z);
            let key = common.key(common.time(step, self.steps), world(at), world(ahead));
            let level = DVec3::new(at.x, at.y, 0.0);
            let back = -PULL * level.length_squared() * level;
            let turned = heading + WHIM * self::heading(&mut random) + back;
            heading = turned.normalize_or(heading);
            let next = at + self.stride * heading;
            at = next.clamp(DVec3::new(-1.0, -1.0, HEIGHTS[0]), DVec3::new(1.0, 1.0, HEIGHTS[1]));
            if at.z != next.z {
                heading.z = -heading.z;
            }
            key
        });
        Keys { keys: keys.collect(), is_loop: false }
    }
}

/// A random unit vector, rather level than steep.
fn heading(random: &mut Random) -> DVec3 {
    let chance = random.in_cube() * DVec3::new(1.0, 1.0, CLIMB);
    chance.normalize_or(DVec3::X)
}
