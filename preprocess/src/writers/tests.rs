//! What is written is read again as it was.

use std::path::Path;

use lodestream_protocol::{Attribute, Column, Domain, Lattice, LatticeBox, ScalarType, Storage};

use super::*;
use crate::readers::{
    self, CoordinateKind, Positions,
    las::tests::{
        Contents,
        scan::{Compression, Scan},
    },
};

/// An attribute with the values of some points.
struct Values {
    name: &'static str,
    scalar: ScalarType,
    components: u8,
    bytes: Vec<u8>,
}

impl Values {
    fn attribute(&self) -> Attribute {
        attribute_of(self.name, self.scalar, self.components, &self.bytes)
    }
}

/// The manifest's entry for such values.
fn attribute_of(name: &str, scalar: ScalarType, components: u8, bytes: &[u8]) -> Attribute {
    let size = scalar.size_bytes();
    let parts = usize::from(components);
    let (mut min, mut max) = (vec![f64::INFINITY; parts], vec![f64::NEG_INFINITY; parts]);
    for (i, value) in bytes.chunks_exact(size).enumerate() {
        let value = scalar.to_f64(value);
        min[i % parts] = min[i % parts].min(value);
        max[i % parts] = max[i % parts].max(value);
    }
    Attribute {
        name: name.into(),
        scalar,
        components,
        domain: Domain::Element,
        storage: Storage::Column { group: 0 },
        min,
        max,
    }
}

/// What a dataset made from `contents` would hand to a writer.
fn export_of(contents: &Contents) -> (ExportInfo, ExportBlock) {
    let CoordinateKind::Scaled { scale, offset } = contents.info.coordinates else {
        panic!("LAS coordinates are integers");
    };
    let of_axis = |a: usize| contents.positions.iter().map(move |p| i64::from(p[a]));
    let origin = [0, 1, 2].map(|a| of_axis(a).min().unwrap_or(0));
    let positions: Vec<[u32; 3]> = contents
        .positions
        .iter()
        .map(|p| {
            [0, 1, 2].map(|a| u32::try_from(i64::from(p[a]) - origin[a]).expect("32 bits apart"))
        })
        .collect();
    let mut bounds = LatticeBox::EMPTY;
    positions.iter().for_each(|&p| bounds.grow(p));
    let mut columns = Vec::new();
    let mut attributes = Vec::new();
    for (index, a) in contents.info.attributes.iter().enumerate() {
        let bytes = contents.values(&a.name);
        attributes.push(attribute_of(&a.name, a.scalar, a.components, &bytes));
        columns.push(Column { attribute: index, bytes });
    }
    let lattice = Lattice { scale: scale[0], offset, origin, side_bits: 32 };
    let points = positions.len() as u64;
    let crs = contents.info.crs.clone();
    (ExportInfo { lattice, bounds, points, attributes, crs }, ExportBlock { positions, columns })
}

/// Points on a diagonal with these attributes, and a lattice that starts at `origin`.
fn export(points: u32, origin: i64, values: &[Values]) -> (ExportInfo, ExportBlock) {
    let positions: Vec<[u32; 3]> = (0..points).map(|i| [i * 7, i * 5, i]).collect();
    let mut bounds = LatticeBox::EMPTY;
    positions.iter().for_each(|&p| bounds.grow(p));
    let lattice = Lattice { scale: 0.001, offset: [0.0; 3], origin: [origin; 3], side_bits: 32 };
    let attributes = values.iter().map(Values::attribute).collect();
    let columns = values
        .iter()
        .enumerate()
        .map(|(attribute, values)| Column { attribute, bytes: values.bytes.clone() })
        .collect();
    let info = ExportInfo { lattice, bounds, points: u64::from(points), attributes, crs: None };
    (info, ExportBlock { positions, columns })
}

fn write(path: &Path, info: &ExportInfo, blocks: &[ExportBlock]) -> Result<Vec<String>> {
    let mut writer = create(path, info.clone())?;
    for block in blocks {
        writer.write(block)?;
    }
    let notes = writer.notes().to_vec();
    writer.finish()?;
    Ok(notes)
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder can be made")
}

/// What a PLY file holds.
struct Vertices {
    attributes: Vec<readers::InputAttribute>,
    positions: Vec<[f64; 3]>,
    rows: Vec<u8>,
}

fn read_ply(path: &Path) -> Result<Vertices> {
    let reader = readers::ply::open(path)?;
    let attributes = reader.info().attributes.clone();
    let (mut positions, mut rows) = (Vec::new(), Vec::new());
    reader.read(&mut |block| {
        let Positions::Float(block_positions) = block.positions else {
            panic!("PLY coordinates are floats");
        };
        positions.extend(block_positions);
        rows.extend(block.attributes);
        Ok(())
    })?;
    Ok(Vertices { attributes, positions, rows })
}

#[test]
fn every_las_format_comes_back_with_every_value() -> Result<()> {
    let folder = folder();
    for format in 0..=10 {
        let mut scan = Scan::new(format, 300, 3, Compression::None);
        scan.header.y_scale_factor = scan.header.x_scale_factor;
        scan.header.z_scale_factor = scan.header.x_scale_factor;
        scan.records.push(("LASF_Projection", 2112, b"LOCAL_CS[\"here\"]".to_vec()));
        let first = Contents::read(scan.file().path())?;
        let (info, block) = export_of(&first);
        for ending in ["las", "laz"] {
            let path = folder.path().join(format!("{format}.{ending}"));
            assert_eq!(write(&path, &info, std::slice::from_ref(&block))?, Vec::<String>::new());
            let second = Contents::read(&path)?;
            assert_eq!(second.positions, first.positions, "{format} {ending}");
            assert_eq!(second.info.coordinates, first.info.coordinates, "{format} {ending}");
            assert_eq!(second.info.attributes, first.info.attributes, "{format} {ending}");
            assert!(second.rows == first.rows, "{format} {ending}");
            assert_eq!(second.info.crs, first.info.crs);
            assert_eq!(second.report.warnings, Vec::<String>::new());
        }
    }
    Ok(())
}

#[test]
fn the_las_crate_agrees_with_what_the_header_says() -> Result<()> {
    let folder = folder();
    for (format, ending) in [(3, "las"), (3, "laz"), (7, "las"), (7, "laz")] {
        let mut scan = Scan::new(format, 500, 0, Compression::None);
        scan.header.y_scale_factor = scan.header.x_scale_factor;
        scan.header.z_scale_factor = scan.header.x_scale_factor;
        let contents = Contents::read(scan.file().path())?;
        let (info, block) = export_of(&contents);
        let path = folder.path().join(format!("{format}.{ending}"));
        write(&path, &info, &[block])?;
        let mut reader = ::las::Reader::from_path(&path).expect("the file is sound");
        assert_eq!(reader.header().number_of_points(), 500);
        let version = if format == 3 { (1, 2) } else { (1, 4) };
        assert_eq!(reader.header().version(), ::las::Version::from(version));
        let numbers = contents.values("return_number");
        for number in 1..=5u8 {
            let count = numbers.iter().filter(|&&other| other == number).count() as u64;
            let announced = reader.header().number_of_points_by_return(number).unwrap_or(0);
            assert_eq!(announced, count, "return {number}");
        }
        let bounds = reader.header().bounds();
        let points = reader.read_all().expect("the file is sound");
        assert_eq!(points.x().reduce(f64::min), Some(bounds.min.x));
        assert_eq!(points.z().reduce(f64::max), Some(bounds.max.z));
        assert!(points.x_raw().eq(contents.positions.iter().map(|p| p[0])));
    }
    Ok(())
}

#[test]
fn many_blocks_and_chunks_keep_their_order() -> Result<()> {
    let folder = folder();
    let ids: Vec<u32> = (0..130_000).collect();
    let values = Values {
        name: "id",
        scalar: ScalarType::U32,
        components: 1,
        bytes: ids.iter().flat_map(|id| id.to_le_bytes()).collect(),
    };
    let (info, whole) = export(130_000, -5, &[values]);
    let blocks: Vec<ExportBlock> = (0..130)
        .map(|part| ExportBlock {
            positions: whole.positions[part * 1000..][..1000].to_vec(),
            columns: vec![Column {
                attribute: 0,
                bytes: whole.columns[0].bytes[part * 4000..][..4000].to_vec(),
            }],
        })
        .collect();
    for name in ["a.las", "a.laz"] {
        write(&folder.path().join(name), &info, &blocks)?;
        let contents = Contents::read(&folder.path().join(name))?;
        assert!(contents.values("id") == whole.columns[0].bytes, "{name}");
        assert_eq!(contents.positions[129_999], [909_988, 649_990, 129_994]);
    }
    Ok(())
}

#[test]
fn what_las_has_no_field_for_comes_back_from_extra_bytes() -> Result<()> {
    let folder = folder();
    let bytes = |count: usize| -> Vec<u8> { (0..count).map(|i| (i * 37 % 251) as u8).collect() };
    let values = [
        Values { name: "normal", scalar: ScalarType::F32, components: 3, bytes: bytes(120) },
        Values { name: "surface", scalar: ScalarType::I64, components: 1, bytes: bytes(80) },
        Values { name: "intensity", scalar: ScalarType::F64, components: 1, bytes: bytes(80) },
        Values { name: "tag", scalar: ScalarType::U8, components: 9, bytes: bytes(90) },
        Values { name: "pair", scalar: ScalarType::U16, components: 2, bytes: bytes(40) },
    ];
    let (info, block) = export(10, 0, &values);
    for name in ["a.las", "a.laz"] {
        write(&folder.path().join(name), &info, std::slice::from_ref(&block))?;
        let contents = Contents::read(&folder.path().join(name))?;
        for values in &values {
            // The format has a field of that name, if not of that type.
            let name = if values.name == "intensity" { "intensity_2" } else { values.name };
            let attribute = contents.info.attributes.iter().find(|a| a.name == name);
            let attribute = attribute.expect("nothing is lost");
            assert_eq!(
                (attribute.scalar, attribute.components),
                (values.scalar, values.components)
            );
            assert_eq!(contents.values(name), values.bytes, "{name}");
        }
    }
    Ok(())
}

#[test]
fn narrow_and_wide_integers_find_their_fields_where_their_values_fit() -> Result<()> {
    let folder = folder();
    let values = [
        Values { name: "color", scalar: ScalarType::U8, components: 3, bytes: vec![0, 128, 255] },
        Values { name: "intensity", scalar: ScalarType::U8, components: 1, bytes: vec![200] },
        Values {
            name: "user_data",
            scalar: ScalarType::I64,
            components: 1,
            bytes: 250i64.to_le_bytes().into(),
        },
        Values {
            name: "scan_angle_rank",
            scalar: ScalarType::I32,
            components: 1,
            bytes: (-90i32).to_le_bytes().into(),
        },
        Values {
            name: "classification",
            scalar: ScalarType::U16,
            components: 1,
            bytes: 31u16.to_le_bytes().into(),
        },
    ];
    let (info, block) = export(1, 0, &values);
    let path = folder.path().join("a.las");
    let notes = write(&path, &info, &[block])?;
    assert!(notes.len() == 1 && notes[0].contains("257"), "{notes:?}");
    let contents = Contents::read(&path)?;
    assert_eq!(contents.info.attributes.len(), 13);
    let color: Vec<u8> = [0u16, 128 * 257, 65535].iter().flat_map(|c| c.to_le_bytes()).collect();
    assert_eq!(contents.values("color"), color);
    assert_eq!(contents.values("intensity"), [200, 0]);
    assert_eq!(contents.values("user_data"), [250]);
    assert_eq!(contents.values("scan_angle_rank"), [(-90i8) as u8]);
    assert_eq!(contents.values("classification"), [31]);
    Ok(())
}

#[test]
fn coordinates_far_from_the_lattice_s_zero_keep_their_value() -> Result<()> {
    let folder = folder();
    let (info, block) = export(100, 5_234_567_890_123, &[]);
    let path = folder.path().join("a.laz");
    write(&path, &info, std::slice::from_ref(&block))?;
    let contents = Contents::read(&path)?;
    let CoordinateKind::Scaled { scale, offset } = contents.info.coordinates else {
        panic!("LAS coordinates are integers");
    };
    for (written, read) in block.positions.iter().zip(&contents.positions) {
        let expected = info.lattice.world(*written);
        for a in 0..3 {
            let world = f64::from(read[a]) * scale[a] + offset[a];
            // An ulp of 5.2e9 is a millionth; a step of the lattice is a thousandth.
            assert!((world - expected[a]).abs() <= 2e-6, "{world} {expected:?}");
        }
    }
    Ok(())
}

#[test]
fn constants_need_no_column() -> Result<()> {
    let folder = folder();
    let (mut info, block) = export(3, 0, &[]);
    let mut constant = attribute_of("point_source_id", ScalarType::U16, 1, &[7, 1]);
    constant.storage = Attribute::constant_storage(&[7, 1]);
    info.attributes.push(constant);
    for name in ["a.las", "a.ply"] {
        write(&folder.path().join(name), &info, std::slice::from_ref(&block))?;
    }
    let contents = Contents::read(&folder.path().join("a.las"))?;
    assert_eq!(contents.values("point_source_id"), [7, 1, 7, 1, 7, 1]);
    let Vertices { rows, .. } = read_ply(&folder.path().join("a.ply"))?;
    assert_eq!(rows, [7, 1, 7, 1, 7, 1]);
    Ok(())
}

#[test]
fn ply_comes_back_with_every_value() -> Result<()> {
    let folder = folder();
    let path = folder.path().join("a.ply");
    let unit: Vec<u8> = [[1.0f32, 0.0, 0.0], [0.0, -1.0, 0.0]]
        .as_flattened()
        .iter()
        .flat_map(|n| n.to_le_bytes())
        .collect();
    let values = [
        Values {
            name: "color",
            scalar: ScalarType::U16,
            components: 3,
            bytes: vec![1, 0, 255, 0, 3, 0, 4, 0, 5, 0, 6, 0],
        },
        Values { name: "normal", scalar: ScalarType::F32, components: 3, bytes: unit.clone() },
        Values {
            name: "intensity",
            scalar: ScalarType::U16,
            components: 1,
            bytes: vec![1, 2, 3, 4],
        },
        Values { name: "gps_time", scalar: ScalarType::F64, components: 1, bytes: vec![9; 16] },
        Values { name: "rank", scalar: ScalarType::I8, components: 1, bytes: vec![255, 7] },
    ];
    let (info, block) = export(2, 5_234_567_890_123, &values);
    write(&path, &info, std::slice::from_ref(&block))?;
    let Vertices { attributes, positions, rows } = read_ply(&path)?;
    let expected: Vec<[f64; 3]> = block.positions.iter().map(|&p| info.lattice.world(p)).collect();
    assert_eq!(positions, expected);
    let found: Vec<_> =
        attributes.iter().map(|a| (a.name.as_str(), a.scalar, a.components)).collect();
    assert_eq!(
        found,
        [
            ("color", ScalarType::U8, 3),
            ("normal", ScalarType::F32, 3),
            ("intensity", ScalarType::U16, 1),
            ("gps_time", ScalarType::F64, 1),
            ("rank", ScalarType::I8, 1),
        ]
    );
    let mut expected = vec![1, 255, 3];
    expected.extend(&unit[..12]);
    expected.extend([1, 2]);
    expected.extend([9; 8]);
    expected.push(255);
    assert_eq!(rows[..26], expected);
    Ok(())
}

#[test]
fn ply_writes_long_integers_without_loss() -> Result<()> {
    let folder = folder();
    let path = folder.path().join("a.ply");
    let values = [
        Values {
            name: "small",
            scalar: ScalarType::I64,
            components: 1,
            bytes: (-5i64).to_le_bytes().into(),
        },
        Values {
            name: "large",
            scalar: ScalarType::U64,
            components: 1,
            bytes: u64::MAX.to_le_bytes().into(),
        },
    ];
    let (info, block) = export(1, 0, &values);
    let notes = write(&path, &info, &[block])?;
    assert!(notes[0].contains("large_low"), "{notes:?}");
    let Vertices { attributes, rows, .. } = read_ply(&path)?;
    let names: Vec<&str> = attributes.iter().map(|a| a.name.as_str()).collect();
    assert_eq!(names, ["small", "large_low", "large_high"]);
    assert_eq!(rows[..8], (-5f64).to_le_bytes());
    assert_eq!(rows[8..], [255; 8]);
    Ok(())
}

#[test]
fn no_points_make_a_sound_file() -> Result<()> {
    let folder = folder();
    let (info, _) = export(0, 0, &[]);
    for name in ["a.las", "a.laz"] {
        write(&folder.path().join(name), &info, &[])?;
        assert_eq!(Contents::read(&folder.path().join(name))?.positions.len(), 0);
    }
    write(&folder.path().join("a.ply"), &info, &[ExportBlock::default()])?;
    assert!(read_ply(&folder.path().join("a.ply"))?.positions.is_empty());
    Ok(())
}

#[test]
fn nothing_appears_before_it_is_complete() -> Result<()> {
    let folder = folder();
    let (info, block) = export(3, 0, &[]);
    for name in ["a.las", "a.laz", "a.ply"] {
        let path = folder.path().join(name);
        std::fs::write(&path, "what was there before").map_err(Error::io(&path, "cannot write"))?;
        let mut writer = create(&path, info.clone())?;
        writer.write(&block)?;
        drop(writer);
        let kept = std::fs::read(&path).map_err(Error::io(&path, "cannot read"))?;
        assert_eq!(kept, b"what was there before");
    }
    let left = std::fs::read_dir(folder.path()).map_err(Error::io(folder.path(), "cannot list"))?;
    assert_eq!(left.count(), 3, "the files being written are gone");
    Ok(())
}

#[test]
fn what_cannot_be_written_is_said_in_a_line() {
    let folder = folder();
    let (info, block) = export(3, 0, &[]);
    let refuse = |name: &str| match create(&folder.path().join(name), info.clone()) {
        Ok(_) => panic!("{name} was created"),
        Err(e) => e.to_string(),
    };
    assert!(refuse("a.obj").contains("ends in .las, .laz or .ply"));
    assert!(refuse("missing/a.las").contains("cannot create"));

    let mut outside = block.clone();
    outside.positions[0] = [u32::MAX; 3];
    let mut writer = create(&folder.path().join("a.las"), info.clone()).expect("a folder");
    assert!(writer.write(&outside).expect_err("outside").to_string().contains("bounds"));

    // An attribute whose values contradict what its manifest says.
    let class = Values {
        name: "classification",
        scalar: ScalarType::U8,
        components: 1,
        bytes: vec![1, 2, 3],
    };
    let (info, mut block) = export(3, 0, &[class]);
    block.columns[0].bytes[1] = 32;
    let mut writer = create(&folder.path().join("b.las"), info).expect("a folder");
    let line = writer.write(&block).expect_err("32 takes six bits").to_string();
    assert!(line.contains("classification") && line.contains("32"), "{line}");
}
