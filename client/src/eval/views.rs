//! Where pictures are taken from, by rule.
//!
//! After D. Schütz 2021, 6.4: from far away the cloud takes up a part of the picture, at medium distance
//! it fills it, from near only a part of the cloud is seen.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::camera::Camera;

/// How far away a picture is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum ViewSize {
    /// A part of the cloud fills the picture.
    Near,
    /// The cloud fills the picture.
    Medium,
    /// The cloud fills a part of the picture.
    Far,
}

impl ViewSize {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Near, Self::Medium, Self::Far];

    /// As it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Near => "near",
            Self::Medium => "medium",
            Self::Far => "far",
        }
    }

    /// Distance, as a multiple of that at which the cloud fills the picture.
    const fn distance(self) -> f64 {
        match self {
            Self::Near => 0.25,
            Self::Medium => 1.0,
            Self::Far => 3.0,
        }
    }

    /// The view of a cloud with these bounds, from the direction of the overview. From near it is
    /// aimed at `middle`, where the cloud has its points.
    #[must_use]
    pub fn camera(self, bounds: [DVec3; 2], middle: DVec3, aspect: f64) -> Camera {
        let overview = Camera::overview(bounds[0], bounds[1], aspect);
        let from = overview.eye - overview.target;
        let target = if self == Self::Near { middle } else { overview.target };
        Camera { eye: target + self.distance() * from, target, ..overview }
    }

    /// The same, as much to the side (in its own picture heights) as `heights` says: where a visitor
    /// jumps to.
    #[must_use]
    pub fn jumped(self, bounds: [DVec3; 2], middle: DVec3, aspect: f64, heights: f64) -> Camera {
        let camera = self.camera(bounds, middle, aspect);
        let basis = camera.basis();
        let half = match camera.projection {
            crate::camera::Projection::Perspective { fov_y } => {
                (camera.eye - camera.target).length() * (0.5 * fov_y).tan()
            }
            crate::camera::Projection::Orthographic { height } => 0.5 * height,
        };
        let aside = 2.0 * half * heights * basis.right;
        Camera { eye: camera.eye + aside, target: camera.target + aside, ..camera }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cloud_takes_up_as_much_of_the_picture_as_the_name_says() {
        let bounds = [DVec3::ZERO, DVec3::new(10.0, 8.0, 1.0)];
        let middle = DVec3::new(5.0, 4.0, 0.5);
        // Share of the picture's height that the cloud's diagonal takes up at its middle.
        let share = |size: ViewSize| {
            let camera = size.camera(bounds, middle, 1.0);
            let px = camera.pixels_per_world((camera.eye - middle).length(), 1000);
            (bounds[1] - bounds[0]).length() * px / 1000.0
        };
        let [near, medium, far] = ViewSize::ALL.map(share);
        assert!(near > 2.0, "{near}");
        assert!((0.6..1.6).contains(&medium), "{medium}");
        assert!(far < 0.55, "{far}");
    }

    #[test]
    fn a_jump_of_a_picture_height_shows_what_lay_beside() {
        let bounds = [DVec3::ZERO, DVec3::new(10.0, 8.0, 1.0)];
        let middle = DVec3::new(5.0, 4.0, 0.5);
        let from = ViewSize::Near.camera(bounds, middle, 1.0);
        let to = ViewSize::Near.jumped(bounds, middle, 1.0, 1.0);
        let moved = to.target - from.target;
        let px = from.pixels_per_world((from.eye - from.target).length(), 1000);
        assert!((moved.length() * px - 1000.0).abs() < 1.0);
        assert!(moved.dot(from.target - from.eye).abs() < 1e-9);
    }
}
