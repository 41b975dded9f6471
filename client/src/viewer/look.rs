//! What pictures look like, as it is kept in files and shown in the panel.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use crate::{
    camera::Camera,
    render::{
        ColorMode, EyeDome, RenderError, RenderSettings, Shading, SizeLimits, Splat, SplatSize,
    },
};

/// What pictures look like, but for the camera and the size.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Look {
    /// What a point covers.
    #[serde(with = "written")]
    pub splat: Splat,
    /// How large it is.
    #[serde(with = "written")]
    pub splat_size: SplatSize,
    /// No splat is smaller.
    pub min_splat_px: f64,
    /// No splat is larger.
    pub max_splat_px: f64,
    /// Where colours come from, for clouds that have no colouring of their own.
    #[serde(with = "written")]
    pub color: ColorMode,
    /// Whether light falls on normals.
    pub phong: bool,
    /// Whether steps of depth are darkened.
    pub eye_dome: bool,
    /// How dark they are.
    pub edl_strength: f64,
    /// How far eye-dome lighting looks around, in pixels.
    pub edl_radius_px: f64,
}

impl Default for Look {
    /// Circles that close the surface as it comes, but never hide how fine it is.
    fn default() -> Self {
        let dome = EyeDome::default();
        Self {
            splat: Splat::Circle,
            splat_size: SplatSize::Adaptive(1.6),
            min_splat_px: 2.0,
            max_splat_px: 8.0,
            color: ColorMode::Rgb,
            phong: false,
            eye_dome: false,
            edl_strength: dome.strength,
            edl_radius_px: dome.radius_px,
        }
    }
}

impl Look {
    /// The settings of a picture.
    #[must_use]
    pub fn settings(
        &self,
        size_px: [u32; 2],
        camera: Camera,
        background: [u8; 3],
    ) -> RenderSettings {
        let dome = EyeDome { strength: self.edl_strength, radius_px: self.edl_radius_px };
        RenderSettings {
            splat: self.splat,
            splat_size: self.splat_size,
            size_limits: SizeLimits { min_px: self.min_splat_px, max_px: self.max_splat_px },
            color: self.color,
            shading: Shading { phong: self.phong, eye_dome: self.eye_dome.then_some(dome) },
            background,
            ..RenderSettings::new(size_px, camera)
        }
    }

    /// Whether the numbers can be those of pictures.
    ///
    /// # Errors
    /// [`RenderError::Settings`] says which cannot.
    pub fn check(&self) -> Result<(), RenderError> {
        let camera = Camera::overview(glam::DVec3::ZERO, glam::DVec3::ONE, 1.0);
        // Even what is switched off must be possible: it may be switched on.
        Self { eye_dome: true, ..*self }.settings([1, 1], camera, [0; 3]).check()
    }

    /// How light falls, as the command line says it.
    #[must_use]
    pub const fn shading_name(&self) -> &'static str {
        match (self.phong, self.eye_dome) {
            (false, false) => "none",
            (true, false) => "phong",
            (false, true) => "edl",
            (true, true) => "phong+edl",
        }
    }
}

/// What is written as the command line writes it.
pub trait Written: FromStr<Err = String> {
    /// The text.
    fn written(&self) -> String;
}

impl Written for Splat {
    fn written(&self) -> String {
        self.name().into()
    }
}

impl Written for SplatSize {
    fn written(&self) -> String {
        self.to_string()
    }
}

impl Written for ColorMode {
    fn written(&self) -> String {
        self.name().into()
    }
}

/// For `#[serde(with)]`.
pub mod written {
    use super::*;

    /// Writes it as the command line does.
    pub fn serialize<T: Written, S: Serializer>(value: &T, out: S) -> Result<S::Ok, S::Error> {
        out.serialize_str(&value.written())
    }

    /// Reads it as the command line does.
    pub fn deserialize<'de, T: Written, D: Deserializer<'de>>(input: D) -> Result<T, D::Error> {
        let text = String::deserialize(input)?;
        text.parse().map_err(|why| D::Error::custom(format!("{text:?}: {why}")))
    }
}

/// The same where there may be none.
pub mod written_option {
    use super::*;

    /// Writes it as the command line does.
    pub fn serialize<T: Written, S: Serializer>(
        value: &Option<T>,
        out: S,
    ) -> Result<S::Ok, S::Error> {
        value.as_ref().map(Written::written).serialize(out)
    }

    /// Reads it as the command line does.
    pub fn deserialize<'de, T: Written, D: Deserializer<'de>>(
        input: D,
    ) -> Result<Option<T>, D::Error> {
        let text = Option::<String>::deserialize(input)?;
        let parse =
            |text: String| text.parse().map_err(|why| D::Error::custom(format!("{text:?}: {why}")));
        text.map(parse).transpose()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_is_read_as_it_is_written() {
        let look = Look {
            splat: Splat::BlendedDisc,
            splat_size: SplatSize::Adaptive(1.5),
            color: ColorMode::Classification,
            eye_dome: true,
            ..Look::default()
        };
        let text = serde_json::to_string(&look).expect("JSON");
        assert!(text.contains(r#""splat":"blended-disc""#), "{text}");
        assert_eq!(serde_json::from_str::<Look>(&text).expect("own text"), look);
        assert_eq!(serde_json::from_str::<Look>("{}").expect("defaults"), Look::default());
    }

    #[test]
    fn what_is_no_look_is_refused_by_name() {
        let said = |text: &str| serde_json::from_str::<Look>(text).expect_err(text).to_string();
        assert!(said(r#"{"splat":"blob"}"#).contains("blob"));
        assert!(said(r#"{"colour":"rgb"}"#).contains("colour"));
        let bad = Look { edl_strength: f64::NAN, ..Look::default() };
        assert!(bad.check().is_err());
        assert!(Look { min_splat_px: 9.0, max_splat_px: 2.0, ..Look::default() }.check().is_err());
    }
}
