//! Whole files: written by hand or by a small writer, read back.

use lodestream_protocol::ScalarType;
use proptest::prelude::*;

use super::*;
use crate::readers::{
    CoordinateKind,
    testing::{Cloud, file, refusal_of},
};

fn read(bytes: &[u8]) -> Result<Cloud> {
    let file = file(bytes);
    Cloud::read(open(file.path())?)
}

fn refusal(bytes: &[u8]) -> String {
    refusal_of(read(bytes))
}

/// A table of numbers that can be written in every encoding.
#[derive(Debug, Clone)]
struct Table {
    columns: Vec<(String, ScalarType)>,
    /// Little-endian values, column after column.
    rows: Vec<Vec<Vec<u8>>>,
    /// Column before which each row holds a list.
    list_before: Option<usize>,
    /// Triangles written before the vertices.
    faces: u8,
}

const TYPES: [(ScalarType, &str); 10] = [
    (ScalarType::U8, "uchar"),
    (ScalarType::I8, "int8"),
    (ScalarType::U16, "ushort"),
    (ScalarType::I16, "int16"),
    (ScalarType::U32, "uint"),
    (ScalarType::I32, "int32"),
    (ScalarType::U64, "uint64"),
    (ScalarType::I64, "int64"),
    (ScalarType::F32, "float"),
    (ScalarType::F64, "float64"),
];

fn text_of(scalar: ScalarType, bytes: &[u8]) -> String {
    macro_rules! text {
        ($number:ty) => {
            <$number>::from_le_bytes(bytes.try_into().expect("its size")).to_string()
        };
    }
    match scalar {
        ScalarType::U64 => text!(u64),
        ScalarType::I64 => text!(i64),
        ScalarType::F32 => text!(f32),
        ScalarType::F64 => text!(f64),
        _ => scalar.to_f64(bytes).to_string(),
    }
}

impl Table {
    fn write(&self, encoding: Encoding, line_end: &str) -> Vec<u8> {
        let name = match encoding {
            Encoding::Ascii => "ascii",
            Encoding::LittleEndian => "binary_little_endian",
            Encoding::BigEndian => "binary_big_endian",
        };
        let mut header = format!(
            "ply\nformat {name} 1.0\ncomment x y z\nelement face {}\n\
             property list uchar int vertex_indices\nelement vertex {}\n",
            self.faces,
            self.rows.len()
        );
        for (i, (column, scalar)) in self.columns.iter().enumerate() {
            if self.list_before == Some(i) {
                header += "property list ushort uchar around\n";
            }
            let (_, kind) = TYPES.iter().find(|(t, _)| t == scalar).expect("every type");
            header += &format!("property {kind} {column}\n");
        }
        header += "end_header\n";
        let mut bytes = header.replace('\n', line_end).into_bytes();
        let mut body = Body { encoding, bytes: Vec::new() };
        for _ in 0..self.faces {
            body.number(ScalarType::U8, &[3]);
            for corner in [0, 1, 2_i32] {
                body.number(ScalarType::I32, &corner.to_le_bytes());
            }
            body.end_row(line_end);
        }
        for (r, row) in self.rows.iter().enumerate() {
            for (i, ((_, scalar), value)) in self.columns.iter().zip(row).enumerate() {
                if self.list_before == Some(i) {
                    let length = u16::try_from(r % 5).expect("small");
                    body.number(ScalarType::U16, &length.to_le_bytes());
                    (0..length).for_each(|_| body.number(ScalarType::U8, &[77]));
                }
                body.number(*scalar, value);
            }
            body.end_row(line_end);
        }
        bytes.append(&mut body.bytes);
        bytes
    }
}

struct Body {
    encoding: Encoding,
    bytes: Vec<u8>,
}

impl Body {
    fn number(&mut self, scalar: ScalarType, bytes: &[u8]) {
        match self.encoding {
            Encoding::Ascii => self.bytes.extend((text_of(scalar, bytes) + " ").bytes()),
            Encoding::LittleEndian => self.bytes.extend(bytes),
            Encoding::BigEndian => self.bytes.extend(bytes.iter().rev()),
        }
    }

    fn end_row(&mut self, line_end: &str) {
        if self.encoding == Encoding::Ascii {
            self.bytes.extend(line_end.bytes());
        }
    }
}

/// A finite value of a type, as little-endian bytes.
fn value(scalar: ScalarType) -> BoxedStrategy<Vec<u8>> {
    match scalar {
        ScalarType::F32 => {
            use proptest::num::f32::{NEGATIVE, NORMAL, POSITIVE, ZERO};
            (NORMAL | ZERO | POSITIVE | NEGATIVE).prop_map(|v| v.to_le_bytes().to_vec()).boxed()
        }
        ScalarType::F64 => {
            use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, ZERO};
            (NORMAL | ZERO | POSITIVE | NEGATIVE).prop_map(|v| v.to_le_bytes().to_vec()).boxed()
        }
        _ => proptest::collection::vec(any::<u8>(), scalar.size_bytes()).boxed(),
    }
}

fn table() -> impl Strategy<Value = Table> {
    let axis = || prop::sample::select(vec![0_usize, 1, 2, 3, 4, 5, 8, 9]);
    let others = proptest::collection::vec(0..TYPES.len(), 0..6);
    (axis(), axis(), axis(), others, 0_u8..4, any::<u64>()).prop_flat_map(
        |(x, y, z, others, faces, order)| {
            let mut columns: Vec<(String, ScalarType)> = [("x", x), ("y", y), ("z", z)]
                .map(|(name, kind)| (name.to_owned(), TYPES[kind].0))
                .to_vec();
            for (i, kind) in others.into_iter().enumerate() {
                columns.push((format!("value{i}"), TYPES[kind].0));
            }
            let count = columns.len();
            columns.rotate_left(usize::try_from(order % 7).expect("small") % count);
            let list_before =
                (order % 3 == 0).then_some(usize::try_from(order % 5).expect("small") % count);
            let row: Vec<BoxedStrategy<Vec<u8>>> =
                columns.iter().map(|(_, scalar)| value(*scalar)).collect();
            proptest::collection::vec(row, 0..20).prop_map(move |rows| Table {
                columns: columns.clone(),
                rows,
                list_before,
                faces,
            })
        },
    )
}

proptest! {
    #[test]
    fn every_table_is_read_back_from_every_encoding(table in table()) {
        let mut positions = Vec::new();
        let mut attributes: Vec<u8> = Vec::new();
        for row in &table.rows {
            let mut position = [0.0; 3];
            for ((name, scalar), value) in table.columns.iter().zip(row) {
                match ["x", "y", "z"].iter().position(|axis| axis == name) {
                    Some(axis) => position[axis] = scalar.to_f64(value),
                    None => attributes.extend(value),
                }
            }
            positions.push(position);
        }
        for (encoding, line_end) in [
            (Encoding::Ascii, "\n"),
            (Encoding::Ascii, "\r\n"),
            (Encoding::Ascii, "\r"),
            (Encoding::LittleEndian, "\n"),
            (Encoding::BigEndian, "\r\n"),
            (Encoding::BigEndian, "\r"),
        ] {
            let cloud = read(&table.write(encoding, line_end)).expect("a readable file");
            if encoding == Encoding::Ascii {
                // Text of a single: its digits are kept, so the double differs in the last ones.
                for (found, expected) in cloud.positions.iter().zip(&positions) {
                    for axis in 0..3 {
                        let same = found[axis] == expected[axis]
                            || (found[axis] as f32) == (expected[axis] as f32);
                        prop_assert!(same, "{found:?} {expected:?}");
                    }
                }
                prop_assert_eq!(cloud.positions.len(), positions.len());
            } else {
                prop_assert_eq!(&cloud.positions, &positions);
            }
            prop_assert_eq!(&cloud.attributes, &attributes);
            prop_assert_eq!(cloud.info.left_out.len(), usize::from(table.list_before.is_some()));
            prop_assert!(cloud.report.dropped.is_empty() && cloud.report.warnings.is_empty());
        }
    }

    #[test]
    fn a_file_cut_before_its_last_vertex_ends_is_refused(table in table(), cut in 0.0_f64..1.0) {
        prop_assume!(!table.rows.is_empty());
        for encoding in [Encoding::Ascii, Encoding::LittleEndian, Encoding::BigEndian] {
            let bytes = table.write(encoding, "\n");
            // Cut text may still end in a number: only a missing line is sure to be seen.
            let last = match encoding {
                Encoding::Ascii => bytes[..bytes.len() - 1].iter().rposition(|&b| b == b'\n'),
                _ => Some(bytes.len() - 1),
            };
            let length = (last.expect("a header") as f64 * cut) as usize;
            prop_assert!(read(&bytes[..length]).is_err());
        }
    }
}

const ASCII: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n\
    0.5 1.25 -3 255 0 7\n\n1e-3 0 0 1 2 3\n  4 5 6 7 8 9  \n";

#[test]
fn ascii_tells_the_decimals_of_its_coordinates() {
    let cloud = read(ASCII.as_bytes()).expect("points");
    assert_eq!(cloud.positions, [[0.5, 1.25, -3.0], [1e-3, 0.0, 0.0], [4.0, 5.0, 6.0]]);
    assert_eq!(cloud.attributes, [255, 0, 7, 1, 2, 3, 7, 8, 9]);
    assert_eq!(cloud.report.decimals, Some(3));
    let float = CoordinateKind::Float { decimals: None, single_precision: true };
    assert_eq!(cloud.info.coordinates, float);
    assert_eq!((cloud.info.points, cloud.report.points_read), (Some(3), 3));
}

#[test]
fn faces_behind_the_vertices_are_ignored() {
    let with_face = ASCII.replace(
        "end_header",
        "element face 1\nproperty list uchar int vertex_indices\nend_header",
    ) + "3 0 1 2\n";
    let cloud = read(with_face.as_bytes()).expect("points");
    assert_eq!(cloud.positions.len(), 3);
    assert_eq!(cloud.report.warnings, [""; 0]);
}

#[test]
fn points_that_are_not_finite_are_dropped_and_counted() {
    let with_nan = ASCII.replace("0.5 1.25", "nan 1.25").replace("  4 5", "-inf 5");
    let cloud = read(with_nan.as_bytes()).expect("points");
    assert_eq!(cloud.positions, [[1e-3, 0.0, 0.0]]);
    assert_eq!(cloud.attributes, [1, 2, 3]);
    assert_eq!(cloud.report.dropped, [("coordinate is NaN or infinite".to_owned(), 2)]);
    assert_eq!(cloud.report.points_read, 3);
}

#[test]
fn counts_that_lie_are_refused_with_both_numbers() {
    let more = |count: &str| ASCII.replace("vertex 3", &format!("vertex {count}"));
    let message = refusal(more("4").as_bytes());
    assert!(message.contains("announces 4 vertex items, but only 3 follow"), "{message}");
    for count in ["100", "18446744073709551615"] {
        let message = refusal(more(count).as_bytes());
        assert!(message.contains(&format!("announces {count} vertex items")), "{message}");
    }
    assert!(refusal(more("-3").as_bytes()).contains("no count"));

    let binary = |count: u64| {
        let header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty float x\n\
             property float y\nproperty float z\nend_header\n"
        );
        [header.as_bytes(), &[0; 24]].concat()
    };
    let message = refusal(&binary(3));
    assert!(message.contains("announces 3 vertex items, but the 24 bytes after it hold only 2"));
    assert!(refusal(&binary(u64::MAX)).contains("hold only 2"));
}

#[test]
fn a_list_that_lies_about_its_length_is_refused() {
    let header = "ply\nformat binary_big_endian 1.0\nelement face 1\n\
        property list uint double corners\nelement vertex 1\nproperty float x\nproperty float y\n\
        property float z\nend_header\n";
    let body = [[0xff; 4].as_slice(), &[0; 12]].concat();
    let message = refusal(&[header.as_bytes(), &body].concat());
    assert!(message.contains("announces 1 face items, but the file ends"), "{message}");
}

#[test]
fn data_that_the_header_does_not_know_of_are_warned_of() {
    let fewer = ASCII.replace("vertex 3", "vertex 2");
    let warnings = read(fewer.as_bytes()).expect("points").report.warnings;
    assert!(warnings[0].contains("announces 2 vertices; lines after them"), "{warnings:?}");
}

#[test]
fn lines_that_are_no_vertex_are_refused_by_number() {
    for (from, to, why) in [
        ("4 5 6", "4 5 six", "line 14: \"six\" is no number"),
        ("4 5 6 7", "4 5 6 256", "line 14: \"256\" is no uchar"),
        ("4 5 6 7", "4 5 6 7.5", "line 14: \"7.5\" is no uchar"),
        ("7 8 9", "7 8", "line 14: 5 values, where the header announces 6"),
        ("7 8 9", "7 8 9 10", "line 14: more values than the 6"),
    ] {
        let message = refusal(ASCII.replace(from, to).as_bytes());
        assert!(message.contains(why), "{message}");
    }
}

#[test]
fn no_vertices_are_no_error() {
    let none = &ASCII.replace("vertex 3", "vertex 0")[..ASCII.find("0.5").expect("a point")];
    let cloud = read(none.as_bytes()).expect("an empty cloud");
    assert_eq!((cloud.positions.len(), cloud.report.points_read), (0, 0));
    assert_eq!(cloud.report.decimals, None);
}

#[test]
fn float_colours_are_scaled_from_their_range() {
    let cloud = |row: &str| {
        let text = ASCII.replace("uchar", "float").replace("255 0 7", row);
        let cloud = read(text.replace("1 2 3", "1 0 0").replace("7 8 9", "0 0 0").as_bytes());
        let cloud = cloud.expect("points");
        let color: Vec<u16> = cloud.attributes[..6]
            .chunks_exact(2)
            .map(|b| u16::from_le_bytes([b[0], b[1]]))
            .collect();
        (color, cloud.info.left_out.len(), cloud.report.warnings.len())
    };
    assert_eq!(cloud("1 0.5 0"), (vec![65535, 32768, 0], 0, 0));
    assert_eq!(cloud("1 -0.5 nan"), (vec![65535, 0, 0], 0, 1));
    assert_eq!(cloud("1.5 0.5 0"), (vec![65535, 32768, 0], 0, 1));
    assert_eq!(cloud("255 127 0"), (vec![255, 127, 0], 1, 0));
    assert_eq!(cloud("255 127.5 0"), (vec![65535, 32768, 0], 1, 0));
    assert_eq!(cloud("65535 300 0"), (vec![65535, 300, 0], 1, 0));
}

#[test]
fn many_blocks_keep_the_order_of_the_file() {
    let count = 3 * BLOCK_POINTS + 17;
    let table = Table {
        columns: ["x", "y", "z", "id"]
            .map(|name| {
                (name.to_owned(), if name == "id" { ScalarType::U32 } else { ScalarType::F32 })
            })
            .to_vec(),
        rows: (0..count)
            .map(|i| {
                let id = u32::try_from(i).expect("small").to_le_bytes().to_vec();
                let x = (i as f32).to_le_bytes().to_vec();
                vec![x.clone(), x.clone(), x, id]
            })
            .collect(),
        list_before: None,
        faces: 2,
    };
    for encoding in [Encoding::Ascii, Encoding::BigEndian] {
        let cloud = read(&table.write(encoding, "\n")).expect("points");
        assert_eq!(cloud.positions.len(), count);
        assert!(cloud.positions.iter().enumerate().all(|(i, p)| *p == [i as f64; 3]));
        let ids = cloud.attributes.chunks_exact(4).map(|b| ScalarType::U32.to_f64(b));
        assert!(ids.enumerate().all(|(i, id)| id == i as f64));
    }
}

#[test]
fn the_error_of_the_sink_ends_reading() {
    let file = file(ASCII.as_bytes());
    let reader = open(file.path()).expect("a reader");
    assert!(matches!(reader.read(&mut |_| Err(Error::Interrupted)), Err(Error::Interrupted)));
}

#[test]
fn what_is_no_ply_is_refused() {
    assert_eq!(refusal(b""), "the file is empty");
    assert!(refusal(b"solid cube\n").starts_with("not a PLY file"));
    assert!(
        refusal(b"ply\nformat ascii 1.0\nelement face 0\nend_header\n").contains("no vertices")
    );
    assert!(matches!(open(Path::new("no such file.ply")), Err(Error::Io { .. })));
}
