//! Files that lie, are cut short or are not LAS at all: one clear line each, never a panic.

use super::{
    Contents,
    scan::{Compression, Scan},
};
use crate::{Error, Result, readers::testing::file};

const COMPRESSIONS: [Compression; 3] =
    [Compression::None, Compression::Fixed(20), Compression::Variable];

/// The line that a file is refused with.
fn refusal(bytes: &[u8]) -> String {
    let file = file(bytes);
    let error = Contents::read(file.path()).expect_err("the file is damaged");
    assert!(matches!(error, Error::Input { .. }), "{error:?}");
    let line = error.to_string();
    assert!(!line.contains('\n'), "{line}");
    let path = file.path().display().to_string();
    line.strip_prefix(&path).expect("the file is named").trim_start_matches(": ").to_owned()
}

fn patched(bytes: &[u8], at: usize, patch: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + patch.len()].copy_from_slice(patch);
    bytes
}

#[test]
fn what_is_not_las_is_refused() {
    assert_eq!(refusal(b""), "is empty");
    assert!(refusal(b"LASF").contains("cut short"));
    assert!(refusal(&[0x42; 5000]).contains("not a LAS or LAZ file"));
    assert!(refusal(b"version https://git-lfs.github.com/spec/v1").contains("not a LAS"));
}

#[test]
fn a_directory_is_refused() {
    let directory = tempfile::tempdir().expect("a directory can be made");
    assert!(Contents::read(directory.path()).is_err());
}

#[test]
fn headers_that_cannot_be_true_are_refused() {
    let bytes = Scan::new(3, 10, 0, Compression::None).bytes();
    let nan = f64::NAN.to_le_bytes();
    for (at, patch, says) in [
        (24, &[2u8, 0][..], "version 2.0"),
        (24, &[1, 6], "version 1.6"),
        (104, &[11], "format 11"),
        (105, &[33, 0], "33 bytes"),
        (105, &[0, 0], "0 bytes"),
        (96, &[255, 255, 255, 127], "at byte 2147483647"),
        (96, &[0, 0, 0, 0], "at byte 0"),
        (131, &[0; 8], "x scale factor 0"),
        (139, &nan, "y scale factor NaN"),
        (147, &(-0.01f64).to_le_bytes(), "z scale factor -0.01"),
        (155, &nan, "x offset NaN"),
        (171, &f64::INFINITY.to_le_bytes(), "z offset inf"),
        (94, &[255, 255], "header"),
    ] {
        let line = refusal(&patched(&bytes, at, patch));
        assert!(line.contains(says), "{line}");
    }
}

#[test]
fn more_points_announced_than_held_are_refused_with_both_numbers() {
    for format in [3, 7] {
        for compression in [Compression::None, Compression::Variable] {
            let scan = Scan::new(format, 50, 0, compression).announcing(1_000_000);
            let line = refusal(&scan.bytes());
            assert!(
                line.contains("header announces 1000000 points, the file holds 50:"),
                "{compression:?}: {line}"
            );
        }
    }
    // A table of fixed chunks does not say how many points the last holds; layered ones do.
    let line = refusal(&Scan::new(3, 50, 0, Compression::Fixed(20)).announcing(61).bytes());
    assert!(line.contains("announces 61 points, the file holds 60"), "{line}");
    let line = refusal(&Scan::new(7, 50, 0, Compression::Fixed(20)).announcing(51).bytes());
    assert!(line.contains("announces 51 points, the file holds 50"), "{line}");
    let line = refusal(&Scan::new(3, 50, 0, Compression::Fixed(20)).announcing(60).bytes());
    assert!(line.contains("cut short or damaged in chunk 2"), "{line}");
    let line = refusal(&Scan::new(0, 50, 0, Compression::None).announcing(u64::MAX).bytes());
    assert!(line.contains("the file holds 50"), "{line}");
}

#[test]
fn fewer_points_announced_than_held_are_read_with_a_warning() -> Result<()> {
    for format in [3, 7] {
        for compression in COMPRESSIONS {
            let whole = Contents::read(Scan::new(format, 50, 0, compression).file().path())?;
            let scan = Scan::new(format, 50, 0, compression).announcing(33);
            let contents = Contents::read(scan.file().path())?;
            assert_eq!(contents.positions, whole.positions[..33], "{format} {compression:?}");
            assert_eq!(contents.report.points_read, 33);
            assert!(contents.says("header announces 33 points"), "{format} {compression:?}");
        }
    }
    Ok(())
}

#[test]
fn no_points_are_no_error() -> Result<()> {
    for compression in COMPRESSIONS {
        let contents = Contents::read(Scan::new(6, 0, 0, compression).file().path())?;
        assert_eq!((contents.positions.len(), contents.report.points_read), (0, 0));
    }
    Ok(())
}

#[test]
fn the_legacy_count_of_las_1_4_counts_where_it_is_set() -> Result<()> {
    let mut scan = Scan::new(3, 50, 0, Compression::None);
    scan.header.number_of_point_records = 40;
    let contents = Contents::read(scan.file().path())?;
    assert_eq!(contents.report.points_read, 40);
    assert!(contents.says("50 points and, in its legacy field, 40"));
    Ok(())
}

/// Not one byte beyond what the file holds is ever believed: whatever is cut off, reading ends in
/// an error or, where only the end of a last record is missing, in all points.
#[test]
fn every_way_of_cutting_a_file_short_is_survived() {
    for (format, compression) in
        [(3, Compression::None), (3, Compression::Fixed(20)), (7, Compression::Fixed(20))]
    {
        let scan = Scan::new(format, 45, 2, compression);
        let bytes = scan.bytes();
        for len in (0..bytes.len()).step_by(7) {
            match Contents::read(file(&bytes[..len]).path()) {
                Err(Error::Input { .. }) => {}
                Err(other) => panic!("{format} {compression:?} cut to {len}: {other:?}"),
                Ok(contents) => {
                    panic!("{} points of a file cut to {len}", contents.positions.len())
                }
            }
        }
    }
}

#[test]
fn every_way_of_changing_a_byte_is_survived() {
    for (format, points, compression) in
        [(3, 8, Compression::Fixed(5)), (7, 3, Compression::Variable)]
    {
        let mut scan = Scan::new(format, points, 2, compression);
        scan.records.push(("LASF_Spec", 4, vec![1; 192]));
        let bytes = scan.bytes();
        let start = u32::from_le_bytes(*bytes[96..].first_chunk().expect("a header")) as usize;
        // Every byte of what is parsed here, some of what the decoder parses.
        for at in (0..start + 8).chain((start + 8..bytes.len()).step_by(3)) {
            let changed = patched(&bytes, at, &[bytes[at] ^ 0xFF]);
            match Contents::read(file(&changed).path()) {
                Ok(contents) => assert!(contents.positions.len() <= points),
                Err(Error::Input { .. }) => {}
                Err(other) => panic!("{format} {compression:?} changed at {at}: {other:?}"),
            }
        }
    }
}

#[test]
fn a_laszip_record_that_cannot_be_true_is_refused() {
    let scan = Scan::new(1, 45, 0, Compression::Fixed(20));
    let bytes = scan.bytes();
    let record = usize::from(scan.header.header_size) + 54;
    for (at, patch, says) in [
        (0, 9u16, "compressor 9"),
        (2, 15, "entropy coder 15"),
        (38, 6, "of version 6"),
        (36, 4000, "in 4000 bytes"),
        (34, 4000, "type code: 4000"),
        (34, 10, "Point14"),
        // An item fewer, none, more than there are.
        (32, 1, "points of 20 bytes; the header's have 28"),
        (32, 0, "points of 0 bytes"),
        (32, 4000, "is damaged"),
    ] {
        let line = refusal(&patched(&bytes, record + at, &patch.to_le_bytes()));
        assert!(line.contains("LASzip record") && line.contains(says), "{at}: {line}");
    }
    let mut without = scan;
    without.compression = Compression::None;
    let mut bytes = without.bytes();
    bytes[104] |= 0x80;
    assert!(refusal(&bytes).contains("no LASzip record"));
}

#[test]
fn a_chunk_table_that_lies_is_refused() {
    let scan = Scan::new(3, 45, 0, Compression::Fixed(20));
    let bytes = scan.bytes();
    let start = u32::from_le_bytes(*bytes[96..].first_chunk().expect("a header")) as usize;
    let note = *bytes[start..].first_chunk().expect("a note");
    let table = usize::try_from(u64::from_le_bytes(note)).expect("inside the file");
    let line = refusal(&patched(&bytes, table + 4, &u32::MAX.to_le_bytes()));
    assert!(line.contains("announces 4294967295 chunks"), "{line}");
    let line = refusal(&patched(&bytes, start, &(1u64 << 40).to_le_bytes()));
    assert!(line.contains("is cut short"), "{line}");
    let line = refusal(&patched(&bytes, table + 4, &1u32.to_le_bytes()));
    assert!(line.contains("announces 45 points, the file holds 20"), "{line}");
}

#[test]
fn a_file_without_a_chunk_table_is_read_where_that_is_possible() -> Result<()> {
    for format in [3, 7] {
        let scan = Scan::new(format, 45, 2, Compression::Fixed(20));
        let whole = Contents::read(scan.file().path())?;
        let bytes = scan.bytes();
        let start = u32::from_le_bytes(*bytes[96..].first_chunk().expect("a header")) as usize;
        let note = *bytes[start..].first_chunk().expect("a note");
        let table = usize::try_from(u64::from_le_bytes(note)).expect("inside the file");
        // As a writer leaves it that was killed: no table, and -1 where its position belongs.
        let cut = patched(&bytes[..table], start, &(-1i64).to_le_bytes());
        let contents = Contents::read(file(&cut).path())?;
        assert_eq!(contents.positions, whole.positions);
        assert_eq!(contents.rows, whole.rows);
        // As a writer leaves it that cannot go back: the position lies at the end.
        let mut appended = patched(&bytes, start, &(-1i64).to_le_bytes());
        appended.extend_from_slice(&note);
        assert_eq!(Contents::read(file(&appended).path())?.rows, whole.rows);
        // And where points are missing.
        let line = refusal(&cut[..table - 30]);
        assert!(line.contains("cut short or damaged"), "{line}");
    }
    let bytes = Scan::new(3, 45, 0, Compression::Variable).bytes();
    let start = u32::from_le_bytes(*bytes[96..].first_chunk().expect("a header")) as usize;
    let line = refusal(&patched(&bytes, start, &(-1i64).to_le_bytes()));
    assert!(line.contains("no table"), "{line}");
    Ok(())
}
