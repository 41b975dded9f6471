//! LAS and LAZ, versions 1.0 to 1.5, point formats 0 to 10; COPC files are LAZ files.
//!
//! The `las` crate parses the header and the `laz` crate decodes compressed points. Between them
//! and the blocks lies our own path, without a struct for each point: spans of records are read
//! with positioned reads, or decoded by chunks, on all threads, and copied into blocks by a list of
//! moves made up beforehand.
//!
//! | file | what |
//! | --- | --- |
//! | `file` | positioned reads |
//! | `header` | the public header, checked |
//! | `records` | variable length records: coordinate system, extra bytes, LASzip |
//! | `point_format` | which field lies where |
//! | `extra_bytes` | attributes beyond the point format |
//! | `transcode` | records to blocks |
//! | `chunks`, `laz` | where compressed chunks lie; decoding them |
//! | `ordered` | parallel work delivered in order |
//! | `contain` | a decoder's panics become errors |

mod chunks;
mod contain;
pub(crate) mod extra_bytes;
mod file;
mod header;
mod laz;
mod ordered;
pub(crate) mod point_format;
mod records;
#[cfg(test)]
pub(crate) mod tests;
mod transcode;

use std::path::Path;

use self::{
    chunks::{Chunks, Laszip},
    extra_bytes::ExtraBytes,
    file::PositionedFile,
    header::Header,
    laz::LazPoints,
    ordered::in_order,
    point_format::fields,
    records::Records,
    transcode::Transcoder,
};
use crate::{
    error::Result,
    readers::{Block, CoordinateKind, InputInfo, PointReader, ReadReport},
};

/// Opens a LAS or LAZ file and checks all that can be checked without reading its points.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) where the file is not LAS, cannot hold what it announces,
/// or uses what is not known; [`Error::Io`](crate::Error::Io) where it cannot be read.
pub fn open(path: &Path) -> Result<Box<dyn PointReader>> {
    let file = PositionedFile::open(path)?;
    let mut header = Header::read(&file)?;
    let records = Records::read(&file, &header)?;
    let compressed = if header.compressed {
        let Some(record) = &records.laszip else {
            return Err(file.error("is compressed, but has no LASzip record: it is damaged"));
        };
        let laszip = Laszip::parse(&file, &header, record)?;
        let chunks = Chunks::find(&file, &mut header, &laszip)?;
        Some(LazPoints { laszip, chunks, points: header.points })
    } else {
        header.check_uncompressed_size(&file)?;
        None
    };

    let (fields, format_bytes) =
        fields(header.format).expect("the header's format has been checked");
    let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
    let descriptors = records.extra_bytes.as_deref().unwrap_or_default();
    let extra = ExtraBytes::parse(descriptors, header.record_bytes - format_bytes, &names);
    let (transcoder, attributes) =
        Transcoder::new(header.record_bytes, format_bytes, &fields, &extra.attributes);

    let mut left_out: Vec<String> = records.lost_crs().into_iter().collect();
    if header.has_waveforms {
        left_out.push("waveforms: only the points' references to them are kept".to_owned());
    }
    left_out.extend(extra.left_out);
    let mut warnings = std::mem::take(&mut header.warnings);
    warnings.extend(records.warnings);
    warnings.extend(extra.warnings);
    let info = InputInfo {
        path: file.name(),
        points: Some(header.points),
        coordinates: CoordinateKind::Scaled { scale: header.scale, offset: header.offset },
        attributes,
        crs: records.wkt,
        left_out,
    };
    Ok(Box::new(LasReader { file, header, compressed, transcoder, info, warnings }))
}

struct LasReader {
    file: PositionedFile,
    header: Header,
    compressed: Option<LazPoints>,
    transcoder: Transcoder,
    info: InputInfo,
    warnings: Vec<String>,
}

impl PointReader for LasReader {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn read(self: Box<Self>, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<ReadReport> {
        match &self.compressed {
            Some(points) => points.read(&self.file, &self.transcoder, sink)?,
            None => self.read_uncompressed(sink)?,
        }
        Ok(ReadReport {
            points_read: self.header.points,
            warnings: self.warnings,
            ..ReadReport::default()
        })
    }
}

impl LasReader {
    fn read_uncompressed(&self, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<()> {
        let block_points = self.transcoder.block_points() as u64;
        let blocks = self.header.points.div_ceil(block_points);
        let blocks = usize::try_from(blocks)
            .map_err(|_| self.file.error("has more points than this machine can count"))?;
        let window = 2 * rayon::current_num_threads() + 1;
        let read_block = |block: usize| {
            let first = block as u64 * block_points;
            let count = block_points.min(self.header.points - first);
            self.read_block(first, usize::try_from(count).expect("at most a block"))
        };
        in_order(blocks, window, read_block, sink)
    }

    fn read_block(&self, first: u64, count: usize) -> Result<Block> {
        let record_bytes = self.transcoder.record_bytes();
        let span_points = self.transcoder.span_points();
        let mut span = vec![0; span_points.min(count) * record_bytes];
        let mut block = self.transcoder.block(count);
        for done in (0..count).step_by(span_points) {
            let records = &mut span[..span_points.min(count - done) * record_bytes];
            let start = (first + done as u64) * record_bytes as u64;
            self.file.read_exact_at(records, self.header.points_start + start)?;
            self.transcoder.append(records, &mut block);
        }
        Ok(block.finish())
    }
}
