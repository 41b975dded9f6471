//! Nodes as the GPU holds them: bit-packed records.
//!
//! A record is x, y, z relative to the lowest corner of the node's points, then the colour payload
//! (24 bits of red, green, blue; 8 bits of an intensity step; nothing where colour follows from the
//! position or the node). Each coordinate has as many bits as the node's own extent needs, and
//! records follow one another without padding: a terrain node of 12 + 12 + 8 bits takes 4 bytes a
//! point and 7 with colour, where three floats and four colour bytes would take 16. It is lossless,
//! for nodes of any size (up to 32 bits an axis). Not fixed 16-bit coordinates: upper nodes need
//! more and lower ones less, and taking bits apart costs the shader a shift and a mask.

use lodestream_protocol::NodePoints;
use lodestream_shaders::ColorSource;

use super::layout::CHUNK_POINTS;
use crate::render::color::NodeColor;

/// How the records of a node are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RecordLayout {
    /// Lowest corner of the node's points, lattice units relative to the node's cube.
    pub min: [u32; 3],
    /// Highest corner.
    pub max: [u32; 3],
    /// Bits of x, y, z and payload.
    bits: [u8; 4],
}

impl RecordLayout {
    pub fn of(points: &NodePoints, color: ColorSource) -> Self {
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
        let bits = [width(0).max(1), width(1), width(2), color.payload_bits()];
        Self { min, max, bits }
    }

    /// Bits of x, y, z and payload, one byte each.
    pub fn record_bits(&self) -> u32 {
        u32::from_le_bytes(self.bits)
    }

    /// Words of a full chunk.
    pub fn chunk_words(&self) -> usize {
        let stride: usize = self.bits.iter().map(|b| usize::from(*b)).sum();
        CHUNK_POINTS / 32 * stride
    }
}

/// The words of a node: whole chunks, the last one filled up with zeros.
pub fn pack(points: &NodePoints, layout: &RecordLayout, colors: &NodeColor) -> Vec<u32> {
    let chunks = points.positions.len().div_ceil(CHUNK_POINTS);
    let total = chunks * layout.chunk_words();
    let mut words = Vec::with_capacity(total);
    let mut writer = BitWriter { words: &mut words, pending: 0, bits: 0 };
    let [x, y, z, payload_bits] = layout.bits;
    for (index, q) in points.positions.iter().enumerate() {
        writer.push(q[0] - layout.min[0], x);
        writer.push(q[1] - layout.min[1], y);
        writer.push(q[2] - layout.min[2], z);
        match payload_bits {
            0 => {}
            8 => writer.push(u32::from(colors.intensity_step(index)), 8),
            _ => {
                let [r, g, b] = colors.color(index, q[2]);
                writer.push(u32::from_le_bytes([r, g, b, 0]), 24);
            }
        }
    }
    writer.finish();
    words.resize(total, 0);
    words
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
            let points = NodePoints { key: NodeKey::ROOT, positions, columns: Vec::new() };
            let layout = RecordLayout::of(&points, ColorSource::Rgb);
            let words = pack(&points, &layout, &NodeColor::Constant(color));
            let bits = layout.bits.map(usize::from);
            let stride: usize = bits.iter().sum();
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
        let points = NodePoints { key: NodeKey::ROOT, positions, columns: Vec::new() };
        let layout = RecordLayout::of(&points, ColorSource::Rgb);
        let words = pack(&points, &layout, &NodeColor::Constant([0; 3]));
        assert_eq!(words.len() * 4, 512 * 7);
    }
}
