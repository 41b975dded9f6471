//! What a picture is to look like.

mod color;
mod reach;
mod shading;
mod size;
mod splat;

pub use color::ColorMode;
pub(crate) use shading::phong;
pub use shading::{EyeDome, Shading};
pub(crate) use size::CLOSED_SURFACE;
pub use size::{LARGEST_SPLAT_PX, SMALLEST_SPLAT_PX, SizeLimits, SplatSize};
pub use splat::Splat;

use lodestream_protocol::Manifest;

use crate::{
    camera::Camera,
    render::{Coloring, RenderError, surface::SurfaceParts},
};

/// Most pixels along one side of a picture, for every renderer.
pub const LARGEST_SIDE_PX: u32 = 16_384;

/// What a picture is to look like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RenderSettings {
    /// Width and height, 1 to [`LARGEST_SIDE_PX`] each.
    pub size_px: [u32; 2],
    /// The view.
    pub camera: Camera,
    /// What a point covers.
    pub splat: Splat,
    /// How large it is.
    pub splat_size: SplatSize,
    /// Between which sizes it stays.
    pub size_limits: SizeLimits,
    /// Where its colour comes from.
    pub color: ColorMode,
    /// How light falls on it.
    pub shading: Shading,
    /// Red, green, blue where nothing is drawn.
    pub background: [u8; 3],
}

impl RenderSettings {
    /// The view of `camera`: circles of three pixels in their own colours, unshaded, on white.
    #[must_use]
    pub fn new(size_px: [u32; 2], camera: Camera) -> Self {
        Self {
            size_px,
            camera,
            splat: Splat::Circle,
            splat_size: SplatSize::Pixels(3.0),
            size_limits: SizeLimits::default(),
            color: ColorMode::Rgb,
            shading: Shading::default(),
            background: [255; 3],
        }
    }

    /// Whether the numbers can be those of a picture.
    ///
    /// # Errors
    /// [`RenderError::Settings`] says which cannot.
    pub fn check(&self) -> Result<(), RenderError> {
        let [width, height] = self.size_px;
        if !(1..=LARGEST_SIDE_PX).contains(&width) || !(1..=LARGEST_SIDE_PX).contains(&height) {
            return Err(RenderError::Settings(format!(
                "a picture of {width}x{height} pixels: each side must be 1 to {LARGEST_SIDE_PX}"
            )));
        }
        self.camera.check().map_err(|e| RenderError::Settings(e.to_string()))?;
        self.splat_size.check().map_err(RenderError::Settings)?;
        self.size_limits.check().map_err(RenderError::Settings)?;
        self.shading.check().map_err(RenderError::Settings)
    }

    /// Width over height.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.size_px[0]) / f64::from(self.size_px[1])
    }

    /// Indices of the attributes of a cloud that its picture is made of.
    #[must_use]
    pub fn attributes(&self, cloud: &Manifest) -> Vec<usize> {
        let index = |name| cloud.attributes.iter().position(|a| a.name == name);
        let coloring = Coloring::of(self.color, cloud).attribute();
        let surface = SurfaceParts::of(self, cloud).attributes().filter_map(index);
        let mut attributes: Vec<_> = coloring.into_iter().chain(surface).collect();
        attributes.sort_unstable();
        attributes.dedup();
        attributes
    }

    /// Their names.
    #[must_use]
    pub fn attribute_names(&self, cloud: &Manifest) -> Vec<String> {
        let attributes = self.attributes(cloud).into_iter();
        attributes.map(|index| cloud.attributes[index].name.clone()).collect()
    }

    /// Column groups of a cloud beyond the first that its picture needs.
    #[must_use]
    pub fn groups(&self, cloud: &Manifest) -> Vec<usize> {
        let attributes = self.attributes(cloud).into_iter();
        let groups = attributes.filter_map(|a| cloud.attributes.get(a)?.group());
        let mut groups: Vec<_> = groups.filter(|group| *group != 0).collect();
        groups.sort_unstable();
        groups.dedup();
        groups
    }
}
