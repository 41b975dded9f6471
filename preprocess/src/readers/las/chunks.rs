//! Where the compressed chunks of a LAZ file lie and how many points each holds.
//!
//! Chunks are independent of one another, so knowing them is what lets all threads decode. They are
//! found in the chunk table, or for layered chunks, which tell their own size, by walking along
//! them. Every number is checked against the file before it is used: the crate's own reader of the
//! table reserves memory for whatever number of chunks is announced.

use std::io::Cursor;

use laz::{LazItemType, LazVlr, laszip::ChunkTable};

use super::{contain::contain, file::PositionedFile, header::Header};
use crate::error::Result;

/// Most extra bytes of a compressed point: the decoder takes some ten kilobytes for each of them.
const MOST_EXTRA_BYTES: usize = 4096;

/// How the compressed points are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    /// One run of points (LASzip 1).
    PointWise,
    /// Chunks of points, each a run.
    Chunked,
    /// Chunks of points, each a set of layers (formats 6 to 10).
    Layered,
}

/// The LASzip record, checked against the header.
#[derive(Debug)]
pub(super) struct Laszip {
    pub(super) vlr: LazVlr,
    pub(super) coding: Coding,
}

/// One chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Chunk {
    /// Position of its first byte.
    pub(super) start: u64,
    /// Its compressed bytes.
    pub(super) bytes: u64,
    /// Its points.
    pub(super) points: u64,
}

/// The chunks of a file.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Chunks {
    /// Where each of them is, in file order; their points add up to those announced.
    Known(Vec<Chunk>),
    /// One after another from `start` on, `points` each, in a file without a table.
    Unknown {
        /// Position of the first.
        start: u64,
        /// Points of each but the last.
        points: u64,
    },
}

impl Laszip {
    /// Parses the record and checks that it describes the header's points.
    pub(super) fn parse(file: &PositionedFile, header: &Header, record: &[u8]) -> Result<Self> {
        let refuse = |why: String| file.error(format!("has a LASzip record that {why}"));
        let &[c0, c1, coder0, coder1, ..] = record else {
            return Err(refuse(format!("has {} bytes", record.len())));
        };
        let coding = match u16::from_le_bytes([c0, c1]) {
            1 => Coding::PointWise,
            2 => Coding::Chunked,
            3 => Coding::Layered,
            other => return Err(refuse(format!("names compressor {other}; 1 to 3 are known"))),
        };
        let coder = u16::from_le_bytes([coder0, coder1]);
        if coder != 0 {
            return Err(refuse(format!("names entropy coder {coder}; only 0 is known")));
        }
        let vlr = LazVlr::from_buffer(record).map_err(|e| refuse(format!("is damaged: {e}")))?;
        let mut bytes = 0;
        let mut extra_bytes = 0;
        for item in vlr.items() {
            let is_known = match coding {
                Coding::PointWise | Coding::Chunked => matches!(item.version(), 1 | 2),
                Coding::Layered => matches!(item.version(), 3 | 4),
            };
            if !is_known || item.size() != item_bytes(item.item_type()) {
                return Err(refuse(format!(
                    "describes {:?} of version {} in {} bytes, which cannot be decoded",
                    item.item_type(),
                    item.version(),
                    item.size()
                )));
            }
            bytes += usize::from(item.size());
            if let LazItemType::Byte(_) | LazItemType::Byte14(_) = item.item_type() {
                extra_bytes += usize::from(item.size());
            }
        }
        if extra_bytes > MOST_EXTRA_BYTES {
            return Err(refuse(format!(
                "describes {extra_bytes} extra bytes a point; at most {MOST_EXTRA_BYTES} can be \
                 decoded"
            )));
        }
        if bytes != header.record_bytes {
            return Err(refuse(format!(
                "describes points of {bytes} bytes; the header's have {}",
                header.record_bytes
            )));
        }
        Ok(Self { vlr, coding })
    }

    /// Layers of a chunk; their sizes are listed behind its first point and its point count.
    pub(super) fn layers(&self) -> usize {
        let layers = |item: &laz::LazItem| match item.item_type() {
            LazItemType::Point14 => 9,
            LazItemType::RGBNIR14 => 2,
            LazItemType::Byte14(bytes) => usize::from(bytes),
            _ => 1,
        };
        self.vlr.items().iter().map(layers).sum()
    }
}

fn item_bytes(item: LazItemType) -> u16 {
    match item {
        LazItemType::Byte(bytes) | LazItemType::Byte14(bytes) => bytes,
        LazItemType::Point10 => 20,
        LazItemType::GpsTime => 8,
        LazItemType::RGB12 | LazItemType::RGB14 => 6,
        LazItemType::WavePacket13 | LazItemType::WavePacket14 => 29,
        LazItemType::Point14 => 30,
        LazItemType::RGBNIR14 => 8,
    }
}

impl Chunks {
    /// Finds the chunks; adds to the header's warnings where it announces fewer points than there
    /// are.
    pub(super) fn find(
        file: &PositionedFile,
        header: &mut Header,
        laszip: &Laszip,
    ) -> Result<Self> {
        if header.points == 0 {
            return Ok(Self::Known(Vec::new()));
        }
        if laszip.coding == Coding::PointWise {
            return Ok(Self::Unknown { start: header.points_start, points: header.points });
        }
        let first = header.points_start + ChunkTable::OFFSET_SIZE as u64;
        let Some(table_start) = table_start(file, header.points_start)? else {
            return if laszip.coding == Coding::Layered {
                walk_layered(file, header, laszip, first).map(Self::Known)
            } else if laszip.vlr.uses_variable_size_chunks() {
                Err(file.error("has chunks of varying size but no table of them: it is damaged"))
            } else {
                let points = u64::from(laszip.vlr.chunk_size());
                Ok(Self::Unknown { start: first, points })
            };
        };
        let entries = read_table(file, header, laszip, first, table_start)?;
        place(file, header, laszip, &entries, first, table_start).map(Self::Known)
    }
}

/// Position of the chunk table; `None` where its writer could not note it.
fn table_start(file: &PositionedFile, points_start: u64) -> Result<Option<u64>> {
    const NOTE_BYTES: u64 = ChunkTable::OFFSET_SIZE as u64;
    let size = file.size_bytes();
    if size - points_start < NOTE_BYTES {
        return Err(file.error("is cut short: there are no compressed points"));
    }
    // Writers that could not go back left -1 there and the position in the file's last bytes.
    for note in [points_start, size - NOTE_BYTES] {
        let mut bytes = [0; NOTE_BYTES as usize];
        file.read_exact_at(&mut bytes, note)?;
        let Ok(start) = u64::try_from(i64::from_le_bytes(bytes)) else { continue };
        if start < points_start + NOTE_BYTES {
            continue;
        }
        if start > size - NOTE_BYTES {
            if note == points_start {
                return Err(file.error(format!(
                    "is cut short: its chunk table should be at byte {start}, the file has {size} \
                     bytes"
                )));
            }
            continue;
        }
        return Ok(Some(start));
    }
    Ok(None)
}

fn read_table(
    file: &PositionedFile,
    header: &Header,
    laszip: &Laszip,
    first: u64,
    table_start: u64,
) -> Result<ChunkTable> {
    let mut head = [0; 8];
    file.read_exact_at(&mut head, table_start)?;
    let [.., c0, c1, c2, c3] = head;
    let count = u32::from_le_bytes([c0, c1, c2, c3]);
    // A chunk starts with its first point as it is, so that the bytes bound the number of chunks.
    let most = (table_start - first) / header.record_bytes as u64 + 1;
    if u64::from(count) > most {
        return Err(file.error(format!(
            "has a damaged chunk table: it announces {count} chunks, the file holds at most {most}"
        )));
    }
    // Two numbers of 32 bits a chunk, which compression never makes twice as long.
    let longest = head.len() as u64 + 16 * (u64::from(count) + 1);
    let len = usize::try_from(longest.min(file.size_bytes() - table_start))
        .map_err(|_| file.error(format!("has {count} chunks, too many for this machine")))?;
    let table = file.read_vec_at(len, table_start)?;
    let variable = laszip.vlr.uses_variable_size_chunks();
    contain(|| ChunkTable::read(&mut Cursor::new(table.as_slice()), variable))
        .map_err(|panic| file.error(format!("has a damaged chunk table: {panic}")))?
        .map_err(|e| file.error(format!("has a chunk table that cannot be read: {e}")))
}

/// Positions of the table's chunks, up to the one that holds the last announced point.
fn place(
    file: &PositionedFile,
    header: &mut Header,
    laszip: &Laszip,
    table: &ChunkTable,
    first: u64,
    table_start: u64,
) -> Result<Vec<Chunk>> {
    let variable = laszip.vlr.uses_variable_size_chunks();
    let mut chunks = Vec::with_capacity(table.len());
    let (mut start, mut points, mut has_more) = (first, 0u64, false);
    for (index, entry) in table.into_iter().enumerate() {
        let end = start.checked_add(entry.byte_count).filter(|&end| end <= table_start);
        let Some(end) = end else {
            return Err(file.error(format!(
                "has a damaged chunk table: chunk {index} of {} would end behind the chunks",
                table.len()
            )));
        };
        let chunk = Chunk { start, bytes: end - start, points: 0 };
        // A table of fixed chunks says nothing of the last one, which may hold fewer.
        let in_chunk =
            if variable { entry.point_count } else { u64::from(laszip.vlr.chunk_size()) };
        let wanted = in_chunk.min(header.points - points);
        has_more |= if variable { in_chunk > wanted } else { wanted == 0 && chunk.bytes > 0 };
        if wanted > 0 {
            chunks.push(Chunk { points: wanted, ..chunk });
        }
        points += wanted;
        start = end;
    }
    if laszip.coding == Coding::Layered
        && let Some(last) = chunks.last()
    {
        let head = LayeredHead::read(file, header, laszip, last.start, start)?;
        let held = head.map_or(0, |head| head.points);
        points = points - last.points + held.min(last.points);
        has_more |= held > last.points;
    }
    check_count(file, header, points, has_more)?;
    Ok(chunks)
}

fn check_count(
    file: &PositionedFile,
    header: &mut Header,
    held: u64,
    has_more: bool,
) -> Result<()> {
    if held < header.points {
        return Err(file.error(format!(
            "header announces {} points, the file holds {held}: it is cut short or damaged",
            header.points
        )));
    }
    if has_more {
        header.warnings.push(format!(
            "header announces {} points, the file holds more: the announced ones are read",
            header.points
        ));
    }
    Ok(())
}

/// What a layered chunk says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct LayeredHead {
    /// Its points.
    pub(super) points: u64,
    /// Its bytes.
    pub(super) bytes: u64,
}

impl LayeredHead {
    /// Bytes that it takes: the first point, the number of points, the sizes of the layers.
    fn size_bytes(record_bytes: usize, layers: usize) -> usize {
        record_bytes + 4 + 4 * layers
    }

    /// Parses the start of a chunk; `None` where it is too short.
    pub(super) fn parse(chunk: &[u8], record_bytes: usize, layers: usize) -> Option<Self> {
        let head_bytes = Self::size_bytes(record_bytes, layers);
        let (numbers, rest) = chunk.get(record_bytes..head_bytes)?.as_chunks::<4>();
        debug_assert!(rest.is_empty(), "whole numbers, by its size");
        let (count, sizes) = numbers.split_first()?;
        let in_layers: u64 = sizes.iter().map(|&size| u64::from(u32::from_le_bytes(size))).sum();
        Some(Self {
            points: u64::from(u32::from_le_bytes(*count)),
            bytes: head_bytes as u64 + in_layers,
        })
    }

    /// Reads the head of the chunk at `start`; `None` where it does not fit before `end`.
    fn read(
        file: &PositionedFile,
        header: &Header,
        laszip: &Laszip,
        start: u64,
        end: u64,
    ) -> Result<Option<Self>> {
        let head_bytes = Self::size_bytes(header.record_bytes, laszip.layers());
        if start.checked_add(head_bytes as u64).is_none_or(|head_end| head_end > end) {
            return Ok(None);
        }
        let bytes = file.read_vec_at(head_bytes, start)?;
        Ok(Self::parse(&bytes, header.record_bytes, laszip.layers()))
    }
}

/// Finds layered chunks without a table, from one to the next.
fn walk_layered(
    file: &PositionedFile,
    header: &mut Header,
    laszip: &Laszip,
    first: u64,
) -> Result<Vec<Chunk>> {
    let end = header.points_end;
    let (mut chunks, mut start, mut points) = (Vec::new(), first, 0u64);
    while points < header.points {
        let Some(head) = LayeredHead::read(file, header, laszip, start, end)? else { break };
        let Some(next) = start.checked_add(head.bytes).filter(|&next| next <= end) else { break };
        let wanted = head.points.min(header.points - points);
        if wanted > 0 {
            chunks.push(Chunk { start, bytes: head.bytes, points: wanted });
        }
        points += wanted;
        start = next;
    }
    check_count(file, header, points, false)?;
    Ok(chunks)
}
