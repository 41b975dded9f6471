//! Variable length records: coordinate systems and extra bytes.

use super::{
    Contents,
    scan::{Compression, Scan},
};
use crate::{
    Result,
    readers::{las::extra_bytes::DESCRIPTOR_BYTES, testing::file},
};

fn descriptor(kind: u8, name: &str) -> Vec<u8> {
    let mut bytes = vec![0; DESCRIPTOR_BYTES];
    bytes[2] = kind;
    bytes[4..4 + name.len()].copy_from_slice(name.as_bytes());
    bytes
}

#[test]
fn extra_bytes_are_kept_by_name_plain_and_compressed() -> Result<()> {
    for format in [1, 6] {
        for compression in [Compression::None, Compression::Fixed(40)] {
            let mut scan = Scan::new(format, 100, 4 + 6 + 1, compression);
            let data = [descriptor(9, "reflectance"), descriptor(23, "offsets")].concat();
            scan.records.push(("LASF_Spec", 4, data));
            let contents = Contents::read(scan.file().path())?;
            let record_bytes = scan.record_bytes();
            for (name, from, size) in
                [("reflectance", 11, 4), ("offsets", 7, 6), ("extra_bytes", 1, 1)]
            {
                let expected: Vec<u8> = scan
                    .points
                    .chunks_exact(record_bytes)
                    .flat_map(|record| record[record_bytes - from..][..size].to_vec())
                    .collect();
                assert_eq!(contents.values(name), expected, "{name}");
            }
            assert_eq!(contents.info.left_out, Vec::<String>::new());
        }
    }
    Ok(())
}

#[test]
fn many_undescribed_bytes_are_left_out_by_name() -> Result<()> {
    let contents = Contents::read(Scan::new(0, 3, 65, Compression::None).file().path())?;
    assert!(contents.says("65 bytes of each record"), "{:?}", contents.info.left_out);
    assert!(contents.info.attributes.iter().all(|a| a.name != "extra_bytes"));
    Ok(())
}

#[test]
fn the_coordinate_system_is_found_before_and_behind_the_points() -> Result<()> {
    let record = ("LASF_Projection", 2112, b"PROJCS[\"somewhere\"]\0".to_vec());
    for compression in [Compression::None, Compression::Fixed(2)] {
        let mut scan = Scan::new(6, 5, 0, compression);
        scan.records.push(("someone", 7, vec![1, 2, 3]));
        scan.records.push(record.clone());
        let crs = Contents::read(scan.file().path())?.info.crs;
        assert_eq!(crs.as_deref(), Some("PROJCS[\"somewhere\"]"));

        let mut scan = Scan::new(6, 5, 0, compression);
        scan.extended_records.push(("someone", 7, vec![0; 1000]));
        scan.extended_records.push(record.clone());
        let contents = Contents::read(scan.file().path())?;
        assert_eq!(contents.info.crs.as_deref(), Some("PROJCS[\"somewhere\"]"));
        assert_eq!(contents.report.warnings, Vec::<String>::new());
    }
    Ok(())
}

#[test]
fn geotiff_keys_alone_are_reported_with_their_code() -> Result<()> {
    let mut scan = Scan::new(0, 1, 0, Compression::None);
    let keys: [u16; 8] = [1, 1, 0, 1, 3072, 0, 1, 2994];
    let data = keys.iter().flat_map(|key| key.to_le_bytes()).collect();
    scan.records.push(("LASF_Projection", 34735, data));
    let contents = Contents::read(scan.file().path())?;
    assert_eq!(contents.info.crs, None);
    assert!(contents.says("EPSG:2994"), "{:?}", contents.info.left_out);
    Ok(())
}

#[test]
fn a_count_of_records_that_lies_is_not_believed() -> Result<()> {
    for compression in [Compression::None, Compression::Fixed(2)] {
        let mut scan = Scan::new(0, 5, 0, compression);
        scan.records.push(("LASF_Projection", 2112, b"LOCAL_CS[\"here\"]".to_vec()));
        let mut bytes = scan.bytes();
        bytes[100..104].copy_from_slice(&u32::MAX.to_le_bytes());
        let contents = Contents::read(file(&bytes).path())?;
        assert_eq!(contents.info.crs.as_deref(), Some("LOCAL_CS[\"here\"]"));
        assert_eq!(contents.positions.len(), 5);
        assert!(contents.says("4294967295 variable length records"));
    }
    Ok(())
}

#[test]
fn a_record_that_reaches_into_the_points_ends_the_walk() -> Result<()> {
    let mut scan = Scan::new(0, 5, 0, Compression::None);
    scan.records.push(("someone", 7, vec![0; 10]));
    scan.records.push(("LASF_Projection", 2112, b"LOCAL_CS[\"here\"]".to_vec()));
    let mut bytes = scan.bytes();
    let length = usize::from(scan.header.header_size) + 20;
    bytes[length..length + 2].copy_from_slice(&u16::MAX.to_le_bytes());
    let contents = Contents::read(file(&bytes).path())?;
    assert_eq!(contents.info.crs, None);
    assert_eq!(contents.positions.len(), 5);
    assert!(contents.says("2 variable length records, the file holds 0"));
    Ok(())
}

#[test]
fn extended_records_that_lie_are_not_believed() -> Result<()> {
    let mut scan = Scan::new(6, 5, 0, Compression::None);
    scan.extended_records.push(("someone", 7, vec![0; 10]));
    let bytes = scan.bytes();
    let start = bytes.len() - 70;
    for (at, lie) in [(start + 20, u64::MAX), (start + 20, 11), (235, u64::MAX), (235, 5)] {
        let mut bytes = bytes.clone();
        bytes[at..at + 8].copy_from_slice(&lie.to_le_bytes());
        let contents = Contents::read(file(&bytes).path())?;
        assert_eq!(contents.positions.len(), 5);
        assert!(contents.says("extended variable length records"), "{at} {lie}");
    }
    Ok(())
}
