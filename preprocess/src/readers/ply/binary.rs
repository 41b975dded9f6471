//! Binary vertices: rows of raw bytes, read in order, transcoded in parallel.
//!
//! Vertices without lists are a table of fixed-size rows, read in large spans. Lists, in the
//! vertices or in elements before them, force a walk: only their counts tell where the next row
//! starts. The walk copies the scalars out, so that transcoding sees fixed-size rows either way.

use std::{
    fs::File,
    io::{BufReader, Read, Seek, SeekFrom},
};

use lodestream_protocol::ScalarType;

use super::{
    header::{Element, PropertyKind},
    layout::{Field, Layout},
};
use crate::readers::{
    Block,
    gather::{Gather, Tally},
    slot::{Rule, Slot, Stored},
};

/// Bytes that every item of the element takes at least: all of them, where it has no lists.
pub(super) fn least_row_bytes(element: &Element) -> u64 {
    let least = |kind| match kind {
        PropertyKind::Scalar(scalar) => scalar.size_bytes(),
        PropertyKind::List { count, .. } => count.size_bytes(),
    };
    // At most 1024 properties of 8 bytes.
    element.properties.iter().map(|p| least(p.kind) as u64).sum()
}

/// Whether items of the element have different sizes.
pub(super) fn has_lists(element: &Element) -> bool {
    element.properties.iter().any(|p| matches!(p.kind, PropertyKind::List { .. }))
}

/// Binary items, read in file order.
pub(super) struct Items {
    input: BufReader<File>,
    /// Bytes up to the end of the file.
    left: u64,
    big_endian: bool,
}

/// Why items cannot be read on.
#[derive(Debug)]
pub(super) enum ItemError {
    /// Reading failed.
    Io(std::io::Error),
    /// The file ends, or a list claims to reach beyond its end.
    Short,
}

impl From<std::io::Error> for ItemError {
    fn from(error: std::io::Error) -> Self {
        match error.kind() {
            std::io::ErrorKind::UnexpectedEof => Self::Short,
            _ => Self::Io(error),
        }
    }
}

impl Items {
    /// Reads items from `offset` on.
    ///
    /// # Errors
    /// What the system says.
    pub fn new(mut file: File, offset: u64, big_endian: bool) -> std::io::Result<Self> {
        let left = file.metadata()?.len().saturating_sub(offset);
        file.seek(SeekFrom::Start(offset))?;
        Ok(Self { input: BufReader::with_capacity(1 << 20, file), left, big_endian })
    }

    /// Bytes up to the end of the file.
    pub fn bytes_left(&self) -> u64 {
        self.left
    }

    /// Passes over all items of an element.
    ///
    /// # Errors
    /// See [`ItemError`].
    pub fn skip_element(&mut self, element: &Element) -> Result<(), ItemError> {
        if !has_lists(element) {
            let bytes = least_row_bytes(element).checked_mul(element.count);
            return self.skip(bytes.ok_or(ItemError::Short)?);
        }
        let mut scalars = Vec::new();
        for _ in 0..element.count {
            scalars.clear();
            self.walk(element, &mut scalars)?;
        }
        Ok(())
    }

    /// The scalars of the next `rows` items, row by row; fewer bytes where the file ends before.
    ///
    /// # Errors
    /// See [`ItemError`]; [`ItemError::Short`] only for a list.
    pub fn rows(&mut self, element: &Element, rows: usize) -> Result<Vec<u8>, ItemError> {
        let mut bytes = Vec::new();
        if has_lists(element) {
            for _ in 0..rows {
                self.walk(element, &mut bytes)?;
            }
        } else {
            let wanted = least_row_bytes(element).saturating_mul(rows as u64).min(self.left);
            bytes.reserve_exact(usize::try_from(wanted).unwrap_or(0));
            self.left -= wanted;
            (&mut self.input).take(wanted).read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    }

    /// Reads one item, appending its scalars and passing over its lists.
    fn walk(&mut self, element: &Element, scalars: &mut Vec<u8>) -> Result<(), ItemError> {
        for property in &element.properties {
            match property.kind {
                PropertyKind::Scalar(scalar) => {
                    let start = scalars.len();
                    scalars.resize(start + scalar.size_bytes(), 0);
                    self.fill(&mut scalars[start..])?;
                }
                PropertyKind::List { count, item } => {
                    let mut raw = [0; 8];
                    let raw = &mut raw[..count.size_bytes()];
                    self.fill(raw)?;
                    let items = load(raw, count, self.big_endian);
                    // A negative count is none; a huge one may be rounded, but is beyond the end.
                    if !(0.0..=self.left as f64).contains(&items) {
                        return Err(ItemError::Short);
                    }
                    self.skip((items as u64).saturating_mul(item.size_bytes() as u64))?;
                }
            }
        }
        Ok(())
    }

    fn fill(&mut self, bytes: &mut [u8]) -> Result<(), ItemError> {
        self.left = self.left.checked_sub(bytes.len() as u64).ok_or(ItemError::Short)?;
        Ok(self.input.read_exact(bytes)?)
    }

    fn skip(&mut self, bytes: u64) -> Result<(), ItemError> {
        self.left = self.left.checked_sub(bytes).ok_or(ItemError::Short)?;
        Ok(self.input.seek_relative(i64::try_from(bytes).map_err(|_| ItemError::Short)?)?)
    }
}

/// Turns raw rows into blocks.
pub(super) struct Transcoder {
    /// Bytes of a raw row.
    stride: usize,
    row_bytes: usize,
    big_endian: bool,
    axes: [(usize, ScalarType); 3],
    moves: Vec<Move>,
}

/// One step from a raw row to a row of attributes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Move {
    /// Bytes as they are: neighbours that stay neighbours are copied at once.
    Copy { from: usize, to: usize, len: usize },
    /// The bytes of one number, reversed.
    Swap { from: usize, to: usize, len: usize },
    /// A number that changes its type.
    Convert { from: usize, scalar: ScalarType, slot: Slot },
}

impl Transcoder {
    /// For rows of the layout's scalars, as [`Items::rows`] gives them.
    pub fn new(layout: &Layout, big_endian: bool) -> Self {
        let mut stride = 0;
        let mut axes = [(0, ScalarType::F64); 3];
        let mut moves: Vec<Move> = Vec::new();
        for &(kind, field) in &layout.fields {
            let PropertyKind::Scalar(scalar) = kind else { continue };
            let (from, len) = (stride, scalar.size_bytes());
            stride += len;
            match field {
                Field::Unused => {}
                Field::Axis(axis) => axes[axis] = (from, scalar),
                Field::Value(slot) if slot.rule != Rule::Exact || slot.scalar != scalar => {
                    moves.push(Move::Convert { from, scalar, slot });
                }
                Field::Value(slot) if big_endian && len > 1 => {
                    moves.push(Move::Swap { from, to: slot.offset, len });
                }
                Field::Value(slot) => match moves.last_mut() {
                    Some(Move::Copy { from: first, to, len: run })
                        if *first + *run == from && *to + *run == slot.offset =>
                    {
                        *run += len;
                    }
                    _ => moves.push(Move::Copy { from, to: slot.offset, len }),
                },
            }
        }
        Self { stride, row_bytes: layout.row_bytes(), big_endian, axes, moves }
    }

    /// Bytes of a raw row; never zero, since a row holds coordinates.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The points of whole raw rows.
    pub fn blocks(&self, rows: &[u8]) -> (Vec<Block>, Tally) {
        let mut gather = Gather::new(self.row_bytes, rows.len() / self.stride);
        let mut altered = 0;
        for raw in rows.chunks_exact(self.stride) {
            let row = gather.row();
            for step in &self.moves {
                match *step {
                    Move::Copy { from, to, len } => {
                        row[to..to + len].copy_from_slice(&raw[from..from + len]);
                    }
                    Move::Swap { from, to, len } => {
                        let target = &mut row[to..to + len];
                        target.copy_from_slice(&raw[from..from + len]);
                        target.reverse();
                    }
                    Move::Convert { from, scalar, slot } => {
                        let value = load(&raw[from..], scalar, self.big_endian);
                        let stored = slot.store(row, value);
                        altered += u64::from(stored != Stored::Kept);
                    }
                }
            }
            let axes = self.axes;
            gather.keep(axes.map(|(from, scalar)| load(&raw[from..], scalar, self.big_endian)));
        }
        gather.tally.altered_colors = altered;
        gather.finish()
    }
}

/// The number that `bytes` start with; NaN where there are too few.
#[inline]
fn load(bytes: &[u8], scalar: ScalarType, big_endian: bool) -> f64 {
    macro_rules! number {
        ($number:ty) => {{
            let Some(raw) = bytes.first_chunk() else { return f64::NAN };
            if big_endian { <$number>::from_be_bytes(*raw) } else { <$number>::from_le_bytes(*raw) }
        }};
    }
    match scalar {
        ScalarType::U8 => f64::from(number!(u8)),
        ScalarType::I8 => f64::from(number!(i8)),
        ScalarType::U16 => f64::from(number!(u16)),
        ScalarType::I16 => f64::from(number!(i16)),
        ScalarType::U32 => f64::from(number!(u32)),
        ScalarType::I32 => f64::from(number!(i32)),
        ScalarType::U64 => number!(u64) as f64,
        ScalarType::I64 => number!(i64) as f64,
        ScalarType::F32 => f64::from(number!(f32)),
        ScalarType::F64 => number!(f64),
    }
}
