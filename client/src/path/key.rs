//! A key frame: where the camera is at one time.

use glam::DVec3;

use crate::camera::{Camera, Projection};

/// Largest absolute coordinate of a position or a target, in world units, and of `up`: an f64 still
/// tells an eighth of a unit there, and no product of the formulas overflows.
pub const LARGEST_COORDINATE: f64 = 1e15;

/// Largest absolute time in seconds (30 years): an f64 still tells a fifth of a microsecond there.
pub const LARGEST_TIME: f64 = 1e9;

/// Least time between a key and the next, in seconds.
pub const SHORTEST_STEP: f64 = 1e-6;

/// How the view is projected, as a path file tells it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lens {
    /// Perspective, by the full vertical field of view in degrees, above 0 and below 180.
    FovYDegrees(f64),
    /// Orthographic, by the world units from the lower to the upper edge of the picture.
    OrthographicHeight(f64),
}

impl Lens {
    /// The number by which it zooms.
    pub(super) fn value(self) -> f64 {
        match self {
            Self::FovYDegrees(value) | Self::OrthographicHeight(value) => value,
        }
    }

    /// The same kind of lens by another number.
    pub(super) fn with(self, value: f64) -> Self {
        match self {
            Self::FovYDegrees(_) => Self::FovYDegrees(value),
            Self::OrthographicHeight(_) => Self::OrthographicHeight(value),
        }
    }

    /// For a user.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::FovYDegrees(_) => "perspective",
            Self::OrthographicHeight(_) => "orthographic",
        }
    }

    fn projection(self) -> Projection {
        match self {
            Self::FovYDegrees(degrees) => Projection::Perspective { fov_y: degrees.to_radians() },
            Self::OrthographicHeight(height) => Projection::Orthographic { height },
        }
    }
}

/// Where the camera is at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KeyFrame {
    /// Seconds; any start, each key's after that of the key before.
    pub time: f64,
    /// Where the camera stands, in world units.
    pub position: DVec3,
    /// What it looks at, in world units; differs from `position`.
    pub target: DVec3,
    /// Which way is up; of any length above 0.
    pub up: DVec3,
    /// How the view is projected.
    pub lens: Lens,
    /// Whether the camera stays at the key before until `time` and is here at once.
    pub jump: bool,
}

impl KeyFrame {
    /// The camera of this key.
    #[must_use]
    pub fn camera(&self) -> Camera {
        Camera {
            eye: self.position,
            target: self.target,
            up: self.up,
            projection: self.lens.projection(),
        }
    }

    /// From the position to the target.
    pub(super) fn view(&self) -> DVec3 {
        self.target - self.position
    }

    /// Largest absolute coordinate of position and target.
    pub(super) fn reach(&self) -> f64 {
        self.position.abs().max_element().max(self.target.abs().max_element())
    }

    /// Whether camera and view are those of `other`, whatever the times.
    pub(super) fn is_same_view(&self, other: &Self) -> bool {
        (self.position, self.target, self.up, self.lens)
            == (other.position, other.target, other.up, other.lens)
    }

    /// What is wrong with the key by itself.
    pub(super) fn check(&self) -> Result<(), String> {
        if !(-LARGEST_TIME..=LARGEST_TIME).contains(&self.time) {
            return Err(format!("time {} is not within ±{LARGEST_TIME:e} seconds", self.time));
        }
        for (name, vector) in
            [("position", self.position), ("target", self.target), ("up", self.up)]
        {
            if !vector.to_array().iter().all(|c| c.abs() <= LARGEST_COORDINATE) {
                return Err(format!("{name} {vector} is not within ±{LARGEST_COORDINATE:e}"));
            }
        }
        self.camera().check().map_err(|e| e.to_string())
    }
}
