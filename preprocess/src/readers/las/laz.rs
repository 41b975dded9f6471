//! Compressed points: chunks decoded in parallel, straight into blocks.
//!
//! Every chunk is independent, so runs of chunks that make about a block are units of
//! [`in_order`]. A file without a chunk table, or with chunks too large to hold several of, is
//! decoded serially, a block ahead of its consumer. Decoded records never leave the second-level
//! cache: a span of them is transcoded before the next is decoded.

use std::{
    io::{self, BufReader, Cursor},
    ops::Range,
};

use laz::record::{
    LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor,
};

use super::{
    chunks::{Chunk, Chunks, Coding, Laszip, LayeredHead},
    contain::contain,
    file::{PositionedFile, Span},
    ordered::in_order,
    transcode::{BlockBuilder, Transcoder},
};
use crate::{
    error::{Error, Result},
    readers::{Block, ahead::run_ahead},
};

/// Memory that decoding may take, whatever the number of threads, bytes.
const BUDGET_BYTES: u64 = 96 << 20;

/// The compressed points of a file.
#[derive(Debug)]
pub(super) struct LazPoints {
    pub(super) laszip: Laszip,
    pub(super) chunks: Chunks,
    /// Points announced by the header, which the chunks have been checked to hold.
    pub(super) points: u64,
}

impl LazPoints {
    /// Decodes every point; `sink` is called in file order.
    pub(super) fn read(
        &self,
        file: &PositionedFile,
        transcoder: &Transcoder,
        sink: &mut dyn FnMut(Block) -> Result<()>,
    ) -> Result<()> {
        if let Chunks::Known(chunks) = &self.chunks {
            let units = units(chunks, transcoder.block_points() as u64);
            let unit_bytes = |unit: &Range<usize>| -> u64 {
                chunks[unit.clone()]
                    .iter()
                    .map(|chunk| {
                        let decoded = chunk.points.saturating_mul(transcoder.point_bytes() as u64);
                        chunk.bytes.saturating_add(decoded)
                    })
                    .fold(0, u64::saturating_add)
            };
            let largest = units.iter().map(unit_bytes).max().unwrap_or(0).max(1);
            // What `in_order` holds at most is one more than its window.
            let window = usize::try_from(BUDGET_BYTES / largest).unwrap_or(usize::MAX);
            if window > 1 {
                return in_order(
                    units.len(),
                    (window - 1).min(2 * rayon::current_num_threads() + 1),
                    |unit| self.decode_unit(file, transcoder, chunks, units[unit].clone()),
                    |blocks| blocks.into_iter().try_for_each(&mut *sink),
                );
            }
        }
        let mut serial = Serial::new(self, file, transcoder);
        run_ahead(|| serial.next_block(), sink)
    }

    /// Decodes some consecutive chunks.
    fn decode_unit(
        &self,
        file: &PositionedFile,
        transcoder: &Transcoder,
        chunks: &[Chunk],
        unit: Range<usize>,
    ) -> Result<Vec<Block>> {
        let points = chunks[unit.clone()].iter().map(|chunk| chunk.points).sum();
        let mut blocks = Blocks::new(transcoder, points);
        for index in unit {
            let chunk = &chunks[index];
            let bytes = self.chunk_bytes(file, chunk, index, transcoder.record_bytes())?;
            contain(|| match self.laszip.coding {
                Coding::Layered => {
                    let mut decoder =
                        LayeredPointRecordDecompressor::new(Cursor::new(bytes.as_slice()));
                    decoder.set_fields_from(self.laszip.vlr.items()).map_err(io::Error::other)?;
                    blocks.fill(chunk.points, |records| decoder.decompress_many(records))
                }
                Coding::Chunked | Coding::PointWise => {
                    let mut decoder = SequentialPointRecordDecompressor::new(bytes.as_slice());
                    decoder.set_fields_from(self.laszip.vlr.items()).map_err(io::Error::other)?;
                    blocks.fill(chunk.points, |records| decoder.decompress_many(records))
                }
            })
            .unwrap_or_else(|panic| Err(io::Error::other(panic)))
            .map_err(|e| damaged(file, &format!("chunk {index}"), &e))?;
        }
        Ok(blocks.finish())
    }

    /// The bytes of a chunk; those of a layered one hold what they announce, so that the decoder
    /// reserves no more than is there.
    fn chunk_bytes(
        &self,
        file: &PositionedFile,
        chunk: &Chunk,
        index: usize,
        record_bytes: usize,
    ) -> Result<Vec<u8>> {
        let too_large = |_| file.error(format!("chunk {index} is too large for this machine"));
        let len = usize::try_from(chunk.bytes).map_err(too_large)?;
        let bytes = file.read_vec_at(len, chunk.start)?;
        if self.laszip.coding == Coding::Layered {
            let head = LayeredHead::parse(&bytes, record_bytes, self.laszip.layers());
            if head.is_none_or(|head| head.bytes > chunk.bytes || head.points < chunk.points) {
                return Err(file.error(format!(
                    "chunk {index} of the compressed points is damaged: it announces {} points \
                     in {} bytes, {} points in {} bytes are expected",
                    head.map_or(0, |head| head.points),
                    head.map_or(0, |head| head.bytes),
                    chunk.points,
                    chunk.bytes
                )));
            }
        }
        Ok(bytes)
    }
}

fn damaged(file: &PositionedFile, place: &str, error: &io::Error) -> Error {
    let why = if error.kind() == io::ErrorKind::UnexpectedEof {
        "they end too early".to_owned()
    } else {
        error.to_string()
    };
    file.error(format!("compressed points are cut short or damaged in {place}: {why}"))
}

/// Runs of chunks with at most `most` points each, or one chunk.
fn units(chunks: &[Chunk], most: u64) -> Vec<Range<usize>> {
    let mut units: Vec<Range<usize>> = Vec::new();
    let mut points = 0u64;
    for (index, chunk) in chunks.iter().enumerate() {
        points = points.saturating_add(chunk.points);
        match units.last_mut() {
            Some(unit) if points <= most => unit.end = index + 1,
            _ => {
                units.push(index..index + 1);
                points = chunk.points;
            }
        }
    }
    units
}

/// Blocks being filled with a known number of points.
struct Blocks<'a> {
    transcoder: &'a Transcoder,
    done: Vec<Block>,
    current: BlockBuilder,
    /// Points missing in `current`.
    room: usize,
    /// Points behind `current`.
    behind: u64,
    span: Vec<u8>,
}

impl<'a> Blocks<'a> {
    fn new(transcoder: &'a Transcoder, points: u64) -> Self {
        let room = Self::room_of(transcoder, points);
        Self {
            transcoder,
            done: Vec::new(),
            current: transcoder.block(room),
            room,
            behind: points - room as u64,
            span: vec![0; transcoder.span_points() * transcoder.record_bytes()],
        }
    }

    /// Points of the next block when `points` are left.
    fn room_of(transcoder: &Transcoder, points: u64) -> usize {
        let most = transcoder.block_points();
        usize::try_from(points).map_or(most, |points| points.min(most))
    }

    /// Adds `points` records, fetched by `fetch`.
    fn fill(
        &mut self,
        mut points: u64,
        mut fetch: impl FnMut(&mut [u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        while points > 0 {
            if self.room == 0 {
                self.room = Self::room_of(self.transcoder, self.behind);
                self.behind -= self.room as u64;
                let next = self.transcoder.block(self.room);
                self.done.push(std::mem::replace(&mut self.current, next).finish());
            }
            let most = self.room.min(self.transcoder.span_points());
            let count = usize::try_from(points).map_or(most, |points| points.min(most));
            let records = &mut self.span[..count * self.transcoder.record_bytes()];
            fetch(records)?;
            self.transcoder.append(records, &mut self.current);
            self.room -= count;
            points -= count as u64;
        }
        Ok(())
    }

    fn finish(mut self) -> Vec<Block> {
        self.done.push(self.current.finish());
        self.done
    }
}

/// Decodes a block after another.
struct Serial<'a> {
    points: &'a LazPoints,
    file: &'a PositionedFile,
    transcoder: &'a Transcoder,
    decoder: Option<SerialDecoder<'a>>,
    /// Index of the next chunk.
    next_chunk: usize,
    /// Points left in the current chunk.
    in_chunk: u64,
    /// Points left in the file.
    left: u64,
}

enum SerialDecoder<'a> {
    Run(Box<SequentialPointRecordDecompressor<'a, BufReader<Span<'a>>>>),
    Layers(Box<LayeredPointRecordDecompressor<'a, Cursor<Vec<u8>>>>),
}

impl<'a> Serial<'a> {
    fn new(points: &'a LazPoints, file: &'a PositionedFile, transcoder: &'a Transcoder) -> Self {
        let left = points.points;
        Self { points, file, transcoder, decoder: None, next_chunk: 0, in_chunk: 0, left }
    }

    /// The next block, which ends where its chunk does; `None` at the end.
    fn next_block(&mut self) -> Result<Option<Block>> {
        if self.left == 0 {
            return Ok(None);
        }
        contain(|| self.decode_block()).unwrap_or_else(|panic| {
            let done = self.points.points - self.left;
            Err(damaged(
                self.file,
                &format!("the block from point {done} on"),
                &io::Error::other(panic),
            ))
        })
    }

    fn decode_block(&mut self) -> Result<Option<Block>> {
        if self.in_chunk == 0 {
            self.open_chunk()?;
        }
        let most = self.transcoder.block_points();
        let count = usize::try_from(self.in_chunk).map_or(most, |points| points.min(most));
        let mut blocks = Blocks::new(self.transcoder, count as u64);
        let filled = match self.decoder.as_mut().expect("open_chunk sets it") {
            SerialDecoder::Run(decoder) => {
                blocks.fill(count as u64, |records| decoder.decompress_many(records))
            }
            SerialDecoder::Layers(decoder) => {
                blocks.fill(count as u64, |records| decoder.decompress_many(records))
            }
        };
        let (all, done) = (self.points.points, self.points.points - self.left);
        filled.map_err(|e| {
            damaged(self.file, &format!("the block from point {done} of {all} on"), &e)
        })?;
        self.in_chunk -= count as u64;
        self.left -= count as u64;
        Ok(blocks.finish().pop())
    }

    fn open_chunk(&mut self) -> Result<()> {
        let items = self.points.laszip.vlr.items();
        let refuse = |e: ::laz::LasZipError| self.file.error(format!("cannot be decoded: {e}"));
        let (span, points) = match &self.points.chunks {
            Chunks::Known(chunks) => {
                let index = self.next_chunk;
                // As many points as all chunks hold are asked for.
                let chunk = chunks.get(index).ok_or_else(|| {
                    self.file.error(format!("has no chunk {index} of compressed points"))
                })?;
                if self.points.laszip.coding == Coding::Layered {
                    let record_bytes = self.transcoder.record_bytes();
                    let bytes = self.points.chunk_bytes(self.file, chunk, index, record_bytes)?;
                    let mut decoder = LayeredPointRecordDecompressor::new(Cursor::new(bytes));
                    decoder.set_fields_from(items).map_err(refuse)?;
                    self.decoder = Some(SerialDecoder::Layers(Box::new(decoder)));
                    (None, chunk.points)
                } else {
                    let end = chunk.start + chunk.bytes;
                    (Some(Span::new(self.file, chunk.start, end)), chunk.points)
                }
            }
            Chunks::Unknown { start, points } => {
                // Each chunk begins where the decoder of the one before it has stopped.
                let span = match &mut self.decoder {
                    Some(SerialDecoder::Run(decoder)) => {
                        decoder.reset();
                        decoder.set_fields_from(items).map_err(refuse)?;
                        None
                    }
                    _ => Some(Span::new(self.file, *start, self.file.size_bytes())),
                };
                (span, *points)
            }
        };
        if let Some(span) = span {
            let mut decoder = SequentialPointRecordDecompressor::new(BufReader::new(span));
            decoder.set_fields_from(items).map_err(refuse)?;
            self.decoder = Some(SerialDecoder::Run(Box::new(decoder)));
        }
        self.next_chunk += 1;
        self.in_chunk = points.min(self.left);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{
        super::{
            header::Header,
            point_format::fields,
            records::Records,
            tests::scan::{Compression, Scan},
        },
        *,
    };

    fn chunk(points: u64) -> Chunk {
        Chunk { start: 0, bytes: 1, points }
    }

    #[test]
    fn groups_small_chunks_and_leaves_large_ones_alone() {
        let chunks: Vec<Chunk> = [30, 30, 50, 200, 10, 90, 1].map(chunk).into();
        assert_eq!(units(&chunks, 100), [0..2, 2..3, 3..4, 4..6, 6..7]);
        assert!(units(&[], 100).is_empty());
    }

    #[test]
    fn decodes_serially_what_it_decodes_in_parallel() -> Result<()> {
        for format in [1, 7] {
            let scan = Scan::new(format, 5000, 2, Compression::Fixed(700));
            let temporary = scan.file();
            let file = PositionedFile::open(temporary.path())?;
            let mut header = Header::read(&file)?;
            let record = Records::read(&file, &header)?.laszip.expect("the points are compressed");
            let laszip = Laszip::parse(&file, &header, &record)?;
            let chunks = Chunks::find(&file, &mut header, &laszip)?;
            let points = LazPoints { laszip, chunks, points: header.points };
            let (fields, format_bytes) = fields(format).expect("a known format");
            let (transcoder, _) = Transcoder::new(header.record_bytes, format_bytes, &fields, &[]);

            let (mut parallel, mut serial) = (Vec::new(), Vec::new());
            points.read(&file, &transcoder, &mut |block| {
                parallel.extend(block.attributes);
                Ok(())
            })?;
            let mut decoder = Serial::new(&points, &file, &transcoder);
            while let Some(block) = decoder.next_block()? {
                serial.extend(block.attributes);
            }
            assert!(serial == parallel, "format {format}");
        }
        Ok(())
    }
}
