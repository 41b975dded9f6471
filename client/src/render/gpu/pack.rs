//! Nodes as the GPU holds them: bit-packed records.
//!
//! A record is x, y, z relative to the lowest corner of the node's points, then the colour payload
//! (24 bits of red, green, blue; 8 bits of an intensity step or a class; nothing where colour
//! follows from the position or the node), then normal and shape where the view asks for them. Each coordinate has as many bits as the node's own extent needs, and
//! records follow one another without padding: a terrain node of 12 + 12 + 8 bits takes 4 bytes a
//! point and 7 with colour, where three floats and four colour bytes would take 16. It is lossless,
//! for nodes of any size (up to 32 bits an axis). Not fixed 16-bit coordinates: upper nodes need
//! more and lower ones less, and taking bits apart costs the shader a shift and a mask.

use glam::{DVec3, Vec2Swizzles};
use half::f16;
use lodestream_protocol::NodePoints;
use lodestream_shaders::{CHUNK_POINTS, ColorSource, ShapeField};

use crate::render::{color::NodeColor, surface::NodeSurface};

/// What the records of a node hold besides the position.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct RecordFields {
    pub color: ColorSource,
    pub normals: bool,
    pub shape: ShapeField,
}

/// How the records of a node are laid out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordLayout {
    /// Lowest corner of the node's points, lattice units relative to the node's cube.
    pub min: [u32; 3],
    /// Highest corner.
    pub max: [u32; 3],
    /// Bits of x, y, z.
    bits: [u8; 3],
    fields: RecordFields,
    /// World units of 1 in radii and axes.
    pub shape_unit: f32,
}

impl RecordLayout {
    pub fn of(points: &NodePoints, fields: RecordFields, surface: &NodeSurface) -> Self {
        let mut min = [u32::MAX; 3];
        let mut max = [0; 3];
        for q in &points.positions {
            for axis in 0..3 {
                min[axis] = min[axis].min(q[axis]);
                max[axis] = max[axis].max(q[axis]);
            }
        }
        let width = |axis: usize| {
            let extent = max[axis].saturating_sub(min[axis]);
            (u32::BITS - extent.leading_zeros()) as u8
        };
        // At least one bit, so that a node of one place and no payload has bytes at all.
        let bits = [width(0).max(1), width(1), width(2)];
        let radii = (0..points.positions.len()).filter_map(|index| match fields.shape {
            ShapeField::None => None,
            ShapeField::Radius | ShapeField::Axes => surface.own_radius(index),
        });
        let shape_unit = radii.fold(0.0, f64::max) as f32;
        Self { min, max, bits, fields, shape_unit }
    }

    /// Bits of x, y, z, one byte each.
    pub fn position_bits(&self) -> u32 {
        let [x, y, z] = self.bits;
        u32::from_le_bytes([x, y, z, 0])
    }

    /// Words of a full chunk.
    pub fn chunk_words(&self) -> usize {
        let positions: usize = self.bits.iter().map(|b| usize::from(*b)).sum();
        let RecordFields { color, normals, shape } = self.fields;
        let normal = if normals { 2 * NORMAL_AXIS_BITS } else { 0 };
        let payload = color.payload_bits() + normal + shape.bits();
        CHUNK_POINTS / 32 * (positions + usize::from(payload))
    }
}

/// The words of a node: whole chunks, the last one filled up with zeros.
pub fn pack(
    points: &NodePoints,
    layout: &RecordLayout,
    colors: &NodeColor,
    surface: &NodeSurface,
) -> Vec<u32> {
    let chunks = points.positions.len().div_ceil(CHUNK_POINTS);
    let total = chunks * layout.chunk_words();
    let mut words = Vec::with_capacity(total);
    let mut writer = BitWriter { words: &mut words, pending: 0, bits: 0 };
    let [x, y, z] = layout.bits;
    let RecordFields { color, normals, shape } = layout.fields;
    for (index, q) in points.positions.iter().enumerate() {
        writer.push(q[0] - layout.min[0], x);
        writer.push(q[1] - layout.min[1], y);
        writer.push(q[2] - layout.min[2], z);
        match color {
            ColorSource::Rgb => {
                let [r, g, b] = colors.color(index, || q[2]);
                writer.push(u32::from_le_bytes([r, g, b, 0]), 24);
            }
            ColorSource::Intensity => writer.push(u32::from(colors.intensity_step(index)), 8),
            ColorSource::Class => writer.push(u32::from(colors.class(index)), 8),
            ColorSource::Normal | ColorSource::Elevation | ColorSource::Node => {}
        }
        if normals {
            writer.push(pack_normal(surface.normal(index)), 2 * NORMAL_AXIS_BITS);
        }
        match shape {
            ShapeField::None => {}
            ShapeField::Radius => {
                let radius = surface.own_radius(index).unwrap_or(0.0);
                writer.push(pack_length(radius, layout.shape_unit), 16);
            }
            ShapeField::Axes => {
                for word in pack_axes(surface, index, layout.shape_unit) {
                    writer.push(word, 32);
                }
            }
        }
    }
    writer.finish();
    words.resize(total, 0);
    words
}

/// Bits of each octahedral coordinate of a normal.
const NORMAL_AXIS_BITS: u8 = 12;

/// The code of coordinate 0: codes 0 to twice that are -1 to 1, so that 0, -1 and 1 are exact. One
/// code is left: no normal.
const NORMAL_MIDDLE: f64 = 2047.0;

/// A unit vector as octahedral coordinates. (Meyer et al. 2010)
fn pack_normal(normal: Option<DVec3>) -> u32 {
    let Some(n) = normal else { return (1 << (2 * NORMAL_AXIS_BITS)) - 1 };
    let flat = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    let signs = glam::DVec2::new(1f64.copysign(flat.x), 1f64.copysign(flat.y));
    let plane = if n.z >= 0.0 { flat } else { (glam::DVec2::ONE - flat.abs()).yx() * signs };
    let code = |c: f64| ((c.clamp(-1.0, 1.0) + 1.0) * NORMAL_MIDDLE).round() as u32;
    code(plane.x) | code(plane.y) << NORMAL_AXIS_BITS
}

/// A length in units as a half-precision float.
fn pack_length(length: f64, unit: f32) -> u32 {
    u32::from(half(length, unit))
}

fn half(length: f64, unit: f32) -> u16 {
    f16::from_f64(if unit > 0.0 { length / f64::from(unit) } else { 0.0 }).to_bits()
}

/// Half axes as six half-precision floats, the longer one as long as the point's own radius; zero
/// where it has none.
fn pack_axes(surface: &NodeSurface, index: usize, unit: f32) -> [u32; 3] {
    let Some([u, v]) = surface.axes(index) else { return [0; 3] };
    let longest = u.length().max(v.length());
    let scale = surface.own_radius(index).unwrap_or(longest) / longest;
    let axis = |axis: DVec3| (axis * scale).to_array().map(|c| u32::from(half(c, unit)));
    let ([a, b, c], [d, e, f]) = (axis(u), axis(v));
    [a | b << 16, c | d << 16, e | f << 16]
}

/// Writes numbers of any width up to 32 bits, lowest bit first.
struct BitWriter<'a> {
    words: &'a mut Vec<u32>,
    pending: u64,
    bits: u8,
}

impl BitWriter<'_> {
    /// Appends the `bits` low bits of `value`, which has no others.
    fn push(&mut self, value: u32, bits: u8) {
        self.pending |= u64::from(value) << self.bits;
        self.bits += bits;
        if self.bits >= 32 {
            self.words.push(self.pending as u32);
            self.pending >>= 32;
            self.bits -= 32;
        }
    }

    fn finish(self) {
        if self.bits > 0 {
            self.words.push(self.pending as u32);
        }
    }
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::NodeKey;
    use proptest::prelude::*;

    use super::*;

    const RGB: RecordFields =
        RecordFields { color: ColorSource::Rgb, normals: false, shape: ShapeField::None };

    /// `read_normal` of `shaders/normal.wgsl`.
    fn read_normal(packed: u32) -> Option<DVec3> {
        let code = [packed & 4095, packed >> 12];
        if code[0] == 4095 {
            return None;
        }
        let [x, y] = code.map(|c| f64::from(c) / NORMAL_MIDDLE - 1.0);
        let z = 1.0 - x.abs() - y.abs();
        let sign = |c: f64| if c >= 0.0 { 1.0 } else { -1.0 };
        let folded = [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)];
        let [x, y] = if z >= 0.0 { [x, y] } else { folded };
        Some(DVec3::new(x, y, z).normalize())
    }

    proptest! {
        #[test]
        fn a_normal_is_kept_to_a_tenth_of_a_degree(
            x in -1.0..1.0f64, y in -1.0..1.0f64, z in -1.0..1.0f64,
        ) {
            let Some(normal) = DVec3::new(x, y, z).try_normalize() else { return Ok(()) };
            let found = read_normal(pack_normal(Some(normal))).expect("a normal");
            prop_assert!(found.angle_between(normal).to_degrees() < 0.1);
        }
    }

    #[test]
    fn the_axes_are_exact_and_no_normal_is_none() {
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            for normal in [axis, -axis] {
                assert_eq!(read_normal(pack_normal(Some(normal))), Some(normal));
            }
        }
        assert_eq!(read_normal(pack_normal(None)), None);
    }

    /// `read_bits` of `shaders/node.wgsl`.
    fn read_bits(words: &[u32], first_word: usize, bit: usize, count: usize) -> u32 {
        if count == 0 {
            return 0;
        }
        let (word, shift) = (first_word + bit / 32, bit % 32);
        let mut value = words[word] >> shift;
        if shift + count > 32 {
            value |= words[word + 1] << (32 - shift);
        }
        value & (u32::MAX >> (32 - count))
    }

    proptest! {
        #[test]
        fn every_record_is_where_the_shader_reads_it(
            positions in prop::collection::vec(any::<[u32; 3]>(), 1..600),
            shifts in any::<[u8; 3]>(),
            color in any::<[u8; 3]>(),
        ) {
            let positions: Vec<[u32; 3]> = positions
                .into_iter()
                .map(|q| std::array::from_fn(|a| q[a] >> (shifts[a] % 32)))
                .collect();
            let points = NodePoints { positions, ..NodePoints::new(NodeKey::ROOT) };
            let surface = NodeSurface::default();
            let layout = RecordLayout::of(&points, RGB, &surface);
            let words = pack(&points, &layout, &NodeColor::Constant(color), &surface);
            let bits = layout.bits.map(usize::from);
            let stride = bits.iter().sum::<usize>() + 24;
            for (index, q) in points.positions.iter().enumerate() {
                let first_word = index / CHUNK_POINTS * layout.chunk_words();
                let mut at = index % CHUNK_POINTS * stride;
                for axis in 0..3 {
                    let found = read_bits(&words, first_word, at, bits[axis]) + layout.min[axis];
                    prop_assert_eq!(found, q[axis]);
                    at += bits[axis];
                }
                let [r, g, b] = color;
                let expected = u32::from_le_bytes([r, g, b, 0]);
                prop_assert_eq!(read_bits(&words, first_word, at, 24), expected);
            }
        }
    }

    #[test]
    fn a_terrain_node_with_colour_takes_seven_bytes_a_point() {
        let positions = (0..512).map(|i| [i * 8, 4095 - i * 8, 1000 + i / 2]).collect();
        let points = NodePoints { positions, ..NodePoints::new(NodeKey::ROOT) };
        let surface = NodeSurface::default();
        let layout = RecordLayout::of(&points, RGB, &surface);
        let words = pack(&points, &layout, &NodeColor::Constant([0; 3]), &surface);
        assert_eq!(words.len() * 4, 512 * 7);
    }
}
