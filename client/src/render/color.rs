//! From attributes to colours, for one cloud: the one place that both renderers ask.

use glam::DVec3;
use lodestream_protocol::{Attribute, Lattice, Manifest, NodePoints, ScalarType};

use crate::render::{ramp::Ramp, scene::Surroundings, settings::ColorMode, surface::NodeSurface};

/// Colour of points whose cloud has nothing to colour them by.
pub(crate) const NEUTRAL: [u8; 3] = [200; 3];

/// Where the colours of one cloud come from.
///
/// A cloud without the attribute that a [`ColorMode`] names is coloured by the next best it has:
/// `Rgb` falls back to `Intensity`; `Intensity`, `Classification` and `Normal` to `Elevation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coloring {
    /// Per point: red, green, blue of an attribute.
    Rgb {
        /// Index into [`Manifest::attributes`].
        attribute: usize,
        /// Type of a component: `U8`, or `U16` with `shift`.
        scalar: ScalarType,
        /// Bits that a component is shifted right to give 8: 0 where 16-bit fields hold 8-bit
        /// values, as many scanners write them.
        shift: u8,
    },
    /// Per point: an attribute's first component on the intensity ramp.
    Intensity {
        /// Index into [`Manifest::attributes`].
        attribute: usize,
        /// Type of a component.
        scalar: ScalarType,
        /// Bytes of a value, all components.
        value_bytes: usize,
        /// Value at the ramp's dark end.
        min: f64,
        /// Value at the ramp's light end.
        max: f64,
    },
    /// Per point: an attribute's first component is a class of the LAS specification.
    Classification {
        /// Index into [`Manifest::attributes`].
        attribute: usize,
        /// Type of a component.
        scalar: ScalarType,
        /// Bytes of a value, all components.
        value_bytes: usize,
    },
    /// Per point: by the direction of its normal.
    Normal,
    /// By height.
    Elevation,
    /// By the node's level.
    Level,
    /// By how many points fall on a pixel.
    Density,
    /// The same for all points of the cloud.
    Constant([u8; 3]),
}

impl Coloring {
    /// How a cloud is coloured in `mode`.
    #[must_use]
    pub fn of(mode: ColorMode, manifest: &Manifest) -> Self {
        match mode {
            ColorMode::Rgb => Self::rgb(manifest).or_else(|| Self::intensity(manifest)),
            ColorMode::Intensity => Self::intensity(manifest),
            ColorMode::Classification => Self::classification(manifest),
            ColorMode::Normal => has_normals(manifest).then_some(Self::Normal),
            ColorMode::Density => Some(Self::Density),
            ColorMode::Elevation => Some(Self::Elevation),
            ColorMode::Level => Some(Self::Level),
        }
        .unwrap_or(Self::Elevation)
    }

    fn rgb(manifest: &Manifest) -> Option<Self> {
        let (index, attribute) = find(manifest, ColorMode::Rgb)?;
        if attribute.components != 3 {
            return None;
        }
        let largest = attribute.max.iter().copied().fold(f64::NAN, f64::max);
        let shift = match attribute.scalar {
            ScalarType::U8 => 0,
            ScalarType::U16 if largest <= 255.0 => 0,
            ScalarType::U16 => 8,
            _ => return None,
        };
        let scalar = attribute.scalar;
        let coloring = Self::Rgb { attribute: index, scalar, shift };
        Some(match attribute.constant() {
            Some(value) => Self::Constant(rgb_at(&value, 0, scalar, shift)),
            None => coloring,
        })
    }

    fn intensity(manifest: &Manifest) -> Option<Self> {
        let (attribute, info) = find(manifest, ColorMode::Intensity)?;
        let (min, max) = (*info.min.first()?, *info.max.first()?);
        Some(match info.constant() {
            Some(_) => Self::Constant(NEUTRAL),
            None => {
                let (scalar, value_bytes) = (info.scalar, info.value_bytes());
                Self::Intensity { attribute, scalar, value_bytes, min, max }
            }
        })
    }

    fn classification(manifest: &Manifest) -> Option<Self> {
        let (attribute, info) = find(manifest, ColorMode::Classification)?;
        let (scalar, value_bytes) = (info.scalar, info.value_bytes());
        Some(match info.constant() {
            Some(class) => Self::Constant(class_color(scalar.to_f64(&class))),
            None => Self::Classification { attribute, scalar, value_bytes },
        })
    }

    /// The attribute that this colouring reads per point, if it does. Normals are not counted: they
    /// are [of the surface](crate::render::RenderSettings::attributes).
    #[must_use]
    pub const fn attribute(&self) -> Option<usize> {
        match self {
            Self::Rgb { attribute, .. }
            | Self::Intensity { attribute, .. }
            | Self::Classification { attribute, .. } => Some(*attribute),
            Self::Normal | Self::Elevation | Self::Level | Self::Density | Self::Constant(_) => {
                None
            }
        }
    }

    /// The colouring, for a user.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Rgb { .. } => "rgb",
            Self::Intensity { .. } => "intensity",
            Self::Classification { .. } => "classification",
            Self::Normal => "normal",
            Self::Elevation => "elevation",
            Self::Level => "level",
            Self::Density => "density",
            Self::Constant(_) => "constant",
        }
    }

    /// Whether the cloud lacks what `mode` asks for, and this is the next best.
    #[must_use]
    pub const fn falls_back(&self, mode: ColorMode) -> bool {
        matches!(
            (self, mode),
            (Self::Intensity { .. } | Self::Elevation, ColorMode::Rgb)
                | (
                    Self::Elevation,
                    ColorMode::Intensity | ColorMode::Classification | ColorMode::Normal
                )
        )
    }
}

fn has_normals(manifest: &Manifest) -> bool {
    let has = |name| manifest.attribute(name).is_some_and(|a| a.components == 3);
    has("normal") || (has("axis_u") && has("axis_v"))
}

/// The colour of a class: beyond 255 there are none.
fn class_color(class: f64) -> [u8; 3] {
    // The cast saturates, and takes NaN for 0.
    Ramp::Class.color(class as u8)
}

/// The colour of a direction.
fn direction_color(normal: Option<DVec3>) -> [u8; 3] {
    let byte = |c: f64| ((0.5 * c + 0.5) * 255.0).round() as u8;
    normal.map_or(NEUTRAL, |n| n.to_array().map(byte))
}

/// The attribute that a mode needs, with its index.
fn find(manifest: &Manifest, mode: ColorMode) -> Option<(usize, &Attribute)> {
    let name = mode.attribute()?;
    manifest.attributes.iter().enumerate().find(|(_, a)| a.name == name)
}

/// The colours of one node's points, before they are looked up.
#[derive(Debug, Clone, Copy)]
pub(crate) enum NodeColor<'a> {
    /// A column of red, green, blue.
    Rgb { column: &'a [u8], scalar: ScalarType, shift: u8 },
    /// A column of values for the intensity ramp.
    Intensity { column: &'a [u8], scalar: ScalarType, value_bytes: usize, min: f64, max: f64 },
    /// A column of classes.
    Class { column: &'a [u8], scalar: ScalarType, value_bytes: usize },
    /// By the normals.
    Normal(NodeSurface<'a>),
    /// Place on the elevation ramp of the node's lowest corner, and the rise per lattice unit.
    Elevation { at_corner: f64, per_unit: f64 },
    /// The same for all points.
    Constant([u8; 3]),
}

impl<'a> NodeColor<'a> {
    /// The colours of a node of cloud `cloud`. A node that lacks the column (its group was not
    /// fetched) is neutral.
    pub fn of(
        around: &Surroundings,
        cloud: usize,
        lattice: &Lattice,
        points: &'a NodePoints,
        surface: &NodeSurface<'a>,
    ) -> Self {
        let column = |attribute| points.column(attribute).map(|c| c.bytes.as_slice());
        let colored = match around.colorings[cloud] {
            Coloring::Rgb { attribute, scalar, shift } => {
                column(attribute).map(|column| Self::Rgb { column, scalar, shift })
            }
            Coloring::Intensity { attribute, scalar, value_bytes, min, max } => column(attribute)
                .map(|column| Self::Intensity { column, scalar, value_bytes, min, max }),
            Coloring::Classification { attribute, scalar, value_bytes } => {
                column(attribute).map(|column| Self::Class { column, scalar, value_bytes })
            }
            Coloring::Normal => Some(Self::Normal(*surface)),
            Coloring::Elevation => around.bounds.map(|(low, high)| {
                let corner = lattice.node_min(points.key).map(f64::from);
                let height = lattice.world_f64(corner)[2] - low.z;
                let range = high.z - low.z;
                let [at_corner, per_unit] = [height, lattice.scale].map(|h| h / range);
                // A flat cloud has no range: all of it is at the bottom.
                if per_unit.is_finite() && at_corner.is_finite() {
                    Self::Elevation { at_corner, per_unit }
                } else {
                    Self::Elevation { at_corner: 0.0, per_unit: 0.0 }
                }
            }),
            Coloring::Level => {
                let deepest = f64::from(around.levels.saturating_sub(1)).max(1.0);
                let step = Ramp::step(f64::from(points.key.level()) / deepest);
                Some(Self::Constant(Ramp::Level.color(step)))
            }
            Coloring::Constant(color) => Some(Self::Constant(color)),
            // Counted, not coloured.
            Coloring::Density => None,
        };
        colored.unwrap_or(Self::Constant(NEUTRAL))
    }

    /// The colour of point `index`, which lies `z()` lattice units above the node's corner.
    #[inline]
    pub fn color(&self, index: usize, z: impl FnOnce() -> u32) -> [u8; 3] {
        match *self {
            Self::Rgb { column, scalar, shift } => rgb_at(column, index, scalar, shift),
            Self::Intensity { .. } => Ramp::Intensity.color(self.intensity_step(index)),
            Self::Class { .. } => Ramp::Class.color(self.class(index)),
            Self::Normal(surface) => direction_color(surface.normal(index)),
            Self::Elevation { at_corner, per_unit } => {
                Ramp::Elevation.color(Ramp::step(at_corner + per_unit * f64::from(z())))
            }
            Self::Constant(color) => color,
        }
    }

    /// The step of the intensity ramp for point `index`; 0 where colours are not by intensity.
    pub fn intensity_step(&self, index: usize) -> u8 {
        let Self::Intensity { column, scalar, value_bytes, min, max } = *self else { return 0 };
        let start = index * value_bytes;
        let value = column.get(start..start + value_bytes).map_or(min, |v| scalar.to_f64(v));
        Ramp::step((value - min) / (max - min))
    }

    /// The class of point `index`; 0 where colours are not by class.
    pub fn class(&self, index: usize) -> u8 {
        let Self::Class { column, scalar, value_bytes } = *self else { return 0 };
        let start = index * value_bytes;
        column.get(start..start + value_bytes).map_or(0, |v| scalar.to_f64(v) as u8)
    }
}

/// Colour `index` of a column; neutral where the column is too short.
#[inline]
fn rgb_at(column: &[u8], index: usize, scalar: ScalarType, shift: u8) -> [u8; 3] {
    let size = scalar.size_bytes();
    let start = index * 3 * size;
    let Some(value) = column.get(start..start + 3 * size) else { return NEUTRAL };
    std::array::from_fn(|c| match scalar {
        ScalarType::U16 => {
            let component = u16::from_le_bytes([value[2 * c], value[2 * c + 1]]) >> shift;
            u8::try_from(component).unwrap_or(u8::MAX)
        }
        _ => value[c],
    })
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::Storage;

    use super::*;
    use crate::render::testing;

    fn cloud(scalar: ScalarType, name: &str, components: u8, max: f64) -> Manifest {
        let attribute = Attribute {
            name: name.into(),
            scalar,
            components,
            domain: Default::default(),
            storage: Storage::Column { group: 0 },
            min: vec![0.0; usize::from(components)],
            max: vec![max; usize::from(components)],
        };
        Manifest { attributes: vec![attribute], ..testing::manifest() }
    }

    #[test]
    fn eight_bit_values_in_sixteen_bit_fields_are_recognised() {
        let shift =
            |max| match Coloring::of(ColorMode::Rgb, &cloud(ScalarType::U16, "color", 3, max)) {
                Coloring::Rgb { shift, .. } => shift,
                other => panic!("{other:?}"),
            };
        assert_eq!((shift(255.0), shift(256.0), shift(65_535.0)), (0, 8, 8));
        assert_eq!(rgb_at(&[10, 0, 20, 0, 30, 0], 0, ScalarType::U16, 0), [10, 20, 30]);
        assert_eq!(rgb_at(&[9, 10, 9, 20, 9, 30], 0, ScalarType::U16, 8), [10, 20, 30]);
        assert_eq!(rgb_at(&[1, 2, 3, 4, 5, 6], 1, ScalarType::U8, 0), [4, 5, 6]);
    }

    #[test]
    fn a_cloud_without_the_attribute_takes_the_next_best() {
        let intensity = cloud(ScalarType::U16, "intensity", 1, 500.0);
        let bare = testing::manifest();
        assert_eq!(Coloring::of(ColorMode::Rgb, &intensity).name(), "intensity");
        assert_eq!(Coloring::of(ColorMode::Rgb, &bare).name(), "elevation");
        assert_eq!(Coloring::of(ColorMode::Intensity, &bare).name(), "elevation");
        let strange = cloud(ScalarType::F64, "color", 3, 1.0);
        assert_eq!(Coloring::of(ColorMode::Rgb, &strange).name(), "elevation");
    }

    #[test]
    fn a_constant_colour_needs_no_column() {
        let mut cloud = cloud(ScalarType::U16, "color", 3, 65_535.0);
        cloud.attributes[0].storage = Attribute::constant_storage(&[0, 1, 0, 2, 0, 3]);
        assert_eq!(Coloring::of(ColorMode::Rgb, &cloud), Coloring::Constant([1, 2, 3]));
    }

    #[test]
    fn a_missing_or_short_column_is_neutral() {
        assert_eq!(rgb_at(&[1, 2], 0, ScalarType::U8, 0), NEUTRAL);
    }
}
