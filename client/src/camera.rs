//! The camera: where it stands, what it sees. All in f64 world units.

use glam::DVec3;

/// How the view is projected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Projection {
    /// Perspective with the full vertical field of view in radians, above 0 and below pi.
    Perspective {
        /// Full vertical field of view in radians.
        fov_y: f64,
    },
    /// Orthographic; `height` is the world height of the picture.
    Orthographic {
        /// World units from the lower to the upper edge.
        height: f64,
    },
}

/// A camera in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: DVec3,
    /// What it looks at; differs from `eye`.
    pub target: DVec3,
    /// Which way is up; need not be perpendicular to the view direction.
    pub up: DVec3,
    /// How the view is projected.
    pub projection: Projection,
}
