//! The WGSL of lodestream, in small parts, and how they are put together.
//!
//! One part knows the camera, one the packed nodes, one each footprint, one each source of colour;
//! `splat.wgsl` joins them. A shader holds only the parts that its view needs: what is not drawn
//! is not compiled. WGSL has no includes, so that parts are joined as text; each name is declared
//! in one part, and parts that stand for one another (footprints, colours) declare the same names.

const CAMERA: &str = include_str!("camera.wgsl");
const NODE: &str = include_str!("node.wgsl");
const RAMPS: &str = include_str!("ramps.wgsl");
const SPLAT: &str = include_str!("splat.wgsl");

/// What a splat covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Footprint {
    /// The pixel that holds the centre.
    Point,
    /// A square facing the picture.
    Square,
    /// A circle facing the picture.
    Circle,
    /// A cone whose tip faces the picture.
    Cone,
    /// A paraboloid whose tip faces the picture.
    Paraboloid,
    /// The paraboloid as 8 triangles.
    Paraboloid8,
    /// The paraboloid as 16 triangles.
    Paraboloid16,
    /// The paraboloid as 32 triangles.
    Paraboloid32,
    /// The paraboloid as 48 triangles.
    Paraboloid48,
    /// A disc across the normal.
    Disc,
    /// An ellipse spanned by its half axes.
    Ellipse,
}

impl Footprint {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Point,
        Self::Square,
        Self::Circle,
        Self::Cone,
        Self::Paraboloid,
        Self::Paraboloid8,
        Self::Paraboloid16,
        Self::Paraboloid32,
        Self::Paraboloid48,
        Self::Disc,
        Self::Ellipse,
    ];

    /// Vertices on each ring of the meshes that stand for paraboloids, from the tip outwards; empty
    /// for what is no mesh. Ring `i` of `n` (from 1) has radius and depth `r = i / n`, `r²`, its
    /// first vertex to the right of the tip. The tip and the first ring are a fan; between two
    /// rings of equally many vertices each step is two triangles, between one and its double three.
    #[must_use]
    pub const fn rings(self) -> &'static [u32] {
        match self {
            Self::Paraboloid8 => &[8],
            Self::Paraboloid16 => &[4, 8],
            Self::Paraboloid32 => &[8, 16],
            Self::Paraboloid48 => &[8, 8, 16],
            _ => &[],
        }
    }

    const fn part(self) -> &'static str {
        match self {
            Self::Point => include_str!("footprint_point.wgsl"),
            Self::Square => include_str!("footprint_square.wgsl"),
            _ => include_str!("footprint_circle.wgsl"),
        }
    }
}

/// Where a splat's colour comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColorSource {
    /// 24 bits of payload: red, green, blue.
    Rgb,
    /// 8 bits of payload: a step of the intensity ramp.
    Intensity,
    /// The height, on the elevation ramp.
    Elevation,
    /// One colour for the node.
    Node,
}

impl ColorSource {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Rgb, Self::Intensity, Self::Elevation, Self::Node];

    /// Bits of colour payload in a record.
    #[must_use]
    pub const fn payload_bits(self) -> u8 {
        match self {
            Self::Rgb => 24,
            Self::Intensity => 8,
            Self::Elevation | Self::Node => 0,
        }
    }

    const fn parts(self) -> &'static [&'static str] {
        match self {
            Self::Rgb => &[include_str!("color_rgb.wgsl")],
            Self::Intensity => &[RAMPS, include_str!("color_intensity.wgsl")],
            Self::Elevation => &[RAMPS, include_str!("color_elevation.wgsl")],
            Self::Node => &[include_str!("color_node.wgsl")],
        }
    }
}

/// The WGSL that draws splats of one footprint and one source of colour. Entry points: `vertex`,
/// `fragment`.
#[must_use]
pub fn splat(footprint: Footprint, color: ColorSource) -> String {
    let mut parts = vec![CAMERA, NODE];
    parts.extend_from_slice(color.parts());
    parts.extend([footprint.part(), SPLAT]);
    parts.join("\n")
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;

    fn validate(source: &str) -> Result<naga::Module, String> {
        let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
        // No capabilities: every adapter must be able to run it.
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .map_err(|e| e.emit_to_string(source))?;
        Ok(module)
    }

    #[test]
    fn every_splat_shader_is_valid_wgsl() {
        for footprint in Footprint::ALL {
            for color in ColorSource::ALL {
                let module = validate(&splat(footprint, color))
                    .unwrap_or_else(|e| panic!("{footprint:?}, {color:?}: {e}"));
                let names: Vec<_> = module.entry_points.iter().map(|e| e.name.as_str()).collect();
                assert_eq!(names, ["fragment", "vertex"]);
            }
        }
    }

    #[test]
    fn a_shader_binds_nothing_that_its_view_does_not_use() {
        for footprint in Footprint::ALL {
            for color in ColorSource::ALL {
                let has_ramps = splat(footprint, color).contains("var<storage, read> ramps");
                let needs = matches!(color, ColorSource::Intensity | ColorSource::Elevation);
                assert_eq!(has_ramps, needs, "{color:?}");
            }
        }
    }

    #[test]
    fn the_validator_refuses_a_broken_shader() {
        let broken = splat(Footprint::Point, ColorSource::Rgb).replace("view.z", "view.q");
        assert!(validate(&broken).is_err());
    }
}
