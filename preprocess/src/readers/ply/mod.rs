//! PLY: ASCII and binary of either byte order, elements and properties in any order.
//!
//! The vertices' scalar properties are kept, all of them: `x`, `y`, `z` as coordinates, `red`,
//! `green`, `blue` as `color`, `nx`, `ny`, `nz` as `normal`, the rest under their own names. Faces
//! and other elements are passed over.
//!
//! Why not a crate: the two that are kept up were tried. `ply-rs-bw` builds a map per vertex (1.2
//! million vertices a second); `serde-ply` reads value by value into serde's data model on one
//! thread. Neither can start at a row (so neither can run in parallel), tells the decimals of
//! ASCII coordinates, bounds the length of a header line, or knows `bool` and lone carriage
//! returns, which real files have. The header is the small part of the work; the rows are ours
//! either way.

mod ascii;
mod binary;
mod header;
mod layout;

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use lodestream_protocol::ScalarType;
use rayon::prelude::*;

use self::{
    ascii::ItemLines,
    binary::{ItemError, Items, Transcoder, has_lists, least_row_bytes},
    header::{Element, Encoding, Header, MAX_HEADER_BYTES},
    layout::Layout,
};
use super::{
    BLOCK_POINTS, Block, InputInfo, PointReader, ReadReport,
    ahead::{batch_parts, run_ahead},
    color::ColorRange,
    gather::Tally,
    text::lines::{ChunkError, terminator_of},
};
use crate::error::{Error, Result};

/// Opens a PLY file: reads its header and checks that the vertices it announces can be there.
///
/// # Errors
/// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is not a PLY file with
/// points in it or is shorter than its header says.
pub fn open(path: &Path) -> Result<Box<dyn PointReader>> {
    Ok(Box::new(PlyReader::open(path)?))
}

struct PlyReader {
    path: PathBuf,
    header: Header,
    /// Index of the vertex element.
    vertex: usize,
    /// Ends lines of ASCII data.
    terminator: u8,
    layout: Layout,
    info: InputInfo,
}

/// Blocks and counts of one part of the file.
type Part = (Vec<Block>, Tally);

impl PlyReader {
    fn open(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let wrong = |message: String| Error::input(name.clone(), message);
        let file = File::open(path).map_err(Error::io(path, "cannot open"))?;
        let size = file.metadata().map_err(Error::io(path, "cannot read"))?.len();
        let mut head = Vec::new();
        file.take(MAX_HEADER_BYTES as u64)
            .read_to_end(&mut head)
            .map_err(Error::io(path, "cannot read"))?;
        if head.is_empty() {
            return Err(wrong("the file is empty".to_owned()));
        }
        let header = Header::parse(&head).map_err(wrong)?;
        let (vertex, element) = header.element("vertex").ok_or_else(|| {
            let names: Vec<&str> = header.elements.iter().map(|e| e.name.as_str()).collect();
            let listed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            wrong(format!("the file has no vertices (its elements: {listed})"))
        })?;
        check_size(&header, vertex, size).map_err(wrong)?;
        let layout = Layout::new(element, ColorRange::Unit.scale()).map_err(wrong)?;
        let info = InputInfo {
            path: name.clone(),
            points: Some(element.count),
            coordinates: layout.coordinates,
            attributes: layout.attributes.clone(),
            crs: None,
            left_out: layout.left_out.clone(),
        };
        let terminator = terminator_of(&head[header.data_offset..]);
        let mut reader = Self { path: path.to_owned(), header, vertex, terminator, layout, info };
        reader.settle_float_colors()?;
        Ok(reader)
    }

    fn element(&self) -> &Element {
        &self.header.elements[self.vertex]
    }

    /// Floating-point colours run from 0 to 1, but some writers mean 255 or 65535: the first block
    /// tells.
    fn settle_float_colors(&mut self) -> Result<()> {
        let Some(layout) = self.layout.float_color_only() else { return Ok(()) };
        let mut components = Vec::new();
        let sample = self.element().count.min(BLOCK_POINTS as u64);
        // Broken vertices are reported when they are read.
        let _ = self.stream(&layout, sample, &mut |block| {
            let values = block.attributes.chunks_exact(8).map(|v| ScalarType::F64.to_f64(v));
            components.extend(values);
            Ok(())
        });
        let range = ColorRange::of(components.into_iter());
        if range != ColorRange::Unit {
            self.layout = Layout::new(self.element(), range.scale())
                .map_err(|why| Error::input(self.info.path.clone(), why))?;
            self.info.left_out.push(range.note());
        }
        Ok(())
    }

    /// Streams the first `vertices` vertices in the given layout.
    fn stream(
        &self,
        layout: &Layout,
        vertices: u64,
        sink: &mut dyn FnMut(Block) -> Result<()>,
    ) -> Result<ReadReport> {
        let mut tally = Tally::default();
        let mut take = |parts: Vec<Part>| -> Result<()> {
            for (blocks, part) in parts {
                tally.add(part);
                blocks.into_iter().try_for_each(&mut *sink)?;
            }
            Ok(())
        };
        let file = File::open(&self.path).map_err(Error::io(&self.path, "cannot open"))?;
        let more = match self.header.encoding {
            Encoding::Ascii => self.stream_ascii(file, layout, vertices, &mut take)?,
            encoding => {
                let big_endian = encoding == Encoding::BigEndian;
                self.stream_binary(file, big_endian, layout, vertices, &mut take)?
            }
        };
        let mut report = tally.report(self.header.encoding == Encoding::Ascii);
        if vertices == self.element().count
            && self.vertex + 1 == self.header.elements.len()
            && let Some(more) = more
        {
            report.warnings.push(format!(
                "the header announces {vertices} vertices; {more} after them, which the header \
                 does not know of, were ignored"
            ));
        }
        Ok(report)
    }

    /// Gives what follows the vertices, if anything does.
    fn stream_binary(
        &self,
        file: File,
        big_endian: bool,
        layout: &Layout,
        vertices: u64,
        take: &mut dyn FnMut(Vec<Part>) -> Result<()>,
    ) -> Result<Option<String>> {
        let element = self.element();
        let mut items = Items::new(file, self.header.data_offset as u64, big_endian)
            .map_err(Error::io(&self.path, "cannot read"))?;
        for before in &self.header.elements[..self.vertex] {
            items.skip_element(before).map_err(|error| self.item_error(error, before))?;
        }
        let transcoder = Transcoder::new(layout, big_endian);
        let mut left = vertices;
        run_ahead(
            || {
                let mut spans = Vec::new();
                while left > 0 && spans.len() < batch_parts() {
                    let rows = BLOCK_POINTS.min(usize::try_from(left).unwrap_or(usize::MAX));
                    let span = items
                        .rows(element, rows)
                        .map_err(|error| self.item_error(error, element))?;
                    if span.len() != rows * transcoder.stride() {
                        return Err(self.item_error(ItemError::Short, element));
                    }
                    left -= rows as u64;
                    spans.push(span);
                }
                let parts: Vec<Part> =
                    spans.into_par_iter().map(|span| transcoder.blocks(&span)).collect();
                Ok((!parts.is_empty()).then_some(parts))
            },
            take,
        )?;
        Ok((items.bytes_left() > 0).then(|| format!("{} bytes", items.bytes_left())))
    }

    fn item_error(&self, error: ItemError, element: &Element) -> Error {
        match error {
            ItemError::Io(error) => Error::io(&self.path, "cannot read")(error),
            ItemError::Short => Error::input(
                self.info.path.clone(),
                format!(
                    "the header announces {} {} items, but the file ends before the last of them \
                     (or a list in it lies about its length): the file is cut short or damaged",
                    element.count, element.name
                ),
            ),
        }
    }

    /// Gives what follows the vertices, if anything does.
    fn stream_ascii(
        &self,
        mut file: File,
        layout: &Layout,
        vertices: u64,
        take: &mut dyn FnMut(Vec<Part>) -> Result<()>,
    ) -> Result<Option<String>> {
        file.seek(SeekFrom::Start(self.header.data_offset as u64))
            .map_err(Error::io(&self.path, "cannot read"))?;
        let mut lines = ItemLines::new(file, self.terminator, self.header.lines + 1);
        let next = |lines: &mut ItemLines<File>, most| {
            lines.next_lines(most).map_err(|error| match error {
                ChunkError::Io(error) => Error::io(&self.path, "cannot read")(error),
                ChunkError::EndlessLine(line) => Error::input(
                    self.info.path.clone(),
                    format!("line {line} does not end: the file is not ASCII PLY, or damaged"),
                ),
            })
        };
        for before in &self.header.elements[..self.vertex] {
            // An item without properties has no line.
            let mut left = if before.properties.is_empty() { 0 } else { before.count };
            while left > 0 {
                let (_, taken) = next(&mut lines, left)?
                    .ok_or_else(|| self.short_text(before, before.count - left))?;
                left -= taken;
            }
        }
        let mut left = vertices;
        run_ahead(
            || {
                let mut chunks = Vec::new();
                while left > 0 && chunks.len() < batch_parts() {
                    let (chunk, taken) = next(&mut lines, left)?
                        .ok_or_else(|| self.short_text(self.element(), vertices - left))?;
                    left -= taken;
                    chunks.push(chunk);
                }
                let parts = chunks
                    .into_par_iter()
                    .map(|chunk| ascii::blocks(layout, &chunk, self.terminator))
                    .collect::<Result<Vec<Part>, String>>()
                    .map_err(|why| Error::input(self.info.path.clone(), why))?;
                Ok((!parts.is_empty()).then_some(parts))
            },
            take,
        )?;
        Ok(next(&mut lines, 1)?.map(|_| "lines".to_owned()))
    }

    fn short_text(&self, element: &Element, found: u64) -> Error {
        Error::input(
            self.info.path.clone(),
            format!(
                "the header announces {} {} items, but only {found} follow: the file is cut short",
                element.count, element.name
            ),
        )
    }
}

impl PointReader for PlyReader {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn read(self: Box<Self>, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<ReadReport> {
        self.stream(&self.layout, self.element().count, sink)
    }
}

/// Whether a file of `size` bytes can hold the vertices that its header announces, and the
/// elements before them.
fn check_size(header: &Header, vertex: usize, size: u64) -> Result<(), String> {
    let data = size.saturating_sub(header.data_offset as u64);
    let mut needed = 0_u128;
    for element in &header.elements[..=vertex] {
        let item_bytes = match header.encoding {
            // A digit and a blank or line end per value; a file's last line end may be missing.
            Encoding::Ascii => 2 * element.properties.len() as u64,
            Encoding::LittleEndian | Encoding::BigEndian => least_row_bytes(element),
        };
        let before = needed;
        needed += u128::from(item_bytes) * u128::from(element.count);
        let slack = u128::from(header.encoding == Encoding::Ascii);
        if needed > u128::from(data) + slack {
            let room = (u128::from(data) + slack - before) / u128::from(item_bytes.max(1));
            let exactly = header.encoding != Encoding::Ascii && !has_lists(element);
            return Err(format!(
                "the header announces {} {} items, but the {data} bytes after it hold {} {room}: \
                 the file is cut short or its header wrong",
                element.count,
                element.name,
                if exactly && before == 0 { "only" } else { "at most" },
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
