//! LAS and LAZ files, byte by byte, honest or not.

use std::io::{Cursor, Write as _};

use las::{Version, raw};
use laz::{LasZipCompressor, LazVlr, LazVlrBuilder, ParLasZipCompressor};
use tempfile::NamedTempFile;

use crate::readers::{las::point_format::fields, testing::file};

/// How points are compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compression {
    None,
    /// Chunks of this many points.
    Fixed(u32),
    /// Chunks of one, two, three, … points.
    Variable,
}

/// A file to be.
#[derive(Debug, Clone)]
pub(crate) struct Scan {
    pub(crate) header: raw::Header,
    pub(crate) compression: Compression,
    /// User, id, data.
    pub(crate) records: Vec<(&'static str, u16, Vec<u8>)>,
    pub(crate) extended_records: Vec<(&'static str, u16, Vec<u8>)>,
    /// Point records, one after another.
    pub(crate) points: Vec<u8>,
}

impl Scan {
    /// `points` points of `format` with `extra` undescribed bytes each; their bytes are arbitrary
    /// but always the same, except that neighbours are alike, as in a scan.
    pub(crate) fn new(format: u8, points: usize, extra: usize, compression: Compression) -> Self {
        let (_, format_bytes) = fields(format).expect("formats 0 to 10");
        let record_bytes = format_bytes + extra;
        let bytes: Vec<u8> = (0..points)
            .flat_map(|point| {
                (0..record_bytes).map(move |at| {
                    let seed = (point as u64 / 3) * 131 + at as u64 * 7919;
                    (seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 56) as u8 ^ (point % 5) as u8
                })
            })
            .collect();
        let version = Version::new(1, 4);
        let header = raw::Header {
            version,
            header_size: version.header_size(),
            point_data_record_format: format,
            point_data_record_length: record_bytes as u16,
            number_of_point_records: if format < 6 { points as u32 } else { 0 },
            large_file: Some(raw::header::LargeFile {
                number_of_point_records: points as u64,
                ..raw::header::LargeFile::default()
            }),
            x_scale_factor: 0.01,
            y_scale_factor: 0.02,
            z_scale_factor: 0.001,
            x_offset: 500_000.0,
            y_offset: 5_000_000.0,
            z_offset: -1.0,
            ..raw::Header::default()
        };
        Self {
            header,
            compression,
            records: Vec::new(),
            extended_records: Vec::new(),
            points: bytes,
        }
    }

    /// As an older version: 1.0 to 1.3.
    pub(crate) fn with_version(mut self, minor: u8) -> Self {
        self.header.version = Version::new(1, minor);
        self.header.header_size = self.header.version.header_size();
        self.header.large_file = None;
        self
    }

    pub(crate) fn record_bytes(&self) -> usize {
        usize::from(self.header.point_data_record_length)
    }

    /// Announces this many points.
    pub(crate) fn announcing(mut self, points: u64) -> Self {
        if self.header.number_of_point_records > 0 {
            self.header.number_of_point_records = points as u32;
        }
        if let Some(large) = &mut self.header.large_file {
            large.number_of_point_records = points;
        }
        self
    }

    pub(crate) fn laz_vlr(&self) -> LazVlr {
        let format = self.header.point_data_record_format;
        let (_, format_bytes) = fields(format).expect("formats 0 to 10");
        let builder = LazVlrBuilder::default()
            .with_point_format(format, (self.record_bytes() - format_bytes) as u16)
            .expect("formats 0 to 10");
        match self.compression {
            Compression::Fixed(points) => builder.with_fixed_chunk_size(points),
            _ => builder.with_variable_chunk_size(),
        }
        .build()
    }

    /// The whole file.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut header = self.header.clone();
        let mut records = self.records.clone();
        if self.compression != Compression::None {
            header.point_data_record_format |= 0x80;
            let mut data = Vec::new();
            self.laz_vlr().write_to(&mut data).expect("memory can be written");
            records.push((LazVlr::USER_ID, LazVlr::RECORD_ID, data));
        }
        header.number_of_variable_length_records += records.len() as u32;
        let records: Vec<u8> = records.iter().flat_map(|record| vlr(record, false)).collect();
        header.offset_to_point_data = u32::from(header.header_size) + records.len() as u32;

        let mut out = Cursor::new(vec![0; header.offset_to_point_data as usize]);
        out.set_position(u64::from(header.offset_to_point_data));
        match self.compression {
            Compression::None => out.write_all(&self.points).expect("memory can be written"),
            Compression::Fixed(_) => {
                let mut laz = LasZipCompressor::new(&mut out, self.laz_vlr()).expect("sound");
                laz.compress_many(&self.points).expect("memory can be written");
                laz.done().expect("memory can be written");
            }
            Compression::Variable => {
                let mut laz = ParLasZipCompressor::new(&mut out, self.laz_vlr()).expect("sound");
                let mut chunks = Vec::new();
                let mut rest = self.points.as_slice();
                while !rest.is_empty() {
                    let len = ((chunks.len() + 1) * self.record_bytes()).min(rest.len());
                    let (chunk, behind) = rest.split_at(len);
                    chunks.push(chunk);
                    rest = behind;
                }
                laz.compress_chunks(chunks).expect("memory can be written");
                laz.done().expect("memory can be written");
            }
        }
        let mut bytes = out.into_inner();
        if !self.extended_records.is_empty() {
            header.evlr = Some(raw::header::Evlr {
                start_of_first_evlr: bytes.len() as u64,
                number_of_evlrs: self.extended_records.len() as u32,
            });
            bytes.extend(self.extended_records.iter().flat_map(|record| vlr(record, true)));
        }
        let mut head = Vec::new();
        header.write_to(&mut head).expect("memory can be written");
        bytes[..head.len()].copy_from_slice(&head);
        let start = usize::from(header.header_size);
        bytes[start..start + records.len()].copy_from_slice(&records);
        bytes
    }

    /// The whole file, on disk.
    pub(crate) fn file(&self) -> NamedTempFile {
        file(&self.bytes())
    }
}

fn vlr((user, id, data): &(&str, u16, Vec<u8>), extended: bool) -> Vec<u8> {
    let mut user_id = [0; 16];
    user_id[..user.len()].copy_from_slice(user.as_bytes());
    let length = if extended {
        raw::vlr::RecordLength::Evlr(data.len() as u64)
    } else {
        raw::vlr::RecordLength::Vlr(data.len() as u16)
    };
    let record = raw::Vlr {
        user_id,
        record_id: *id,
        record_length_after_header: length,
        data: data.clone(),
        ..raw::Vlr::default()
    };
    let mut bytes = Vec::new();
    record.write_to(&mut bytes).expect("memory can be written");
    bytes
}
