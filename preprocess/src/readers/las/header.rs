//! The public header, checked: whoever holds a [`Header`] can trust its numbers.
//!
//! The `las` crate parses the fields; the checks are ours, because its parser is permissive: it
//! lets pass what no file can hold.

use las::{Version, raw};

use super::{
    file::PositionedFile,
    point_format::{LAST_FORMAT, fields},
};
use crate::error::Result;

/// Shortest header of any version, bytes.
const SHORTEST_HEADER: u64 = 227;

/// Bytes before the points of a LAS 1.0 file; some writers count them to the points.
const POINT_DATA_START_SIGNATURE: [u8; 2] = [0xDD, 0xCC];

/// What the header says and the file can hold.
#[derive(Debug)]
pub(super) struct Header {
    /// Point record format, 0 to 10.
    pub(super) format: u8,
    /// Whether the points are LAZ.
    pub(super) compressed: bool,
    /// Bytes of a point record.
    pub(super) record_bytes: usize,
    /// Points announced.
    pub(super) points: u64,
    /// World units per integer step.
    pub(super) scale: [f64; 3],
    /// World coordinate of integer zero.
    pub(super) offset: [f64; 3],
    /// Position of the first variable length record.
    pub(super) records_start: u64,
    /// Variable length records announced (not yet believed).
    pub(super) record_count: u32,
    /// Position of the first point, or of the LAZ chunk table's position.
    pub(super) points_start: u64,
    /// Where points end at the latest: the end of the file, or what lies behind the points.
    pub(super) points_end: u64,
    /// Position and announced number of extended variable length records.
    pub(super) extended_records: Option<(u64, u32)>,
    /// Whether points refer to waveforms.
    pub(super) has_waveforms: bool,
    /// What a user should know of.
    pub(super) warnings: Vec<String>,
}

impl Header {
    /// Reads and checks the header of `file`.
    pub(super) fn read(file: &PositionedFile) -> Result<Self> {
        let size = file.size_bytes();
        if size == 0 {
            return Err(file.error("is empty"));
        }
        let head_bytes = size.min(u64::from(u16::MAX));
        let mut head = file.read_vec_at(head_bytes as usize, 0)?;
        if !head.starts_with(b"LASF") {
            return Err(file.error("is not a LAS or LAZ file: it does not start with LASF"));
        }
        if size < SHORTEST_HEADER {
            return Err(file.error(format!(
                "is cut short: a LAS header takes {SHORTEST_HEADER} bytes, the file has {size}"
            )));
        }
        let (major, minor) = (head[24], head[25]);
        if major != 1 || minor > 5 {
            return Err(file.error(format!(
                "announces LAS version {major}.{minor}; versions 1.0 to 1.5 can be read"
            )));
        }
        // The 1.5 header is that of 1.4 with fields added at its end; the parser knows 1.4.
        head[25] = minor.min(4);
        let raw = raw::Header::read_from(head.as_slice())
            .map_err(|e| file.error(format!("has a header that cannot be read: {e}")))?;
        Self::check(file, &raw)
    }

    fn check(file: &PositionedFile, raw: &raw::Header) -> Result<Self> {
        let size = file.size_bytes();
        // LASzip marks compressed points in the two highest bits of the format.
        let compressed = raw.point_data_record_format & 0xC0 != 0;
        let format = raw.point_data_record_format & 0x3F;
        let Some((_, format_bytes)) = fields(format) else {
            return Err(file.error(format!(
                "has point record format {format}; formats 0 to {LAST_FORMAT} can be read"
            )));
        };
        let record_bytes = usize::from(raw.point_data_record_length);
        if record_bytes < format_bytes {
            return Err(file.error(format!(
                "announces point records of {record_bytes} bytes; format {format} takes \
                 {format_bytes}"
            )));
        }
        let scale = [raw.x_scale_factor, raw.y_scale_factor, raw.z_scale_factor];
        let offset = [raw.x_offset, raw.y_offset, raw.z_offset];
        for (axis, (scale, offset)) in ["x", "y", "z"].iter().zip(scale.iter().zip(offset)) {
            if !(scale.is_finite() && *scale > 0.0) {
                return Err(file.error(format!(
                    "has the {axis} scale factor {scale}: it must be a number above zero"
                )));
            }
            if !offset.is_finite() {
                return Err(file
                    .error(format!("has the {axis} offset {offset}: it must be a finite number")));
            }
        }
        let records_start = u64::from(raw.header_size);
        let mut points_start = u64::from(raw.offset_to_point_data);
        if points_start < SHORTEST_HEADER || points_start > size {
            return Err(file.error(format!(
                "announces its points at byte {points_start}, but has {size} bytes: it is cut \
                 short or damaged"
            )));
        }
        let mut warnings = Vec::new();
        let points = announced_points(raw, &mut warnings);
        if raw.version == Version::new(1, 0)
            && !compressed
            && counts_start_signature(file, points_start, record_bytes as u64, points)?
        {
            points_start += POINT_DATA_START_SIGNATURE.len() as u64;
        }
        let extended_records = raw.evlr.map(|e| (e.start_of_first_evlr, e.number_of_evlrs));
        let points_end = extended_records
            .map(|(start, _)| start)
            .into_iter()
            .chain(raw.start_of_waveform_data_packet_record)
            .filter(|&start| start >= points_start && start <= size)
            .fold(size, u64::min);
        Ok(Self {
            format,
            compressed,
            record_bytes,
            points,
            scale,
            offset,
            records_start,
            record_count: raw.number_of_variable_length_records,
            points_start,
            points_end,
            extended_records,
            has_waveforms: matches!(format, 4 | 5 | 9 | 10),
            warnings,
        })
    }

    /// Checks that uncompressed points are all there; warns where there are more.
    pub(super) fn check_uncompressed_size(&mut self, file: &PositionedFile) -> Result<()> {
        let held = |end: u64| (end - self.points_start) / self.record_bytes as u64;
        let in_file = held(file.size_bytes());
        if self.points > in_file {
            return Err(file.error(format!(
                "header announces {} points, the file holds {in_file}: it is cut short or damaged",
                self.points
            )));
        }
        let before_records = held(self.points_end);
        if self.points < before_records {
            self.warnings.push(format!(
                "header announces {} points, the file holds {before_records}: the announced ones \
                 are read",
                self.points
            ));
        }
        Ok(())
    }
}

/// The number of points: LAS 1.4 has two fields for it. Where they differ, the specification
/// (1.4 R15, 2.4 "Legacy Point Counts") gives the older one precedence unless it is zero.
fn announced_points(raw: &raw::Header, warnings: &mut Vec<String>) -> u64 {
    let legacy = u64::from(raw.number_of_point_records);
    let Some(extended) = raw.large_file.map(|large| large.number_of_point_records) else {
        return legacy;
    };
    if legacy == 0 {
        return extended;
    }
    if extended != legacy {
        warnings.push(format!(
            "header announces {extended} points and, in its legacy field, {legacy}: {legacy} are \
             read, as the specification asks"
        ));
    }
    legacy
}

/// LAS 1.0 has two signature bytes before its points. The header's position should lie behind
/// them; where it lies before them, they are there and leave exactly two bytes over.
fn counts_start_signature(
    file: &PositionedFile,
    points_start: u64,
    record_bytes: u64,
    points: u64,
) -> Result<bool> {
    let signature_bytes = POINT_DATA_START_SIGNATURE.len() as u64;
    let data_bytes = file.size_bytes() - points_start;
    if points.checked_mul(record_bytes).and_then(|bytes| bytes.checked_add(signature_bytes))
        != Some(data_bytes)
    {
        return Ok(false);
    }
    let mut bytes = [0; POINT_DATA_START_SIGNATURE.len()];
    file.read_exact_at(&mut bytes, points_start)?;
    Ok(bytes == POINT_DATA_START_SIGNATURE)
}
