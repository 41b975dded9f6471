//! `teleport`: from one place to another, far away and of another scale, at once: the worst case
//! for caches.

use glam::DVec3;

use super::{
    Extent,
    extent::direction,
    options::Options,
    random::Random,
    spec::{Common, Keys},
};
use crate::path::{KeyFrame, PathError};

/// Of so many random places the one most unlike the last is the next.
const CANDIDATES: usize = 8;

/// Where in the cloud the places are, in halves of its sides.
const WITHIN: f64 = 0.9;

/// From how far above the horizon the camera looks, in degrees.
const ELEVATION_DEGREES: [f64; 2] = [15.0, 75.0];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Teleport {
    /// Places; each is stayed at for as long.
    stops: usize,
    /// How much nearer than for the whole cloud the camera comes at most.
    factor: f64,
}

/// Where to look at, in halves of the cloud's sides, and how near: 0 for the whole cloud, 1 for the
/// smallest part.
#[derive(Clone, Copy)]
struct Stop {
    place: DVec3,
    nearness: f64,
    away: DVec3,
}

impl Stop {
    fn random(random: &mut Random) -> Self {
        let place = WITHIN * random.in_cube();
        let nearness = random.unit();
        let bearing = random.within(0.0, std::f64::consts::TAU);
        let [low, high] = ELEVATION_DEGREES.map(f64::to_radians);
        Self { place, nearness, away: direction(bearing, random.within(low, high)) }
    }

    /// From 0 to 2: by place, and by scale.
    fn unlike(&self, other: &Self) -> f64 {
        let diagonal = 2.0 * DVec3::ONE.length();
        (self.place - other.place).length() / diagonal + (self.nearness - other.nearness).abs()
    }
}

impl Teleport {
    pub fn read(options: &mut Options) -> Result<Self, PathError> {
        // At most ten thousand: a small number on every machine.
        let stops = options.count("stops", 10, 2..=10_000)? as usize;
        Ok(Self { stops, factor: options.number("factor", 100.0, 1.0..=1e6)? })
    }

    pub fn keys(&self, common: &Common, extent: &Extent) -> Keys {
        let mut random = Random::new(common.seed);
        let mut last: Option<Stop> = None;
        let mut keys: Vec<KeyFrame> = Vec::new();
        for number in 0..self.stops {
            let candidates = (0..CANDIDATES).map(|_| Stop::random(&mut random));
            let candidates: Vec<Stop> = candidates.collect();
            let stop = match last {
                None => candidates[0],
                Some(last) => *candidates
                    .iter()
                    .max_by(|a, b| a.unlike(&last).total_cmp(&b.unlike(&last)))
                    .expect("there are candidates"),
            };
            last = Some(stop);
            let target = extent.center() + extent.half() * stop.place;
            let share = libm::pow(self.factor, -stop.nearness);
            let whole = extent.fit_distance(stop.away, common.fov_y());
            let distance = (share * whole).max(extent.nearest());
            let time = common.time(number, self.stops);
            let key = common.key(time, target + distance * stop.away, target);
            keys.push(KeyFrame { jump: number > 0, ..key });
        }
        // The last place is stayed at, too.
        if let Some(&key) = keys.last() {
            keys.push(KeyFrame { time: common.seconds, jump: false, ..key });
        }
        Keys { keys, is_loop: false }
    }
}
