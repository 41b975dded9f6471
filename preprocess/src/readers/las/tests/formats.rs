//! What is read is what was written, for every format, version and compression.

use std::path::{Path, PathBuf};

use lodestream_protocol::ScalarType;

use super::{
    Contents,
    scan::{Compression, Scan},
};
use crate::{
    Error, Result,
    readers::{
        BLOCK_POINTS, CoordinateKind,
        las::{
            open,
            point_format::{LAST_FORMAT, Place, fields},
        },
        testing,
    },
};

/// What a record should give, field by field.
fn expected_row(record: &[u8], format: u8) -> Vec<u8> {
    let (fields, format_bytes) = fields(format).expect("a known format");
    let mut row = Vec::new();
    for field in fields {
        let size = field.scalar.size_bytes() * usize::from(field.components);
        match field.place {
            Place::Bytes => row.extend_from_slice(&record[field.at..field.at + size]),
            Place::Bits { shift, bits } => {
                row.push(record[field.at] << (8 - shift - bits) >> (8 - bits))
            }
        }
    }
    row.extend_from_slice(&record[format_bytes..]);
    row
}

fn assert_reads(scan: &Scan, what: &str) -> Result<()> {
    let file = scan.file();
    let contents = Contents::read(file.path())?;
    let records = scan.points.chunks_exact(scan.record_bytes());
    let format = scan.header.point_data_record_format;
    let axis = |record: &[u8], at: usize| {
        i32::from_le_bytes(*record[at..].first_chunk().expect("records are longer"))
    };
    let positions: Vec<[i32; 3]> =
        records.clone().map(|r| [axis(r, 0), axis(r, 4), axis(r, 8)]).collect();
    assert!(contents.positions == positions, "{what}: positions");
    let rows: Vec<u8> = records.flat_map(|r| expected_row(r, format)).collect();
    assert!(contents.rows == rows, "{what}: attributes");
    assert_eq!(contents.report.points_read, positions.len() as u64, "{what}");
    assert_eq!(contents.info.points, Some(positions.len() as u64), "{what}");
    assert_eq!(contents.report.warnings, Vec::<String>::new(), "{what}");
    Ok(())
}

#[test]
fn every_format_is_read_plain_and_compressed() -> Result<()> {
    for format in 0..=LAST_FORMAT {
        for compression in [
            Compression::None,
            Compression::Fixed(50_000),
            Compression::Fixed(50),
            Compression::Variable,
        ] {
            let scan = Scan::new(format, 120, 3, compression);
            assert_reads(&scan, &format!("format {format}, {compression:?}"))?;
        }
    }
    Ok(())
}

#[test]
fn every_version_is_read() -> Result<()> {
    for (minor, format) in [(0, 1), (1, 0), (2, 3), (3, 5)] {
        assert_reads(
            &Scan::new(format, 10, 0, Compression::None).with_version(minor),
            &format!("version 1.{minor}"),
        )?;
    }
    let mut bytes = Scan::new(8, 10, 0, Compression::None).bytes();
    bytes[25] = 5;
    let file = testing::file(&bytes);
    assert_eq!(Contents::read(file.path())?.report.points_read, 10);
    Ok(())
}

#[test]
fn several_blocks_arrive_whole_and_in_order_for_any_number_of_threads() -> Result<()> {
    let points = 2 * BLOCK_POINTS + 77;
    for scan in [
        Scan::new(1, points, 0, Compression::None),
        Scan::new(3, points, 2, Compression::Fixed(50_000)),
        // Chunks larger than a block.
        Scan::new(7, points, 0, Compression::Fixed(100_000)),
    ] {
        for threads in [1, 2, 3] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let pool = pool.expect("a pool can be made");
            pool.install(|| assert_reads(&scan, &format!("{threads} threads")))?;
        }
    }
    Ok(())
}

#[test]
fn blocks_are_full_but_the_last() -> Result<()> {
    let scan = Scan::new(0, BLOCK_POINTS + 5, 0, Compression::None);
    let mut lengths = Vec::new();
    open(scan.file().path())?.read(&mut |block| {
        lengths.push(block.positions.len());
        Ok(())
    })?;
    assert_eq!(lengths, [BLOCK_POINTS, 5]);
    Ok(())
}

#[test]
fn small_chunks_share_a_block() -> Result<()> {
    let scan = Scan::new(6, 300, 0, Compression::Variable);
    let mut lengths = Vec::new();
    open(scan.file().path())?.read(&mut |block| {
        lengths.push(block.positions.len());
        Ok(())
    })?;
    assert_eq!(lengths, [300]);
    Ok(())
}

#[test]
fn stops_at_the_error_of_the_sink() -> Result<()> {
    for compression in [Compression::None, Compression::Fixed(1000)] {
        let scan = Scan::new(0, 3 * BLOCK_POINTS, 0, compression);
        let mut calls = 0;
        let outcome = open(scan.file().path())?.read(&mut |_| {
            calls += 1;
            if calls == 2 { Err(Error::Interrupted) } else { Ok(()) }
        });
        assert!(matches!(outcome, Err(Error::Interrupted)));
        assert_eq!(calls, 2);
    }
    Ok(())
}

#[test]
fn attributes_bear_the_specification_s_names_and_types() -> Result<()> {
    let contents = Contents::read(Scan::new(3, 1, 0, Compression::None).file().path())?;
    let attributes: Vec<(&str, ScalarType, u8)> = contents
        .info
        .attributes
        .iter()
        .map(|a| (a.name.as_str(), a.scalar, a.components))
        .collect();
    assert_eq!(
        attributes,
        [
            ("intensity", ScalarType::U16, 1),
            ("return_number", ScalarType::U8, 1),
            ("number_of_returns", ScalarType::U8, 1),
            ("scan_direction_flag", ScalarType::U8, 1),
            ("edge_of_flight_line", ScalarType::U8, 1),
            ("classification", ScalarType::U8, 1),
            ("synthetic", ScalarType::U8, 1),
            ("key_point", ScalarType::U8, 1),
            ("withheld", ScalarType::U8, 1),
            ("scan_angle_rank", ScalarType::I8, 1),
            ("user_data", ScalarType::U8, 1),
            ("point_source_id", ScalarType::U16, 1),
            ("gps_time", ScalarType::F64, 1),
            ("color", ScalarType::U16, 3),
        ]
    );
    let coordinates = CoordinateKind::Scaled {
        scale: [0.01, 0.02, 0.001],
        offset: [500_000.0, 5_000_000.0, -1.0],
    };
    assert_eq!(contents.info.coordinates, coordinates);
    Ok(())
}

#[test]
fn a_start_signature_before_the_points_of_las_1_0_is_stepped_over() -> Result<()> {
    let scan = Scan::new(0, 4, 0, Compression::None).with_version(0);
    let plain = Contents::read(scan.file().path())?;
    let mut bytes = scan.bytes();
    let start = usize::from(scan.header.header_size);
    bytes.splice(start..start, [0xDD, 0xCC]);
    // The header's position may lie before the signature or behind it.
    for position in [start, start + 2] {
        bytes[96..100].copy_from_slice(&(position as u32).to_le_bytes());
        let contents = Contents::read(testing::file(&bytes).path())?;
        assert_eq!(contents.positions, plain.positions);
        assert_eq!(contents.rows, plain.rows);
    }
    Ok(())
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures/las").join(name)
}

/// Compares with the `las` crate's reader, which goes through a struct for each point.
#[test]
fn real_files_are_read_as_the_las_crate_reads_them() -> Result<()> {
    for name in ["autzen.las", "autzen.laz", "autzen.copc.laz", "extrabytes.laz"] {
        let contents = Contents::read(&fixture(name))?;
        let mut reader = las::Reader::from_path(fixture(name)).expect("the fixture is sound");
        let points = reader.read_all().expect("the fixture is sound");
        assert_eq!(contents.positions.len(), points.len(), "{name}");
        let x: Vec<i32> = points.x_raw().collect();
        assert!(contents.positions.iter().map(|p| p[0]).eq(x), "{name}");
        let z: Vec<i32> = points.z_raw().collect();
        assert!(contents.positions.iter().map(|p| p[2]).eq(z), "{name}");
        let intensity: Vec<u8> = points.intensity().flat_map(u16::to_le_bytes).collect();
        assert_eq!(contents.values("intensity"), intensity, "{name}");
        let times = points.gps_time().expect("the fixtures have times");
        let times: Vec<u8> = times.flat_map(f64::to_le_bytes).collect();
        assert_eq!(contents.values("gps_time"), times, "{name}");
        if let Some(colors) = points.rgb() {
            let colors: Vec<u8> =
                colors.flat_map(|(r, g, b)| [r, g, b]).flat_map(u16::to_le_bytes).collect();
            assert_eq!(contents.values("color"), colors, "{name}");
        }
    }
    Ok(())
}
