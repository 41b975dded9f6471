//! Light.

use std::str::FromStr;

/// How light falls on what is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shading {
    /// Phong's illumination by one light that stands above the eye and to its left, far away. Points
    /// without a normal keep their colour. (Radner 2018, 4.5)
    pub phong: bool,
    /// Eye-dome lighting, on top of it.
    pub eye_dome: Option<EyeDome>,
}

/// Eye-dome lighting: a pixel is darker the farther it lies behind those around it, which needs no
/// normals. (Boucheny 2009, as Fraiss 2017, 5 and Radner 2018, 4.5 ask)
///
/// With `z` the distance along the view direction, a pixel's step behind a neighbour `radius_px`
/// away is `ln(z / z_neighbour)` times the pixels per world unit at distance 1 in a perspective
/// view, `z - z_neighbour` times the pixels per world unit in an orthographic one: both are the
/// step in pixels. The shade is `exp(-strength * m)` with `m` the mean over eight neighbours
/// of `max(0, step) / radius_px`, at most 4 each: a step that looks as deep as it is wide
/// has the same shade at any distance, picture size and projection. Neighbours that are outside of
/// the picture or empty count as no step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EyeDome {
    /// 0 for none; 0.4 is moderate.
    pub strength: f64,
    /// Distance of the neighbours, 1 to [`EyeDome::LARGEST_RADIUS_PX`] pixels.
    pub radius_px: f64,
}

impl EyeDome {
    /// Most pixels to a neighbour.
    pub const LARGEST_RADIUS_PX: f64 = 32.0;

    /// A neighbour's step counts at most so many times the distance to it: what is far behind a
    /// silhouette is no darker than what is well behind it.
    pub const STEEPEST: f64 = 4.0;

    /// Whole pixels to the eight neighbours.
    #[must_use]
    pub fn neighbours(&self, samples: u32) -> [[i32; 2]; 8] {
        let radius = self.radius_px * f64::from(samples);
        std::array::from_fn(|i| {
            let (sin, cos) = (i as f64 * std::f64::consts::FRAC_PI_4).sin_cos();
            [cos, sin].map(|c| (c * radius).round() as i32)
        })
    }
}

impl Default for EyeDome {
    fn default() -> Self {
        Self { strength: 0.4, radius_px: 1.5 }
    }
}

/// Phong's illumination: `color * (AMBIENT + DIFFUSE * n·l) + SPECULAR * (r·v)^SHININESS`, the
/// normal turned to the eye. The constants are chosen for scans' own colours, which have light in
/// them already, and so are brighter and duller than those of Radner's listing 4.2.
pub(crate) mod phong {
    /// Light that is everywhere.
    pub const AMBIENT: f64 = 0.35;
    /// Light by the angle to the source.
    pub const DIFFUSE: f64 = 0.65;
    /// Highlight.
    pub const SPECULAR: f64 = 0.15;
    /// How small the highlight is.
    pub const SHININESS: f64 = 32.0;
    /// To the light in view space (x right, y up, z into the picture); a unit vector.
    pub const TO_LIGHT: [f64; 3] = [-0.36, 0.48, -0.8];
}

impl Shading {
    /// Whether the numbers are those of a shading.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn check(&self) -> Result<(), String> {
        let Some(EyeDome { strength, radius_px }) = self.eye_dome else { return Ok(()) };
        if !(strength >= 0.0 && strength.is_finite()) {
            return Err(format!("eye-dome strength {strength}: must be 0 or more"));
        }
        let largest = EyeDome::LARGEST_RADIUS_PX;
        if !(1.0..=largest).contains(&radius_px) {
            return Err(format!("eye-dome radius of {radius_px} pixels: must be 1 to {largest}"));
        }
        Ok(())
    }
}

impl FromStr for Shading {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let eye_dome = Some(EyeDome::default());
        match text {
            "none" => Ok(Self::default()),
            "phong" => Ok(Self { phong: true, eye_dome: None }),
            "edl" => Ok(Self { phong: false, eye_dome }),
            "phong+edl" => Ok(Self { phong: true, eye_dome }),
            _ => Err("expected none, phong, edl (eye-dome lighting) or phong+edl".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_are_around_the_pixel() {
        let near = EyeDome { strength: 1.0, radius_px: 1.0 }.neighbours(1);
        assert_eq!(near, [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]]);
        assert_eq!(EyeDome { strength: 1.0, radius_px: 3.0 }.neighbours(2)[0], [6, 0]);
    }

    #[test]
    fn impossible_numbers_are_refused() {
        let with = |strength, radius_px| Shading {
            phong: false,
            eye_dome: Some(EyeDome { strength, radius_px }),
        };
        assert!(with(1.0, 2.0).check().is_ok());
        for (strength, radius) in [(-1.0, 2.0), (f64::NAN, 2.0), (1.0, 0.0), (1.0, 1e9)] {
            assert!(with(strength, radius).check().is_err());
        }
    }

    #[test]
    fn the_light_is_a_direction() {
        let [x, y, z] = phong::TO_LIGHT;
        assert!((x * x + y * y + z * z - 1.0).abs() < 1e-12);
    }
}
