//! `flythrough`: from outside one end of the cloud almost to the other, swaying, looking ahead.

use glam::DVec3;

use super::{
    Extent,
    options::Options,
    spec::{Common, Keys},
};
use crate::path::{KeyFrame, PathError};

/// Keys along the way.
const STEPS: usize = 24;

/// Where the way begins and ends, in halves of the cloud's length from its middle: outside, and
/// where there is still something ahead.
const BEGIN: f64 = -1.6;
const END: f64 = 0.7;

/// How far ahead the camera looks, in halves of the cloud's length.
const AHEAD: f64 = 0.5;

/// How far below its own height that is, in halves of the cloud's height.
const BELOW: f64 = 0.4;

/// How far to both sides the way sways, in halves of the cloud's width.
const SWAY: f64 = 0.5;

/// How much higher the way begins, in halves of the cloud's height; it is down where it is inside.
const RISE: f64 = 1.5;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Flythrough {
    /// Of the way, from the cloud's lower side to its upper one.
    height: f64,
}

impl Flythrough {
    pub fn read(options: &mut Options) -> Result<Self, PathError> {
        Ok(Self { height: options.number("height", 0.7, -10.0..=10.0)? })
    }

    pub fn keys(&self, common: &Common, extent: &Extent) -> Keys {
        let half = extent.roomy_half();
        // Along the longest side; up along z where that is not the longest, else along y.
        let (along, across, up) = if half.z > half.x.max(half.y) {
            (DVec3::Z, DVec3::X, DVec3::Y)
        } else if half.x >= half.y {
            (DVec3::X, DVec3::Y, DVec3::Z)
        } else {
            (DVec3::Y, DVec3::X, DVec3::Z)
        };
        // Which way, how often it sways, and where in a sway it begins.
        let (sense, waves, phase) = common.variation().map_or((1.0, 1.0, 0.0), |mut random| {
            let sense = if random.unit() < 0.5 { 1.0 } else { -1.0 };
            (sense, random.within(0.5, 2.0), random.unit())
        });
        let height = 2.0 * self.height - 1.0;
        // `u` from -1 to 1 is inside.
        let way = |u: f64, lower: f64| {
            let sway = SWAY * libm::sin(std::f64::consts::TAU * (0.5 * waves * u + phase));
            let out = ((-1.0 - u) / (-1.0 - BEGIN)).max(0.0);
            let local =
                sense * u * along + sway * across + (height + RISE * out * out - lower) * up;
            extent.center() + half * local
        };
        let keys = (0..=STEPS).map(|step| {
            let u = BEGIN + (END - BEGIN) * (step as f64 / STEPS as f64);
            let key = common.key(common.time(step, STEPS), way(u, 0.0), way(u + AHEAD, BELOW));
            KeyFrame { up, ..key }
        });
        Keys { keys: keys.collect(), is_loop: false }
    }
}
