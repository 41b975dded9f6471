//! Variable length records: what lies between the header and the points, and behind the points.
//!
//! Only the few records that matter are read; the rest is stepped over, however many the header
//! announces: a count beyond what the file holds ends the walk with a warning.

use std::ops::RangeInclusive;

use super::{file::PositionedFile, header::Header};
use crate::error::Result;

const RECORD_HEADER_BYTES: u64 = 54;
const EXTENDED_RECORD_HEADER_BYTES: u64 = 60;

/// Longest record that is read (descriptors and coordinate systems take far less), bytes.
const LONGEST_WANTED: u64 = 4 << 20;

/// Most records that are looked at: enough for any honest file, and a bound for the others.
const MOST_RECORDS: u32 = 1 << 16;

/// The records that matter.
#[derive(Debug, Default)]
pub(super) struct Records {
    /// Coordinate reference system as WKT.
    pub(super) wkt: Option<String>,
    /// GeoTIFF key directory.
    pub(super) geo_keys: Option<Vec<u8>>,
    /// Descriptors of extra bytes.
    pub(super) extra_bytes: Option<Vec<u8>>,
    /// The LASzip record.
    pub(super) laszip: Option<Vec<u8>>,
    /// What a user should know of.
    pub(super) warnings: Vec<String>,
}

/// What the header of a record says.
struct RecordHeader {
    user: [u8; 16],
    id: u16,
    data_start: u64,
    data_bytes: u64,
}

impl Records {
    /// Reads the records of `file`.
    pub(super) fn read(file: &PositionedFile, header: &Header) -> Result<Self> {
        let mut records = Self::default();
        records.walk(
            file,
            header.record_count,
            (header.records_start, header.points_start),
            "variable length records",
            RECORD_HEADER_BYTES,
        )?;
        if let Some((start, count)) = header.extended_records {
            // They lie behind the points: a position before these is a lie, and no record fits.
            let end = if start < header.points_start { start } else { file.size_bytes() };
            let span = (start, end);
            let what = "extended variable length records";
            records.walk(file, count, span, what, EXTENDED_RECORD_HEADER_BYTES)?;
        }
        Ok(records)
    }

    fn walk(
        &mut self,
        file: &PositionedFile,
        count: u32,
        (start, end): (u64, u64),
        what: &str,
        header_bytes: u64,
    ) -> Result<()> {
        let mut at = start;
        for seen in 0..count {
            let fits = end.checked_sub(at).is_some_and(|left| left >= header_bytes);
            let record = if fits && seen < MOST_RECORDS {
                Some(RecordHeader::read(file, at, header_bytes)?)
            } else {
                None
            };
            let next = record
                .as_ref()
                .and_then(|record| record.data_start.checked_add(record.data_bytes))
                .filter(|&next| next <= end);
            let (Some(record), Some(next)) = (record, next) else {
                self.warnings.push(format!(
                    "header announces {count} {what}, the file holds {seen}: those are read"
                ));
                return Ok(());
            };
            self.take(file, &record)?;
            at = next;
        }
        Ok(())
    }

    fn take(&mut self, file: &PositionedFile, record: &RecordHeader) -> Result<()> {
        if record.data_bytes > LONGEST_WANTED {
            return Ok(());
        }
        let user = record.user.split(|&byte| byte == 0).next().unwrap_or_default();
        let read = || file.read_vec_at(record.data_bytes as usize, record.data_start);
        // The first of its kind counts.
        match (user, record.id) {
            (b"LASF_Projection", 2112) if self.wkt.is_none() => self.wkt = wkt(&read()?),
            (b"LASF_Projection", 34735) if self.geo_keys.is_none() => {
                self.geo_keys = Some(read()?);
            }
            (b"LASF_Spec", 4) if self.extra_bytes.is_none() => self.extra_bytes = Some(read()?),
            (b"laszip encoded", 22204) if self.laszip.is_none() => self.laszip = Some(read()?),
            _ => {}
        }
        Ok(())
    }

    /// What is lost of the coordinate reference system, if anything.
    pub(super) fn lost_crs(&self) -> Option<String> {
        if self.wkt.is_some() {
            return None;
        }
        let keys = self.geo_keys.as_ref()?;
        let code = epsg_code(keys).map(|code| format!(" (EPSG:{code})")).unwrap_or_default();
        Some(format!("coordinate reference system{code}: given as GeoTIFF keys, only WKT is kept"))
    }
}

impl RecordHeader {
    fn read(file: &PositionedFile, at: u64, header_bytes: u64) -> Result<Self> {
        let mut bytes = [0; EXTENDED_RECORD_HEADER_BYTES as usize];
        file.read_exact_at(&mut bytes[..header_bytes as usize], at)?;
        let [_, _, rest @ ..] = bytes;
        let (user, rest) = rest.split_first_chunk().expect("16 of 58 bytes");
        let (id, rest) = rest.split_first_chunk().expect("2 of 42 bytes");
        let data_bytes = if header_bytes == EXTENDED_RECORD_HEADER_BYTES {
            u64::from_le_bytes(*rest.first_chunk().expect("8 of 40 bytes"))
        } else {
            u64::from(u16::from_le_bytes(*rest.first_chunk().expect("2 of 40 bytes")))
        };
        Ok(Self {
            user: *user,
            id: u16::from_le_bytes(*id),
            data_start: at + header_bytes,
            data_bytes,
        })
    }
}

/// The text of a WKT record, without the zeros that end it; `None` where it holds no WKT, which
/// always has brackets (some writers leave quotes or zeros).
fn wkt(bytes: &[u8]) -> Option<String> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_end_matches('\0').trim();
    text.contains(['[', '(']).then(|| text.to_owned())
}

/// The EPSG code of a GeoTIFF key directory: that of the projected system, else of the geographic.
fn epsg_code(directory: &[u8]) -> Option<u16> {
    const PROJECTED: u16 = 3072;
    const GEOGRAPHIC: u16 = 2048;
    // GeoTIFF 1.0, 6.1: below lie reserved codes, above them what users define.
    const EPSG_CODES: RangeInclusive<u16> = 1024..=32766;
    // Four numbers of version, then (key, location, count, value); location 0: the value is there.
    let find = |wanted: u16| {
        directory.chunks_exact(8).skip(1).find_map(|entry| {
            let number = |i: usize| u16::from_le_bytes([entry[2 * i], entry[2 * i + 1]]);
            (number(0) == wanted && number(1) == 0 && EPSG_CODES.contains(&number(3)))
                .then(|| number(3))
        })
    };
    find(PROJECTED).or_else(|| find(GEOGRAPHIC))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_projected_system_of_geotiff_keys() {
        let numbers: [u16; 12] = [1, 1, 0, 2, 2048, 0, 1, 4326, 3072, 0, 1, 26915];
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        assert_eq!(epsg_code(&bytes), Some(26915));
        assert_eq!(epsg_code(&bytes[..16]), Some(4326));
        assert_eq!(epsg_code(&bytes[..7]), None);
    }

    #[test]
    fn an_empty_wkt_record_is_none() {
        assert_eq!(wkt(b"\0\0"), None);
        assert_eq!(wkt(b"\"\""), None);
        assert_eq!(wkt(b"PROJCS[]\0\0"), Some("PROJCS[]".to_owned()));
    }
}
