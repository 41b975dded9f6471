//! What pictures look like, as the command line says it.

use clap::{Args, builder::PossibleValuesParser, builder::TypedValueParser};

use crate::{
    camera::Camera,
    render::{ColorMode, EyeDome, GpuPath, RenderSettings, Shading, SizeLimits, Splat, SplatSize},
};

/// Behind the points: dark, but not black, so that dark points are seen.
const BACKGROUND: [u8; 3] = [18, 18, 24];

/// What pictures look like.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Appearance")]
pub struct Appearance {
    /// What a point covers: one pixel; a square, circle, cone or paraboloid that faces the picture
    /// (the last also as so many triangles); a disc or ellipse that lies on the surface, where
    /// points have normals or axes; or the mean of overlapping circles, discs or ellipses
    #[arg(long, value_name = "SPLAT", default_value = "circle", value_parser = splats())]
    pub splat: Splat,
    /// How large it is: in pixels (2px), in world units (0.05w), by the spacing of its node (level,
    /// or level:1.5 times that), by the detail drawn around it (adaptive, adaptive:1.5), or as the
    /// points say (own)
    #[arg(long, value_name = "SIZE", default_value = "2px")]
    pub splat_size: SplatSize,
    /// No splat is smaller
    #[arg(long, value_name = "PIXELS", default_value_t = SizeLimits::default().min_px)]
    pub min_splat: f64,
    /// No splat is larger
    #[arg(long, value_name = "PIXELS", default_value_t = SizeLimits::default().max_px)]
    pub max_splat: f64,
    /// Where colours come from; density counts the points of each pixel
    #[arg(long, value_name = "COLOR", default_value = "rgb", value_parser = colors())]
    pub color: ColorMode,
    /// How light falls: not at all, on normals (phong), by steps of depth (edl: eye-dome lighting),
    /// or both
    #[arg(long, value_name = "none|phong|edl|phong+edl", default_value = "none")]
    pub shading: Shading,
    /// How dark eye-dome lighting is, from 0
    #[arg(long, value_name = "NUMBER", default_value_t = EyeDome::default().strength)]
    pub edl_strength: f64,
    /// How far eye-dome lighting looks around, 1 to 32
    #[arg(long, value_name = "PIXELS", default_value_t = EyeDome::default().radius_px)]
    pub edl_radius: f64,
    /// How the GPU draws splats: by its rasteriser, by compute, or by the faster of both; the
    /// picture is the same
    #[arg(long, value_name = "auto|raster|compute", default_value = "auto")]
    pub gpu_path: GpuPath,
}

pub(super) fn splats() -> impl TypedValueParser<Value = Splat> {
    let names = Splat::ALL.map(|(_, name)| name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<Splat>())
}

pub(super) fn colors() -> impl TypedValueParser<Value = ColorMode> {
    let names = ColorMode::ALL.map(ColorMode::name);
    PossibleValuesParser::new(names).try_map(|name| name.parse::<ColorMode>())
}

impl Appearance {
    /// A picture of that size and view.
    ///
    /// # Errors
    /// Where the numbers cannot be those of a picture.
    pub fn settings(&self, size_px: [u32; 2], camera: Camera) -> anyhow::Result<RenderSettings> {
        let eye_dome = self
            .shading
            .eye_dome
            .map(|_| EyeDome { strength: self.edl_strength, radius_px: self.edl_radius });
        let settings = RenderSettings {
            splat: self.splat,
            splat_size: self.splat_size,
            size_limits: SizeLimits { min_px: self.min_splat, max_px: self.max_splat },
            color: self.color,
            shading: Shading { eye_dome, ..self.shading },
            background: BACKGROUND,
            ..RenderSettings::new(size_px, camera)
        };
        settings.check()?;
        Ok(settings)
    }
}
