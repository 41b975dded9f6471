//! `zoom`: from the whole cloud to a small part of it, and back.

use glam::DVec3;

use super::{
    Extent,
    extent::direction,
    options::Options,
    spec::{Common, Keys},
};
use crate::path::{KeyFrame, Lens, PathError};

/// From where the camera looks: a little east of south, well above.
const BEARING: f64 = 0.3;
const ELEVATION: f64 = 0.7;

/// Where in the cloud the place may be that a seed chooses, in halves of the cloud's sides.
const WITHIN: f64 = 0.6;

/// By what the camera zooms.
#[derive(Debug, Clone, Copy, PartialEq)]
enum By {
    /// It goes nearer.
    Distance,
    /// It stays, and the field of view grows smaller.
    Fov,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Zoom {
    /// How much larger things appear in the end.
    factor: f64,
    by: By,
}

impl Zoom {
    pub fn read(options: &mut Options) -> Result<Self, PathError> {
        Ok(Self {
            factor: options.number("factor", 20.0, 1.1..=1e6)?,
            by: options.choice("by", &[("distance", By::Distance), ("fov", By::Fov)])?,
        })
    }

    pub fn keys(&self, common: &Common, extent: &Extent) -> Keys {
        let away = direction(BEARING, ELEVATION);
        let center = extent.center();
        let offset = common
            .variation()
            .map_or(DVec3::ZERO, |mut random| WITHIN * extent.half() * random.in_cube());
        let far = extent.fit_distance(away, common.fov_y());
        // A key wherever things have doubled in size, at the least.
        let half = (libm::log2(self.factor).ceil() as usize).max(4);
        let keys = (0..=2 * half).map(|step| {
            let depth = half.abs_diff(step);
            // 1 for the whole, 1 / factor for the part.
            let share = libm::pow(self.factor, depth as f64 / half as f64 - 1.0);
            let time = common.time(step, 2 * half);
            // What it looks at moves no faster over the picture than the zoom goes.
            let target = center + (1.0 - share) * offset;
            match self.by {
                By::Distance => {
                    let distance = (share * far).max(extent.nearest());
                    common.key(time, target + distance * away, target)
                }
                By::Fov => {
                    let tangent = share * libm::tan(0.5 * common.fov_y());
                    let lens = Lens::FovYDegrees(2.0 * libm::atan(tangent).to_degrees());
                    KeyFrame { lens, ..common.key(time, center + far * away, target) }
                }
            }
        });
        Keys { keys: keys.collect(), is_loop: true }
    }
}
