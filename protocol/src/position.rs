//! Positions: a node's points as Morton codes, whole, or in two parts.
//!
//! Most of a position is finer than the distance between neighbouring points: noise that does not
//! compress, and that no picture shows which draws the node at about a point a pixel. So group 0 may hold
//! *cells* only: cubes of a power-of-two side, a fraction of the node's spacing. Where in its cell each point
//! lies is in a group of its own ([`FinePositions`]), for those who look closely or want every bit. On an
//! aerial scan cells of an eighth of the spacing take 2.1 bytes a point and the rest 1.2, where whole positions take
//! 3.3: parting them costs nothing.

use crate::{
    attribute::ScalarType,
    column::{
        Encoding, TRY_RAW_BELOW, check_used, config, push_column, push_stream, take, take_column,
        take_stream,
    },
    error::{Result, corrupt},
    hierarchy::MAX_NODE_POINTS,
    morton::MortonCode,
};
use pco::DeltaSpec;

/// Low bits of a Morton code that [`Encoding::MortonWide`] keeps in its second stream.
const WIDE_LOW_BITS: u8 = 48;

/// Most bits an axis of cells: their codes fit u64.
pub(crate) const MAX_CELL_AXIS_BITS: u8 = <u64 as MortonCode>::AXIS_BITS;

/// Where in their cells the points of a node lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FinePositions {
    /// log2 of the side of a cell in lattice units.
    pub cell_bits: u8,
    /// Lattice units relative to the cell's lowest corner, in the order of the positions.
    pub offsets: Vec<[u32; 3]>,
}

impl FinePositions {
    /// Makes cells' centres into positions.
    ///
    /// # Errors
    /// [`Error::Corrupt`](crate::Error::Corrupt) where these are not as many.
    pub fn refine(&self, positions: &mut [[u32; 3]]) -> Result<()> {
        if positions.len() != self.offsets.len() {
            return Err(corrupt("column", "fine positions of another number of points"));
        }
        let cells = u32::MAX.checked_shl(self.cell_bits.into()).unwrap_or(0);
        for (position, offset) in positions.iter_mut().zip(&self.offsets) {
            for (q, offset) in position.iter_mut().zip(offset) {
                *q = *q & cells | *offset;
            }
        }
        Ok(())
    }
}

fn check_count(points: usize) -> Result<()> {
    if points > MAX_NODE_POINTS as usize {
        return Err(corrupt("node", format!("{points} points in one node")));
    }
    Ok(())
}

/// Appends the position column of a node: `codes` are node-relative Morton codes, ascending, of a
/// node with `bits` bits an axis.
///
/// # Errors
/// [`Error::Corrupt`](crate::Error::Corrupt) where there are more than [`MAX_NODE_POINTS`] points.
pub fn encode_positions<C: MortonCode>(out: &mut Vec<u8>, codes: &[C], bits: u8) -> Result<()> {
    check_count(codes.len())?;
    let mut data = Vec::new();
    let narrow = bits <= <u64 as MortonCode>::AXIS_BITS;
    if narrow {
        let codes: Vec<u64> = codes.iter().map(|c| c.low_u64(0)).collect();
        push_stream(&mut data, &codes, &ascending())?;
    } else {
        push_wide(&mut data, codes, &ascending())?;
    }
    if codes.len() < TRY_RAW_BELOW && data.len() >= 12 * codes.len() {
        return push_column(out, Encoding::Raw, &raw(codes));
    }
    push_column(out, if narrow { Encoding::Morton } else { Encoding::MortonWide }, &data)
}

/// Appends a position column of cells of side `2^cell_bits`: see [`encode_fine_positions`] for the
/// rest.
///
/// # Errors
/// [`Error::Corrupt`](crate::Error::Corrupt) where there are more than [`MAX_NODE_POINTS`] points, or
/// cells of more than 21 bits an axis.
pub fn encode_cells<C: MortonCode>(
    out: &mut Vec<u8>,
    codes: &[C],
    bits: u8,
    cell_bits: u8,
) -> Result<()> {
    check_count(codes.len())?;
    if cell_bits > bits || bits - cell_bits > MAX_CELL_AXIS_BITS {
        return Err(corrupt("node", format!("cells of {cell_bits} bits in a node of {bits}")));
    }
    let mut data = vec![cell_bits];
    let cells: Vec<u64> = codes.iter().map(|c| c.up(cell_bits).low_u64(0)).collect();
    push_stream(&mut data, &cells, &ascending())?;
    push_column(out, Encoding::Cells, &data)
}

/// Appends the column that says where in their cells the points lie.
///
/// # Errors
/// [`Error::Corrupt`](crate::Error::Corrupt) where there are more than [`MAX_NODE_POINTS`] points.
pub fn encode_fine_positions<C: MortonCode>(
    out: &mut Vec<u8>,
    codes: &[C],
    cell_bits: u8,
) -> Result<()> {
    check_count(codes.len())?;
    let mut data = vec![cell_bits];
    let within = codes.iter().map(|c| c.within(cell_bits));
    let noise = |scalar| config(scalar, DeltaSpec::NoOp);
    // Noise: what the bits need, and no search for patterns.
    match FineWidth::of(cell_bits) {
        FineWidth::U16 => {
            let values: Vec<u16> = within.map(|c| c.low_u64(0) as u16).collect();
            push_stream(&mut data, &values, &noise(ScalarType::U16))?;
        }
        FineWidth::U32 => {
            let values: Vec<u32> = within.map(|c| c.low_u64(0) as u32).collect();
            push_stream(&mut data, &values, &noise(ScalarType::U32))?;
        }
        FineWidth::U64 => {
            let values: Vec<u64> = within.map(|c| c.low_u64(0)).collect();
            push_stream(&mut data, &values, &noise(ScalarType::U64))?;
        }
        FineWidth::Wide => {
            let values: Vec<C> = within.collect();
            push_wide(&mut data, &values, &noise(ScalarType::U64))?;
        }
    }
    push_column(out, Encoding::FinePositions, &data)
}

/// The type of number that holds codes within a cell.
enum FineWidth {
    U16,
    U32,
    U64,
    Wide,
}

impl FineWidth {
    const fn of(cell_bits: u8) -> Self {
        match cell_bits {
            0..=5 => Self::U16,
            6..=10 => Self::U32,
            11..=21 => Self::U64,
            _ => Self::Wide,
        }
    }
}

fn ascending() -> pco::ChunkConfig {
    config(ScalarType::U64, DeltaSpec::TryConsecutive(1))
}

fn push_wide<C: MortonCode>(
    data: &mut Vec<u8>,
    codes: &[C],
    of_high: &pco::ChunkConfig,
) -> Result<()> {
    let high: Vec<u64> = codes.iter().map(|c| c.low_u64(WIDE_LOW_BITS)).collect();
    let low: Vec<u64> = codes.iter().map(|c| c.low_u64(0) & ((1 << WIDE_LOW_BITS) - 1)).collect();
    push_stream(data, &high, of_high)?;
    push_stream(data, &low, &config(ScalarType::U64, DeltaSpec::NoOp))
}

fn take_wide(data: &mut &[u8], count: usize) -> Result<Vec<[u32; 3]>> {
    let high = take_stream::<u64>(data, count)?;
    let low = take_stream::<u64>(data, count)?;
    let codes = high
        .into_iter()
        .zip(low)
        .map(|(high, low)| u128::from(high) << WIDE_LOW_BITS | u128::from(low));
    Ok(codes.map(MortonCode::decode).collect())
}

fn raw<C: MortonCode>(codes: &[C]) -> Vec<u8> {
    codes.iter().flat_map(|c| c.decode()).flat_map(u32::to_le_bytes).collect()
}

/// Positions, and log2 of the side of the cells that they are the centres of.
pub(crate) fn decode_positions(
    bytes: &mut &[u8],
    count: usize,
    bits: u8,
) -> Result<(Vec<[u32; 3]>, u8)> {
    let (encoding, mut data) = take_column(bytes)?;
    let mut cell_bits = 0;
    let positions: Vec<[u32; 3]> = match encoding {
        Encoding::Raw => take(&mut data, count * 12)?
            .chunks_exact(12)
            .map(|v| bytemuck::pod_read_unaligned::<[u32; 3]>(v).map(u32::from_le))
            .collect(),
        Encoding::Morton if bits <= <u64 as MortonCode>::AXIS_BITS => {
            take_stream::<u64>(&mut data, count)?.into_iter().map(MortonCode::decode).collect()
        }
        Encoding::MortonWide => take_wide(&mut data, count)?,
        Encoding::Cells => {
            cell_bits = take(&mut data, 1)?[0];
            if cell_bits > bits || bits - cell_bits > MAX_CELL_AXIS_BITS {
                let why = format!("cells of {cell_bits} bits in a node of {bits}");
                return Err(corrupt("column", why));
            }
            let cells = take_stream::<u64>(&mut data, count)?.into_iter().map(MortonCode::decode);
            cells.map(|cell| centre(cell, cell_bits)).collect()
        }
        other => return Err(corrupt("column", format!("{other:?} positions in {bits} bits"))),
    };
    check_used(data)?;
    if positions.iter().flatten().any(|&q| u64::from(q) >> bits != 0) {
        return Err(corrupt("column", "a position is outside its node"));
    }
    Ok((positions, cell_bits))
}

/// The centre of a cell. One that lies outside of its node does so still.
fn centre(cell: [u32; 3], cell_bits: u8) -> [u32; 3] {
    let half = (1u64 << cell_bits) / 2;
    cell.map(|c| u32::try_from(u64::from(c) << cell_bits | half).unwrap_or(u32::MAX))
}

pub(crate) fn decode_fine_positions(
    bytes: &mut &[u8],
    count: usize,
    bits: u8,
) -> Result<FinePositions> {
    let (encoding, mut data) = take_column(bytes)?;
    if encoding != Encoding::FinePositions {
        return Err(corrupt("column", format!("{encoding:?} as fine positions")));
    }
    let cell_bits = take(&mut data, 1)?[0];
    if cell_bits > bits {
        return Err(corrupt("column", format!("cells of {cell_bits} bits in a node of {bits}")));
    }
    let offsets: Vec<[u32; 3]> = match FineWidth::of(cell_bits) {
        FineWidth::U16 => decoded(take_stream::<u16>(&mut data, count)?),
        FineWidth::U32 => decoded(take_stream::<u32>(&mut data, count)?),
        FineWidth::U64 => decoded(take_stream::<u64>(&mut data, count)?),
        FineWidth::Wide => take_wide(&mut data, count)?,
    };
    check_used(data)?;
    if offsets.iter().flatten().any(|&q| u64::from(q) >> cell_bits != 0) {
        return Err(corrupt("column", "a position is outside its cell"));
    }
    Ok(FinePositions { cell_bits, offsets })
}

fn decoded<T: Into<u64>>(codes: Vec<T>) -> Vec<[u32; 3]> {
    codes.into_iter().map(|code| MortonCode::decode(code.into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sorted(mut points: Vec<[u32; 3]>, bits: u8) -> (Vec<[u32; 3]>, Vec<u128>) {
        let mask = ((1u64 << bits) - 1) as u32;
        points.iter_mut().flatten().for_each(|c| *c &= mask);
        points.sort_by_key(|&q| u128::encode(q));
        let codes = points.iter().map(|&q| u128::encode(q)).collect();
        (points, codes)
    }

    proptest! {
        #[test]
        fn positions_of_any_width_read_back(
            bits in 0u8..=32, points in prop::collection::vec(any::<[u32; 3]>(), 1..600),
        ) {
            let (points, codes) = sorted(points, bits);
            let mut column = Vec::new();
            if bits <= 21 {
                let codes: Vec<u64> = points.iter().map(|&q| u64::encode(q)).collect();
                encode_positions(&mut column, &codes, bits)?;
            } else {
                encode_positions(&mut column, &codes, bits)?;
            }
            let (positions, cell_bits) = decode_positions(&mut &column[..], points.len(), bits)?;
            prop_assert_eq!(positions, points);
            prop_assert_eq!(cell_bits, 0);
        }

        #[test]
        fn cells_hold_their_points_and_fine_positions_bring_every_bit_back(
            bits in 0u8..=32, cell_bits in 0u8..=32,
            points in prop::collection::vec(any::<[u32; 3]>(), 1..600),
        ) {
            let cell_bits = cell_bits.min(bits).max(bits.saturating_sub(MAX_CELL_AXIS_BITS));
            let (points, codes) = sorted(points, bits);
            let (mut coarse, mut fine) = (Vec::new(), Vec::new());
            encode_cells(&mut coarse, &codes, bits, cell_bits)?;
            encode_fine_positions(&mut fine, &codes, cell_bits)?;
            let (mut positions, told) = decode_positions(&mut &coarse[..], points.len(), bits)?;
            prop_assert_eq!(told, cell_bits);
            let half = (1u64 << cell_bits) / 2;
            for (cell, point) in positions.iter().zip(&points) {
                for axis in 0..3 {
                    prop_assert!(u64::from(cell[axis].abs_diff(point[axis])) <= half);
                    prop_assert_eq!(u64::from(cell[axis]) >> cell_bits, u64::from(point[axis]) >> cell_bits);
                }
            }
            let fine = decode_fine_positions(&mut &fine[..], points.len(), bits)?;
            fine.refine(&mut positions)?;
            prop_assert_eq!(&positions, &points);
            fine.refine(&mut positions)?;
            prop_assert_eq!(&positions, &points, "once more changes nothing");
        }

        #[test]
        fn garbage_never_panics(
            bytes in prop::collection::vec(any::<u8>(), 0..300), count in 0usize..1000, bits in 0u8..=32,
        ) {
            let _ = decode_positions(&mut &bytes[..], count, bits);
            let _ = decode_fine_positions(&mut &bytes[..], count, bits);
        }
    }

    #[test]
    fn cells_of_more_bits_than_codes_hold_are_refused() {
        let error = encode_cells(&mut Vec::new(), &[0u128], 32, 10).expect_err("22 bits an axis");
        assert!(error.to_string().contains("cells of 10 bits in a node of 32"), "{error}");
        assert!(encode_cells(&mut Vec::new(), &[0u128], 4, 5).is_err());
    }
}
