//! Point records to blocks: the hot path of reading.
//!
//! What has to be copied where is worked out once, as a short list of moves: runs of bytes that lie
//! the same way in the record and in the block's row are one move, and the bit fields of one byte
//! are one look-up in a table. Moves run one after another over tiles that stay in the first-level
//! cache, each with its width known to the compiler. The six moves of format 2 take 2 ns a point so,
//! as long as a loop over points that is written out for that format alone.

use lodestream_protocol::ScalarType;

use super::{
    extra_bytes::ExtraAttribute,
    point_format::{Field, POSITION_BYTES, Place},
};
use crate::readers::{BLOCK_POINTS, Block, InputAttribute, Positions};

/// Bytes of records that are transcoded at a time, with their rows about an L1 cache.
const TILE_BYTES: usize = 12 << 10;

/// Bytes of records that are read or decoded at a time.
const SPAN_BYTES: usize = 64 << 10;

/// Most bytes of a block.
const LARGEST_BLOCK_BYTES: usize = 8 << 20;

/// Most attributes that the bits of one byte make: one per bit.
const MOST_BIT_FIELDS: usize = 8;

/// How records become rows.
#[derive(Debug)]
pub(super) struct Transcoder {
    record_bytes: usize,
    row_bytes: usize,
    moves: Vec<Move>,
}

#[derive(Debug)]
enum Move {
    /// `len` bytes as they are.
    Copy { from: usize, to: usize, len: usize },
    /// The bit fields of one byte, `len` of them, a byte each.
    Split { from: usize, to: usize, len: usize, table: Box<[[u8; MOST_BIT_FIELDS]; 256]> },
}

impl Transcoder {
    /// The way from records of `record_bytes` with these fields, and the attributes it yields.
    pub(super) fn new(
        record_bytes: usize,
        format_bytes: usize,
        fields: &[Field],
        extra: &[ExtraAttribute],
    ) -> (Self, Vec<InputAttribute>) {
        let mut this = Self { record_bytes, row_bytes: 0, moves: Vec::new() };
        for field in fields {
            match field.place {
                Place::Bytes => this.copy(field.at, field.scalar, field.components),
                Place::Bits { shift, bits } => this.split(field.at, shift, bits),
            }
        }
        for extra in extra {
            let InputAttribute { scalar, components, .. } = extra.attribute;
            this.copy(format_bytes + extra.at, scalar, components);
        }
        let attributes = fields
            .iter()
            .map(|field| InputAttribute {
                name: field.name.to_owned(),
                scalar: field.scalar,
                components: field.components,
            })
            .chain(extra.iter().map(|extra| extra.attribute.clone()))
            .collect();
        (this, attributes)
    }

    fn copy(&mut self, from: usize, scalar: ScalarType, components: u8) {
        let more = scalar.size_bytes() * usize::from(components);
        let to = self.row_bytes;
        match self.moves.last_mut() {
            Some(Move::Copy { from: f, to: t, len }) if *f + *len == from && *t + *len == to => {
                *len += more;
            }
            _ => self.moves.push(Move::Copy { from, to, len: more }),
        }
        self.row_bytes += more;
    }

    fn split(&mut self, from: usize, shift: u8, bits: u8) {
        if !matches!(self.moves.last(), Some(Move::Split { from: f, .. }) if *f == from) {
            let table = Box::new([[0; MOST_BIT_FIELDS]; 256]);
            self.moves.push(Move::Split { from, to: self.row_bytes, len: 0, table });
        }
        if let Some(Move::Split { len, table, .. }) = self.moves.last_mut() {
            for (byte, values) in (0..=u8::MAX).zip(table.iter_mut()) {
                values[*len] = (byte >> shift) & (u8::MAX >> (8 - bits));
            }
            *len += 1;
        }
        self.row_bytes += 1;
    }

    /// Bytes of a record.
    pub(super) const fn record_bytes(&self) -> usize {
        self.record_bytes
    }

    /// Bytes of a block's point: coordinates and attributes.
    pub(super) const fn point_bytes(&self) -> usize {
        POSITION_BYTES + self.row_bytes
    }

    /// Appends whole records to a block.
    pub(super) fn append(&self, records: &[u8], block: &mut BlockBuilder) {
        let count = records.len() / self.record_bytes;
        let tile_points = (TILE_BYTES / self.record_bytes).max(1);
        let rows_start = block.rows_filled * self.row_bytes;
        let rows = &mut block.attributes[rows_start..][..count * self.row_bytes];
        for (records, rows) in records
            .chunks(tile_points * self.record_bytes)
            .zip(rows.chunks_mut(tile_points * self.row_bytes))
        {
            block.positions.extend(records.chunks_exact(self.record_bytes).map(position));
            for step in &self.moves {
                self.run(step, records, rows);
            }
        }
        block.rows_filled += count;
    }

    fn run(&self, step: &Move, records: &[u8], rows: &mut [u8]) {
        match *step {
            Move::Copy { mut from, mut to, mut len } => {
                while len > 0 {
                    let width = match len {
                        16.. => self.copy_runs::<16>(records, rows, from, to),
                        12.. => self.copy_runs::<12>(records, rows, from, to),
                        8.. => self.copy_runs::<8>(records, rows, from, to),
                        6.. => self.copy_runs::<6>(records, rows, from, to),
                        4.. => self.copy_runs::<4>(records, rows, from, to),
                        2.. => self.copy_runs::<2>(records, rows, from, to),
                        _ => self.copy_runs::<1>(records, rows, from, to),
                    };
                    from += width;
                    to += width;
                    len -= width;
                }
            }
            Move::Split { from, to, len, ref table } => match len {
                2 => self.split_runs::<2>(records, rows, from, to, table),
                4 => self.split_runs::<4>(records, rows, from, to, table),
                7 => self.split_runs::<7>(records, rows, from, to, table),
                _ => unreachable!("the point formats split bytes into two, four or seven fields"),
            },
        }
    }

    fn copy_runs<const N: usize>(
        &self,
        records: &[u8],
        rows: &mut [u8],
        from: usize,
        to: usize,
    ) -> usize {
        let pairs =
            records.chunks_exact(self.record_bytes).zip(rows.chunks_exact_mut(self.row_bytes));
        for (record, row) in pairs {
            row[to..to + N].copy_from_slice(&record[from..from + N]);
        }
        N
    }

    fn split_runs<const N: usize>(
        &self,
        records: &[u8],
        rows: &mut [u8],
        from: usize,
        to: usize,
        table: &[[u8; MOST_BIT_FIELDS]; 256],
    ) {
        let pairs =
            records.chunks_exact(self.record_bytes).zip(rows.chunks_exact_mut(self.row_bytes));
        for (record, row) in pairs {
            let values = &table[usize::from(record[from])];
            row[to..to + N].copy_from_slice(&values[..N]);
        }
    }

    /// A builder of a block of `points` points.
    pub(super) fn block(&self, points: usize) -> BlockBuilder {
        BlockBuilder {
            positions: Vec::with_capacity(points),
            attributes: vec![0; points * self.row_bytes],
            rows_filled: 0,
        }
    }

    /// Points of a full block: [`BLOCK_POINTS`], fewer where a point is very long.
    pub(super) fn block_points(&self) -> usize {
        (LARGEST_BLOCK_BYTES / self.point_bytes()).clamp(1, BLOCK_POINTS)
    }

    /// Points whose records are read or decoded at a time, to stay in a second-level cache.
    pub(super) fn span_points(&self) -> usize {
        (SPAN_BYTES / self.record_bytes).max(1)
    }
}

fn position(record: &[u8]) -> [i32; 3] {
    let axis = |at: usize| {
        i32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]])
    };
    [axis(0), axis(4), axis(8)]
}

/// A block being filled.
#[derive(Debug)]
pub(super) struct BlockBuilder {
    positions: Vec<[i32; 3]>,
    attributes: Vec<u8>,
    rows_filled: usize,
}

impl BlockBuilder {
    /// The block; every point announced to [`Transcoder::block`] has been appended.
    pub(super) fn finish(self) -> Block {
        Block { positions: Positions::Scaled(self.positions), attributes: self.attributes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readers::las::point_format::{LAST_FORMAT, fields};

    /// The same, value by value.
    fn reference(record: &[u8], fields: &[Field]) -> Vec<u8> {
        let mut row = Vec::new();
        for field in fields {
            let size = field.scalar.size_bytes() * usize::from(field.components);
            match field.place {
                Place::Bytes => row.extend_from_slice(&record[field.at..field.at + size]),
                Place::Bits { shift, bits } => {
                    row.push(((u16::from(record[field.at]) >> shift) & ((1 << bits) - 1)) as u8);
                }
            }
        }
        row
    }

    #[test]
    fn agrees_with_taking_every_field_by_itself() {
        for format in 0..=LAST_FORMAT {
            let (fields, format_bytes) = fields(format).expect("a known format");
            let record_bytes = format_bytes + 3;
            let (transcoder, attributes) =
                Transcoder::new(record_bytes, format_bytes, &fields, &[]);
            assert_eq!(attributes.len(), fields.len());
            // Any bytes will do; 1500 points are several tiles.
            let records: Vec<u8> =
                (0..1500 * record_bytes).map(|i| (i * 31 + i / 251 * 7) as u8).collect();
            let mut block = transcoder.block(1500);
            let (first, second) = records.split_at(700 * record_bytes);
            transcoder.append(first, &mut block);
            transcoder.append(second, &mut block);
            let block = block.finish();
            let expected: Vec<u8> = records
                .chunks_exact(record_bytes)
                .flat_map(|record| reference(record, &fields))
                .collect();
            assert!(block.attributes == expected, "format {format}");
            let Positions::Scaled(positions) = block.positions else { panic!("not integers") };
            assert_eq!(positions.len(), 1500);
            assert_eq!(positions[1499], position(&records[1499 * record_bytes..]));
        }
    }
}
