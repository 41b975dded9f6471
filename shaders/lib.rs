//! The WGSL of lodestream, in small parts, and how they are put together.
//!
//! One part knows the camera, one the packed nodes, one each footprint, size, colour and shading. A
//! shader holds only the parts that its view needs: what is not drawn is not compiled. WGSL has no
//! includes, so that parts are joined as text; each name is declared in one part, and parts that
//! stand for one another (footprints, colours, …) declare the same names.

mod mesh;

use std::fmt::Write;

pub use mesh::Mesh;

/// Points of a chunk: a workgroup of the compute path, an instance of the raster path. Large enough
/// that few are drawn, small enough that the unused rest of a node's last chunk (on average half of
/// one) costs little beside a node's thousands of points; a multiple of 32, so that every chunk
/// of records starts at a word whatever the bits of a record.
pub const CHUNK_POINTS: usize = 256;

/// Joins parts, each a file of this folder without its ending.
macro_rules! parts {
    ($($name:literal),* $(,)?) => { [$(include_str!(concat!($name, ".wgsl"))),*].concat() };
}

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

    /// Whether splats lie in space instead of facing the picture.
    #[must_use]
    pub const fn is_oriented(self) -> bool {
        matches!(self, Self::Disc | Self::Ellipse)
    }

    /// Whether splats are triangles of their own.
    #[must_use]
    pub const fn is_mesh(self) -> bool {
        !self.rings().is_empty()
    }

    fn parts(self) -> String {
        match self {
            Self::Point => parts!("footprint_point"),
            Self::Square => parts!("footprint_square"),
            Self::Circle => parts!("receded_circle", "footprint_facing"),
            Self::Cone => parts!("receded_cone", "footprint_facing"),
            Self::Paraboloid => parts!("receded_paraboloid", "footprint_facing"),
            Self::Disc | Self::Ellipse => parts!("footprint_oriented"),
            Self::Paraboloid8 | Self::Paraboloid16 | Self::Paraboloid32 | Self::Paraboloid48 => {
                mesh_table(self) + include_str!("footprint_mesh.wgsl")
            }
        }
    }
}

/// The mesh as WGSL constants.
fn mesh_table(footprint: Footprint) -> String {
    let vertices = Mesh::of(footprint).map_or_else(Vec::new, |mesh| mesh.vertices);
    let count = vertices.len();
    let mut text =
        format!("const MESH_VERTICES = {count}u;\nconst MESH = array<vec4<f32>, {count}>(");
    for [x, y, z] in vertices {
        // A write to a string does not fail.
        let _ = write!(text, "vec4({x:.9}, {y:.9}, {z:.9}, 0.0), ");
    }
    text + ");\n"
}

/// Where a splat's colour comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColorSource {
    /// 24 bits of payload: red, green, blue.
    Rgb,
    /// 8 bits of payload: a step of the intensity ramp.
    Intensity,
    /// 8 bits of payload: a class of the LAS specification.
    Class,
    /// The normal.
    Normal,
    /// The height, on the elevation ramp.
    Elevation,
    /// One colour for the node.
    Node,
}

impl ColorSource {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Rgb, Self::Intensity, Self::Class, Self::Normal, Self::Elevation, Self::Node];

    /// Bits of colour payload in a record.
    #[must_use]
    pub const fn payload_bits(self) -> u8 {
        match self {
            Self::Rgb => 24,
            Self::Intensity | Self::Class => 8,
            Self::Normal | Self::Elevation | Self::Node => 0,
        }
    }

    fn parts(self) -> String {
        match self {
            Self::Rgb => parts!("color_rgb"),
            Self::Intensity => parts!("ramps", "color_intensity"),
            Self::Class => parts!("ramps", "color_class"),
            Self::Normal => parts!("color_normal"),
            Self::Elevation => parts!("ramps", "color_elevation"),
            Self::Node => parts!("color_node"),
        }
    }
}

/// What a record holds of a splat's size and shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ShapeField {
    /// Nothing.
    None,
    /// A radius: 16 bits.
    Radius,
    /// Two half axes: 96 bits.
    Axes,
}

impl ShapeField {
    /// Bits in a record.
    #[must_use]
    pub const fn bits(self) -> u8 {
        match self {
            Self::None => 0,
            Self::Radius => 16,
            Self::Axes => 96,
        }
    }
}

/// Where a splat's size comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum SizeSource {
    /// The same for all splats of a node.
    Node,
    /// A look-up in the visible tree.
    Adaptive,
    /// The record's [`ShapeField`].
    Record,
}

/// What the records of a node hold, and how they are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Splatting {
    /// What splats cover.
    pub footprint: Footprint,
    /// Where their colour comes from.
    pub color: ColorSource,
    /// Where their size comes from.
    pub size: SizeSource,
    /// Whether records hold normals: 24 bits.
    pub normals: bool,
    /// What records hold of shapes.
    pub shape: ShapeField,
    /// Whether light falls on them.
    pub phong: bool,
}

/// How splats end up on the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Blending {
    /// The nearest is seen.
    Nearest,
    /// Those close behind the nearest are summed up, weighted.
    Weighted,
}

/// How pixels of the compute path are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Pixels {
    /// One 64-bit number: needs 64-bit atomic maxima.
    Wide,
    /// Two 32-bit numbers, found in two passes.
    Narrow,
}

/// Constants of Phong's illumination.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Phong {
    /// Light that is everywhere.
    pub ambient: f64,
    /// Light by the angle to its source.
    pub diffuse: f64,
    /// Highlight.
    pub specular: f64,
    /// How small the highlight is.
    pub shininess: f64,
    /// To the light, in view space.
    pub to_light: [f64; 3],
}

impl Splatting {
    /// Whether the records tell normals, of themselves or by their axes.
    #[must_use]
    pub const fn has_normals(&self) -> bool {
        self.normals || matches!(self.shape, ShapeField::Axes)
    }

    /// The records: camera, nodes, and what is taken from them. `light` is used where there is any.
    fn surfels(&self, light: &Phong) -> String {
        let normal_bits = if self.normals { 24 } else { 0 };
        let mut text = format!(
            "const CHUNK_POINTS = {CHUNK_POINTS}u;\nconst COLOR_BITS = {}u;\n\
             const NORMAL_BITS = {normal_bits}u;\nconst SHAPE_BITS = {}u;\n",
            self.color.payload_bits(),
            self.shape.bits()
        );
        text += &parts!("camera", "node");
        if self.shape == ShapeField::Axes {
            text += include_str!("axes.wgsl");
        }
        if self.normals {
            text += include_str!("normal.wgsl");
        } else if self.shape == ShapeField::Axes {
            text += include_str!("normal_of_axes.wgsl");
        }
        text += &self.color.parts();
        if self.phong && self.has_normals() {
            let Phong { ambient, diffuse, specular, shininess, to_light: [x, y, z] } = light;
            // A write to a string does not fail.
            let _ = write!(
                text,
                "const PHONG_AMBIENT = {ambient:?};\nconst PHONG_DIFFUSE = {diffuse:?};\n\
                 const PHONG_SPECULAR = {specular:?};\nconst PHONG_SHININESS = {shininess:?};\n\
                 const PHONG_TO_LIGHT = vec3<f32>({x:?}, {y:?}, {z:?});\n"
            );
            text += include_str!("phong.wgsl");
        } else {
            text += include_str!("unshaded.wgsl");
        }
        text
    }

    /// Surfels with their sizes, shapes and footprint.
    fn shapes(&self, light: &Phong) -> String {
        let mut text = self.surfels(light);
        text += match (self.size, self.shape) {
            (SizeSource::Adaptive, _) => include_str!("size_adaptive.wgsl"),
            (SizeSource::Record, ShapeField::Radius) => include_str!("size_radius.wgsl"),
            (SizeSource::Record, ShapeField::Axes) => include_str!("size_axes.wgsl"),
            (SizeSource::Record, ShapeField::None) | (SizeSource::Node, _) => {
                include_str!("size_node.wgsl")
            }
        };
        text += include_str!("splat.wgsl");
        if self.footprint.is_oriented() {
            text += include_str!("disc.wgsl");
            text += match (self.footprint, self.shape) {
                (Footprint::Ellipse, ShapeField::Axes) => include_str!("orientation_axes.wgsl"),
                _ if self.has_normals() => include_str!("orientation_normal.wgsl"),
                _ => include_str!("orientation_none.wgsl"),
            };
        } else if !self.footprint.is_mesh() {
            text += include_str!("orientation_facing.wgsl");
        }
        text += &self.footprint.parts();
        if !self.footprint.is_mesh() {
            text += include_str!("shape.wgsl");
        }
        text
    }

    /// The WGSL of the raster path. Entry points: `vertex`, `fragment`.
    #[must_use]
    pub fn raster(&self, blending: Blending, light: &Phong) -> String {
        let mut text = self.shapes(light);
        text += &match self.footprint {
            Footprint::Point => parts!("raster_point", "raster"),
            Footprint::Square => parts!("raster_square", "raster"),
            Footprint::Circle | Footprint::Cone | Footprint::Paraboloid => {
                parts!("raster_facing", "raster")
            }
            Footprint::Disc | Footprint::Ellipse => parts!("raster_oriented", "raster"),
            Footprint::Paraboloid8
            | Footprint::Paraboloid16
            | Footprint::Paraboloid32
            | Footprint::Paraboloid48 => parts!("raster_mesh"),
        };
        text += match (blending, self.footprint) {
            (Blending::Weighted, _) => include_str!("fragment_blended.wgsl"),
            (_, Footprint::Circle) => include_str!("fragment_cut.wgsl"),
            (_, Footprint::Cone | Footprint::Paraboloid | Footprint::Disc | Footprint::Ellipse) => {
                include_str!("fragment_deep.wgsl")
            }
            _ => include_str!("fragment_whole.wgsl"),
        };
        text
    }

    /// The WGSL that finds the nearest point of every pixel; for footprints that are no meshes.
    /// Entry point: `rasterise`.
    #[must_use]
    pub fn compute(&self, pixels: Pixels, light: &Phong) -> String {
        let offer = match pixels {
            Pixels::Wide => include_str!("offer64.wgsl"),
            Pixels::Narrow => include_str!("offer32.wgsl"),
        };
        self.shapes(light) + self.cover() + include_str!("compute.wgsl") + offer
    }

    /// The WGSL that counts the points of every pixel. Entry point: `rasterise`.
    #[must_use]
    pub fn count(&self, light: &Phong) -> String {
        self.shapes(light) + self.cover() + &parts!("compute", "offer_count")
    }

    const fn cover(&self) -> &'static str {
        match self.footprint {
            Footprint::Point => include_str!("cover_point.wgsl"),
            _ => include_str!("cover_box.wgsl"),
        }
    }

    /// The WGSL that colours what [`compute`](Self::compute) found. Entry points: `full`,
    /// `fragment`.
    #[must_use]
    pub fn resolve(&self, pixels: Pixels, light: &Phong) -> String {
        let found = match pixels {
            Pixels::Wide => include_str!("found64.wgsl"),
            Pixels::Narrow => include_str!("found32.wgsl"),
        };
        self.surfels(light) + include_str!("full.wgsl") + found + include_str!("resolve.wgsl")
    }
}

/// The WGSL that divides blended sums by their weights. Entry points: `full`, `fragment`.
#[must_use]
pub fn normalised() -> String {
    parts!("full", "normalised")
}

/// The WGSL of eye-dome lighting. Entry points: `full`, `fragment`.
#[must_use]
pub fn eye_dome() -> String {
    parts!("full", "eye_dome")
}

/// The WGSL of the heat map. Entry points: `full`, `fragment`.
#[must_use]
pub fn density() -> String {
    parts!("ramps", "full", "density")
}

/// The WGSL that finds the greatest count of points on a pixel. Entry point: `find_most`.
#[must_use]
pub fn most() -> String {
    parts!("most")
}

#[cfg(test)]
mod tests {
    use naga::valid::{Capabilities, ValidationFlags, Validator};

    use super::*;

    const LIGHT: Phong = Phong {
        ambient: 0.5,
        diffuse: 0.5,
        specular: 1.0,
        shininess: 8.0,
        to_light: [0.0, 0.0, -1.0],
    };

    /// Nothing but what the renderer refuses adapters without, unless `capabilities` says so.
    fn validate(source: &str, capabilities: Capabilities) -> Result<Vec<String>, String> {
        let capabilities = capabilities | Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
        Validator::new(ValidationFlags::all(), capabilities)
            .validate(&module)
            .map_err(|e| e.emit_to_string(source))?;
        Ok(module.entry_points.iter().map(|e| e.name.clone()).collect())
    }

    /// Ways to draw: every footprint with every size, normal, shape and light, colours taking turns
    /// (parts that know of one another meet; all products would take minutes).
    fn all() -> Vec<Splatting> {
        let mut all = Vec::new();
        let mut turn = 0;
        for footprint in Footprint::ALL {
            for size in [SizeSource::Node, SizeSource::Adaptive, SizeSource::Record] {
                for normals in [false, true] {
                    for shape in [ShapeField::None, ShapeField::Radius, ShapeField::Axes] {
                        // Another one for the same normals and shape the next time.
                        let color = ColorSource::ALL[(turn + turn / 6) % 6];
                        turn += 1;
                        for phong in [false, true] {
                            let mut way =
                                Splatting { footprint, color, size, normals, shape, phong };
                            if color == ColorSource::Normal && !way.has_normals() {
                                way.color = ColorSource::Node;
                            }
                            all.push(way);
                        }
                    }
                }
            }
        }
        for color in ColorSource::ALL {
            assert!(all.iter().any(|way| way.color == color && way.phong), "{color:?}");
        }
        all
    }

    #[track_caller]
    fn assert_valid(source: &str, capabilities: Capabilities, entries: &[&str], what: &str) {
        let found = validate(source, capabilities).unwrap_or_else(|e| panic!("{what}: {e}"));
        let mut found: Vec<_> = found.iter().map(String::as_str).collect();
        found.sort_unstable();
        assert_eq!(found, entries, "{what}");
    }

    #[test]
    fn every_shader_is_valid_wgsl() {
        let none = Capabilities::empty();
        let wide = Capabilities::SHADER_INT64 | Capabilities::SHADER_INT64_ATOMIC_MIN_MAX;
        for way in all() {
            let what = format!("{way:?}");
            let raster = ["fragment", "vertex"];
            assert_valid(&way.raster(Blending::Nearest, &LIGHT), none, &raster, &what);
            if matches!(way.footprint, Footprint::Circle | Footprint::Disc | Footprint::Ellipse) {
                assert_valid(&way.raster(Blending::Weighted, &LIGHT), none, &raster, &what);
            }
            if way.footprint.is_mesh() {
                continue;
            }
            let full = ["fragment", "full"];
            assert_valid(&way.compute(Pixels::Wide, &LIGHT), wide, &["rasterise"], &what);
            assert_valid(&way.compute(Pixels::Narrow, &LIGHT), none, &["rasterise"], &what);
            assert_valid(&way.count(&LIGHT), none, &["rasterise"], &what);
            assert_valid(&way.resolve(Pixels::Wide, &LIGHT), none, &full, &what);
            assert_valid(&way.resolve(Pixels::Narrow, &LIGHT), none, &full, &what);
        }
        for (source, name) in
            [(normalised(), "normalised"), (eye_dome(), "eye_dome"), (density(), "density")]
        {
            assert_valid(&source, none, &["fragment", "full"], name);
        }
        assert_valid(&most(), none, &["find_most"], "most");
    }

    #[test]
    fn a_shader_binds_nothing_that_its_view_does_not_use() {
        for way in all() {
            let source = way.raster(Blending::Nearest, &LIGHT);
            let ramps = matches!(
                way.color,
                ColorSource::Intensity | ColorSource::Class | ColorSource::Elevation
            );
            assert_eq!(source.contains("var<storage, read> ramps"), ramps, "{way:?}");
            let tree = way.size == SizeSource::Adaptive;
            assert_eq!(source.contains("var<storage, read> tree"), tree, "{way:?}");
            let light = way.phong && way.has_normals();
            assert_eq!(source.contains("PHONG_AMBIENT"), light, "{way:?}");
        }
    }

    #[test]
    fn the_validator_refuses_a_broken_shader() {
        let way = all()[0];
        let broken = way.raster(Blending::Nearest, &LIGHT).replace("view.z", "view.q");
        assert!(validate(&broken, Capabilities::empty()).is_err());
    }
}
