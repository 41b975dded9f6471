//! ASCII vertices: one line each, parsed in parallel.

use std::io::Read;

use lodestream_protocol::ScalarType;

use super::{
    header::PropertyKind,
    layout::{Field, Layout},
};
use crate::readers::{
    Block,
    gather::{Gather, Tally},
    slot::{Rule, Stored},
    text::{
        lines::{Chunk, ChunkError, LineChunks, is_blank, is_blank_byte, lines},
        number,
    },
};

/// Lines that hold an item each; blank ones hold nothing.
pub(super) struct ItemLines<R> {
    chunks: LineChunks<R>,
    terminator: u8,
    /// Lines read but not given yet.
    pending: Option<Chunk>,
}

impl<R: Read> ItemLines<R> {
    /// Reads the lines that `source` gives from here on, the first of them numbered `first_line`.
    pub fn new(source: R, terminator: u8, first_line: u64) -> Self {
        let chunks = LineChunks::new(source, terminator, first_line);
        Self { chunks, terminator, pending: None }
    }

    /// A chunk with at least one and at most `most` items, and how many; `None` at the end.
    ///
    /// # Errors
    /// See [`ChunkError`].
    pub fn next_lines(&mut self, most: u64) -> Result<Option<(Chunk, u64)>, ChunkError> {
        loop {
            let chunk = match self.pending.take() {
                Some(chunk) => chunk,
                None => match self.chunks.next_chunk()? {
                    Some(chunk) => chunk,
                    None => return Ok(None),
                },
            };
            let (items, chunk) = self.take(chunk, most);
            if items > 0 {
                return Ok(Some((chunk, items)));
            }
        }
    }

    /// Cuts a chunk after `most` items, keeping the rest for the next call.
    fn take(&mut self, mut chunk: Chunk, most: u64) -> (u64, Chunk) {
        let (mut items, mut lines, mut end) = (0, 0, 0);
        while items < most && end < chunk.bytes.len() {
            let rest = &chunk.bytes[end..];
            let length = memchr::memchr(self.terminator, rest).unwrap_or(rest.len());
            items += u64::from(!is_blank(&rest[..length]));
            lines += 1;
            end = (end + length + 1).min(chunk.bytes.len());
        }
        if end < chunk.bytes.len() {
            let bytes = chunk.bytes.split_off(end);
            self.pending = Some(Chunk { first_line: chunk.first_line + lines, bytes });
        }
        (items, chunk)
    }
}

/// Parses lines of vertices; blank ones are passed over.
///
/// # Errors
/// The first line that is no vertex, and why.
pub(super) fn blocks(
    layout: &Layout,
    chunk: &Chunk,
    terminator: u8,
) -> Result<(Vec<Block>, Tally), String> {
    // A vertex of text is rarely shorter than 24 bytes.
    let mut gather = Gather::new(layout.row_bytes(), chunk.bytes.len() / 24 + 1);
    let mut tally = Tally::default();
    for (line, number) in lines(&chunk.bytes, terminator).zip(chunk.first_line..) {
        if !is_blank(line) {
            let position = vertex(layout, line, gather.row(), &mut tally)
                .map_err(|why| format!("line {number}: {why}"))?;
            gather.keep(position);
        }
    }
    gather.tally.add(tally);
    Ok(gather.finish())
}

/// Parses one vertex into its row; gives its position.
fn vertex(
    layout: &Layout,
    line: &[u8],
    row: &mut [u8],
    tally: &mut Tally,
) -> Result<[f64; 3], String> {
    let mut fields = Fields { rest: line };
    let mut position = [0.0; 3];
    for (index, &(kind, field)) in layout.fields.iter().enumerate() {
        let missing =
            || format!("{index} values, where the header announces {}", layout.fields.len());
        let scalar = match kind {
            PropertyKind::Scalar(scalar) => scalar,
            PropertyKind::List { .. } => {
                let count = fields.number().ok_or_else(missing)??;
                for _ in 0..count.value.max(0.0) as u64 {
                    fields.word().ok_or_else(missing)?;
                }
                continue;
            }
        };
        match field {
            Field::Unused => {
                fields.word().ok_or_else(missing)?;
            }
            Field::Axis(axis) => {
                let number = fields.number().ok_or_else(missing)??;
                position[axis] = number.value;
                tally.decimals = tally.decimals.max(number.decimals);
            }
            Field::Value(slot)
                if slot.rule == Rule::Exact
                    && matches!(scalar, ScalarType::I64 | ScalarType::U64) =>
            {
                let word = fields.word().ok_or_else(missing)?;
                let text = String::from_utf8_lossy(word);
                if !text.parse().is_ok_and(|integer| slot.store_integer(row, integer)) {
                    return Err(format!("{} is no {} integer", shown(word), type_name(scalar)));
                }
            }
            Field::Value(slot) => {
                let before = fields.rest;
                let number = fields.number().ok_or_else(missing)??;
                match slot.store(row, number.value) {
                    Stored::Kept => {}
                    Stored::Altered => tally.altered_colors += 1,
                    Stored::Unfit => {
                        let word = Fields { rest: before }.word().unwrap_or_default();
                        return Err(format!("{} is no {}", shown(word), type_name(scalar)));
                    }
                }
            }
        }
    }
    if fields.word().is_some() {
        return Err(format!(
            "more values than the {} that the header announces",
            layout.fields.len()
        ));
    }
    Ok(position)
}

/// The blank-separated fields of a line.
struct Fields<'a> {
    rest: &'a [u8],
}

impl<'a> Fields<'a> {
    fn skip_blanks(&mut self) {
        let blanks = self.rest.iter().take_while(|&&byte| is_blank_byte(byte)).count();
        self.rest = &self.rest[blanks..];
    }

    /// The next field, whatever it is.
    fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_blanks();
        let length = self.rest.iter().take_while(|&&byte| !is_blank_byte(byte)).count();
        let (word, rest) = self.rest.split_at(length);
        self.rest = rest;
        (length > 0).then_some(word)
    }

    /// The next field as a number; the error tells what is there instead.
    fn number(&mut self) -> Option<Result<number::Number, String>> {
        self.skip_blanks();
        if let Some((number, taken)) = number::scan(self.rest)
            && self.rest.get(taken).is_none_or(|&byte| is_blank_byte(byte))
        {
            self.rest = &self.rest[taken..];
            return Some(Ok(number));
        }
        let word = self.word()?;
        Some(number::parse(word).ok_or_else(|| format!("{} is no number", shown(word))))
    }
}

/// A field for a message: short and printable.
fn shown(word: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(&word[..word.len().min(40)]))
}

const fn type_name(scalar: ScalarType) -> &'static str {
    match scalar {
        ScalarType::U8 => "uchar",
        ScalarType::I8 => "char",
        ScalarType::U16 => "ushort",
        ScalarType::I16 => "short",
        ScalarType::U32 => "uint",
        ScalarType::I32 => "int",
        ScalarType::U64 => "uint64",
        ScalarType::I64 => "int64",
        ScalarType::F32 => "float",
        ScalarType::F64 => "double",
    }
}
