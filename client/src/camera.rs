//! The camera: where it stands, what it sees. All in f64 world units.
//!
//! View space is right-handed: x to the right, y up, and the camera looks along -z.
//!
//! A camera is read from and written to a small JSON file:
//!
//! ```json
//! { "eye": [0, -10, 5], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_degrees": 60 }
//! ```
//!
//! with `orthographic_height` (world units from the lower to the upper edge) in place of
//! `fov_y_degrees` for an orthographic view. `up` may be left out: +z.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Full vertical field of view of an [overview](Camera::overview), in degrees.
const OVERVIEW_FOV_Y_DEGREES: f64 = 50.0;

/// From the cloud towards the overview's eye where the cloud is at least as wide (x) as deep (y):
/// from the south, a little from the east, well above.
const OVERVIEW_FROM: DVec3 = DVec3::new(0.3, -1.0, 0.9);

/// Part of the picture's half width and height that an overview may fill.
const OVERVIEW_FILL: f64 = 0.96;

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

/// Why numbers are no camera.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// The text is not a camera file.
    #[error("not a camera file: {0}")]
    Json(String),
    /// The numbers cannot be those of a camera.
    #[error("impossible camera: {0}")]
    Impossible(&'static str),
}

/// The camera's axes in world space: orthonormal, right-handed (`right × up = -forward`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewBasis {
    /// To the right edge of the picture.
    pub right: DVec3,
    /// To the upper edge of the picture.
    pub up: DVec3,
    /// Into the picture.
    pub forward: DVec3,
}

impl ViewBasis {
    /// Rotation from world to view space.
    #[must_use]
    pub fn view_from_world(&self) -> DMat3 {
        DMat3::from_cols(self.right, self.up, -self.forward).transpose()
    }
}

/// The camera file as it is written.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    eye: [f64; 3],
    target: [f64; 3],
    #[serde(default = "z_axis")]
    up: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fov_y_degrees: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    orthographic_height: Option<f64>,
}

fn z_axis() -> [f64; 3] {
    DVec3::Z.to_array()
}

impl Camera {
    /// Reads a camera file.
    ///
    /// # Errors
    /// [`CameraError::Json`] where the text is not such a file, [`CameraError::Impossible`] as
    /// for [`check`](Self::check).
    pub fn from_json(text: &str) -> Result<Self, CameraError> {
        let file: CameraFile =
            serde_json::from_str(text).map_err(|e| CameraError::Json(e.to_string()))?;
        let projection = match (file.fov_y_degrees, file.orthographic_height) {
            (Some(degrees), None) => Projection::Perspective { fov_y: degrees.to_radians() },
            (None, Some(height)) => Projection::Orthographic { height },
            _ => {
                let why = "give either fov_y_degrees or orthographic_height";
                return Err(CameraError::Json(why.into()));
            }
        };
        let camera = Self {
            eye: file.eye.into(),
            target: file.target.into(),
            up: file.up.into(),
            projection,
        };
        camera.check()?;
        Ok(camera)
    }

    /// The camera file, as [`from_json`](Self::from_json) reads it.
    #[must_use]
    pub fn to_json(&self) -> String {
        let (fov_y_degrees, orthographic_height) = match self.projection {
            Projection::Perspective { fov_y } => (Some(fov_y.to_degrees()), None),
            Projection::Orthographic { height } => (None, Some(height)),
        };
        let file = CameraFile {
            eye: self.eye.to_array(),
            target: self.target.to_array(),
            up: self.up.to_array(),
            fov_y_degrees,
            orthographic_height,
        };
        serde_json::to_string_pretty(&file).expect("numbers and options always serialize")
    }

    /// Whether the numbers are those of a camera.
    ///
    /// # Errors
    /// [`CameraError::Impossible`] where a number is not finite, the eye is at the target, `up` is
    /// zero, or the projection is out of its range.
    pub fn check(&self) -> Result<(), CameraError> {
        let bad = |why| Err(CameraError::Impossible(why));
        if !(self.eye.is_finite() && self.target.is_finite() && self.up.is_finite()) {
            return bad("eye, target and up must be finite numbers");
        }
        if (self.target - self.eye).try_normalize().is_none() {
            return bad("eye and target are the same place");
        }
        if self.up.try_normalize().is_none() {
            return bad("up is zero");
        }
        match self.projection {
            // A picture that spans 180 degrees is infinitely high.
            Projection::Perspective { fov_y } if !(fov_y > 0.0 && fov_y < std::f64::consts::PI) => {
                bad("fov_y_degrees must be above 0 and below 180")
            }
            Projection::Orthographic { height } if !(height > 0.0 && height.is_finite()) => {
                bad("orthographic_height must be above 0")
            }
            _ => Ok(()),
        }
    }

    /// The camera's axes. Where `up` is parallel to the view direction, y stands in for it (or x,
    /// where the view is along y).
    #[must_use]
    pub fn basis(&self) -> ViewBasis {
        let forward = (self.target - self.eye).try_normalize().unwrap_or(DVec3::NEG_Z);
        // The sine of the smallest angle between two directions that still tells a third one.
        let apart =
            |up: DVec3| Some(forward.cross(up.try_normalize()?)).filter(|c| c.length() > 1e-9);
        let right = [self.up, DVec3::Y, DVec3::X].into_iter().find_map(apart);
        let right = right.map_or(DVec3::X, DVec3::normalize);
        ViewBasis { right, up: right.cross(forward), forward }
    }

    /// Pixels that one world unit across the view takes up at `distance` world units along the view
    /// direction, in a picture `height_px` pixels high.
    #[must_use]
    pub fn pixels_per_world(&self, distance: f64, height_px: u32) -> f64 {
        let height_px = f64::from(height_px);
        match self.projection {
            Projection::Perspective { fov_y } => 0.5 * height_px / (0.5 * fov_y).tan() / distance,
            Projection::Orthographic { height } => height_px / height,
        }
    }

    /// A perspective camera that sees all of the box in a picture of `aspect` = width / height:
    /// from above, the longer side across, the box filling the picture as far as its shape allows.
    #[must_use]
    pub fn overview(min: DVec3, max: DVec3, aspect: f64) -> Self {
        let middle = 0.5 * (min + max);
        let extent = max - min;
        let from = if extent.x >= extent.y {
            OVERVIEW_FROM
        } else {
            // The same, turned by a quarter: from the east.
            DVec3::new(-OVERVIEW_FROM.y, OVERVIEW_FROM.x, OVERVIEW_FROM.z)
        };
        let fov_y = OVERVIEW_FOV_Y_DEGREES.to_radians();
        let projection = Projection::Perspective { fov_y };
        let at_origin = Self { eye: from, target: DVec3::ZERO, up: DVec3::Z, projection };
        let basis = at_origin.basis();
        let view_from_world = basis.view_from_world();
        // With the eye at e (view axes, relative to the middle of the box, z turned to point into
        // the picture), a corner c is inside the picture's right edge where
        // c.x - e.x <= (c.z - e.z) * t, and so on for the other edges. The largest e.z (the nearest
        // eye) that meets the constraints of two opposite edges puts e.x midway between them.
        let corners: [DVec3; 8] = std::array::from_fn(|corner| {
            let sign = |axis: usize| if corner >> axis & 1 == 1 { 0.5 } else { -0.5 };
            let view = view_from_world * (extent * DVec3::new(sign(0), sign(1), sign(2)));
            DVec3::new(view.x, view.y, -view.z)
        });
        let most = |bound: &dyn Fn(&DVec3) -> f64| {
            corners.iter().map(bound).fold(f64::NEG_INFINITY, f64::max)
        };
        let fit = |axis: usize, tangent: f64| {
            let upper = most(&|c| c[axis] - c.z * tangent);
            let lower = most(&|c| -c[axis] - c.z * tangent);
            (0.5 * (upper - lower), -(upper + lower) / (2.0 * tangent))
        };
        let tangent = OVERVIEW_FILL * (0.5 * fov_y).tan();
        let ((x, z_for_x), (y, z_for_y)) = (fit(0, tangent * aspect), fit(1, tangent));
        // A cloud without extent is looked at from as near as its coordinates can tell apart.
        let nearest = (1e-6 * middle.abs().max_element()).max(1e-6);
        let distance = (-z_for_x.min(z_for_y)).max(nearest);
        let target = middle + x * basis.right + y * basis.up;
        Self { eye: target - distance * basis.forward, target, ..at_origin }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;

    fn camera() -> Camera {
        Camera {
            eye: DVec3::new(3.0, -4.0, 5.0),
            target: DVec3::ZERO,
            up: DVec3::Z,
            projection: Projection::Perspective { fov_y: 1.0 },
        }
    }

    #[test]
    fn basis_is_orthonormal_and_right_handed() {
        let straight_down = Camera { eye: DVec3::Z, ..camera() };
        let along_y = Camera { eye: DVec3::NEG_Y, up: DVec3::Y, ..camera() };
        for camera in [camera(), straight_down, along_y] {
            let ViewBasis { right, up, forward } = camera.basis();
            for axis in [right, up, forward] {
                assert!((axis.length() - 1.0).abs() < 1e-15, "{axis}");
            }
            assert!((right.cross(up) + forward).length() < 1e-15);
        }
        assert_eq!(straight_down.basis().up, DVec3::Y, "north is up in a view straight down");
    }

    #[test]
    fn json_round_trip_keeps_the_camera() {
        let orthographic = Projection::Orthographic { height: 12.5 };
        for camera in [camera(), Camera { projection: orthographic, ..camera() }] {
            let again = Camera::from_json(&camera.to_json()).expect("own file");
            assert_eq!(again.eye, camera.eye);
            match (again.projection, camera.projection) {
                (Projection::Perspective { fov_y: a }, Projection::Perspective { fov_y: b }) => {
                    assert!((a - b).abs() < 1e-15);
                }
                (a, b) => assert_eq!(a, b),
            }
        }
    }

    #[test]
    fn up_may_be_left_out_of_the_file() {
        let text = r#"{ "eye": [1, 2, 3], "target": [0, 0, 0], "fov_y_degrees": 60 }"#;
        assert_eq!(Camera::from_json(text).expect("valid").up, DVec3::Z);
    }

    #[test]
    fn impossible_cameras_are_refused() {
        let refused = |text: &str| Camera::from_json(text).expect_err(text).to_string();
        let with = |rest: &str| refused(&format!(r#"{{"eye":[1,0,0],"target":[0,0,0],{rest}}}"#));
        assert!(with(r#""fov_y_degrees":180"#).contains("below 180"));
        assert!(with(r#""fov_y_degrees":0"#).contains("above 0"));
        assert!(with(r#""orthographic_height":-1"#).contains("orthographic_height"));
        assert!(with(r#""fov_y_degrees":60,"orthographic_height":1"#).contains("either"));
        assert!(with(r#""up":[0,0,1]"#).contains("either"));
        assert!(with(r#""up":[0,0,0],"fov_y_degrees":60"#).contains("up is zero"));
        assert!(with(r#""fov":60"#).contains("unknown field"));
        let same = r#"{"eye":[1,0,0],"target":[1,0,0],"fov_y_degrees":60}"#;
        assert!(refused(same).contains("same place"));
    }

    #[test]
    fn overview_holds_the_whole_box_and_fills_the_picture_one_way() {
        let boxes = [
            (DVec3::new(635_577.0, 848_882.0, 406.0), DVec3::new(639_003.0, 853_537.0, 615.0)),
            (DVec3::splat(-1.0), DVec3::splat(1.0)),
            (DVec3::ZERO, DVec3::new(1e-3, 1e4, 0.0)),
            (DVec3::ZERO, DVec3::new(3.0, 2.0, 500.0)),
        ];
        for ((min, max), aspect) in boxes.into_iter().flat_map(|b| [(b, 0.5), (b, 16.0 / 9.0)]) {
            let camera = Camera::overview(min, max, aspect);
            let ViewBasis { right, up, forward } = camera.basis();
            let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
            for corner in 0..8 {
                let pick =
                    |axis: usize| if corner >> axis & 1 == 1 { max[axis] } else { min[axis] };
                let view = DVec3::new(pick(0), pick(1), pick(2)) - camera.eye;
                let distance = view.dot(forward);
                assert!(distance > 0.0);
                // Half heights of the picture.
                let scale = camera.pixels_per_world(distance, 2);
                let seen = scale * DVec2::new(view.dot(right) / aspect, view.dot(up));
                (low, high) = (low.min(seen), high.max(seen));
            }
            // Touches two opposite edges of the part to be filled, and lies within the others.
            let filled = |axis: usize| {
                (low[axis] + OVERVIEW_FILL).abs() < 1e-6
                    && (high[axis] - OVERVIEW_FILL).abs() < 1e-6
            };
            assert!(filled(0) || filled(1), "{low} to {high} for {min} {max}");
            assert!(low.x > -1.0 && low.y > -1.0 && high.x < 1.0 && high.y < 1.0);
        }
    }

    #[test]
    fn overview_of_one_point_is_a_camera() {
        for p in [DVec3::ZERO, DVec3::new(5e5, 5e6, 100.0), DVec3::splat(-1e9)] {
            Camera::overview(p, p, 1.5).check().expect("eye and target differ");
        }
    }
}
