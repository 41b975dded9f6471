//! Encoding and decoding of a node's columns.

use fastrand::Rng;
use lodestream_protocol::{
    Attribute, Domain, GroupInfo, Lattice, LatticeBox, Manifest, MortonCode, Node, NodeKey,
    PayloadRef, ScalarType, Storage, decode_group, encode_column, encode_positions,
};

use super::Rows;
use crate::stability::{Row, dataset};

const EXACT: &str = "lossless: every bit";
const REFERENCE: &str = "the bytes that were encoded";

pub(super) fn cases() -> Rows {
    let mut rng = Rng::with_seed(5);
    let mut rows = Vec::new();
    let positions: [(&str, Vec<u8>, usize); 4] = [
        ("positions of 1 to 32 bits, at random", (1..=32).collect(), 500),
        ("positions of a single point", vec![0, 1, 21, 22, 32], 1),
        ("positions of a hundred thousand duplicates", vec![32], 100_000),
        ("positions at the ends of the range", vec![21, 22, 31, 32], 2),
    ];
    for (case, widths, count) in positions {
        let mut wrong = 0;
        for bits in widths {
            let most = u32::try_from((1u64 << bits) - 1).unwrap_or(u32::MAX);
            let points: Vec<[u32; 3]> = match count {
                2 => vec![[0; 3], [most; 3]],
                100_000 => vec![[most, 0, most / 3]; count],
                _ => (0..count).map(|_| std::array::from_fn(|_| rng.u32(..=most))).collect(),
            };
            wrong += wrong_positions(points, bits)?;
        }
        rows.push(Row::new(case, (wrong as f64, "points"), (0.0, EXACT), REFERENCE));
    }
    let nan = f64::from_bits(0x7ff8_dead_beef_0001);
    let doubles = [
        0.0,
        -0.0,
        f64::from_bits(1),
        f64::MIN_POSITIVE,
        f64::MAX,
        f64::NEG_INFINITY,
        nan,
        1e7,
        0.1,
    ];
    let times: Vec<f64> = (0..2000).map(|i| 294_375_802.0 + f64::from(i) * 1e-6).collect();
    let singles =
        [0.0, -0.0, f32::from_bits(1), f32::MAX, f32::INFINITY, f32::from_bits(0x7fc0_1234)];
    let bytes_of_doubles = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let attributes: [(&str, ScalarType, u8, Vec<u8>); 6] = [
        (
            "doubles: NaN with payload, denormal, both zeros, infinite",
            ScalarType::F64,
            1,
            bytes_of_doubles(&doubles),
        ),
        ("GPS times a microsecond apart", ScalarType::F64, 1, bytes_of_doubles(&times)),
        (
            "normals of singles: NaN, denormal, zero, infinite",
            ScalarType::F32,
            3,
            singles.iter().cycle().take(600).flat_map(|v| v.to_le_bytes()).collect(),
        ),
        (
            "64-bit integers at the ends of the range",
            ScalarType::I64,
            1,
            [i64::MIN, -1, 0, i64::MAX]
                .iter()
                .cycle()
                .take(999)
                .flat_map(|v| v.to_le_bytes())
                .collect(),
        ),
        (
            "16-bit colours at random",
            ScalarType::U16,
            3,
            (0..3000).flat_map(|_| rng.u16(..).to_le_bytes()).collect(),
        ),
        ("one value for all", ScalarType::F64, 1, bytes_of_doubles(&[nan; 700])),
    ];
    for (case, scalar, components, bytes) in attributes {
        let wrong = wrong_bytes(scalar, components, &bytes)?;
        let mut row = Row::new(case, (wrong as f64, "bytes"), (0.0, EXACT), REFERENCE);
        if case.starts_with("GPS") {
            // Whole differences of more than a microsecond.
            let cut = times.iter().filter(|&&t| (f64::from(t as f32) - t).abs() > 1e-6).count();
            row = row.beside("single precision (times off by more than 1 µs)", cut as f64);
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Points that are not decoded as they were encoded.
fn wrong_positions(
    mut points: Vec<[u32; 3]>,
    bits: u8,
) -> Result<usize, lodestream_protocol::Error> {
    points.sort_by_key(|&q| u128::encode(q));
    let codes: Vec<u128> = points.iter().map(|&q| u128::encode(q)).collect();
    let mut payload = Vec::new();
    encode_positions(&mut payload, &codes, bits)?;
    let decoded =
        decode_group(&manifest(bits, Vec::new()), 0, &node(points.len(), &payload), &payload)?;
    let pairs = points.iter().zip(&decoded.positions);
    Ok(pairs.filter(|(a, b)| a != b).count() + points.len().abs_diff(decoded.positions.len()))
}

/// Bytes of a column that are not decoded as they were encoded.
fn wrong_bytes(
    scalar: ScalarType,
    components: u8,
    values: &[u8],
) -> Result<usize, lodestream_protocol::Error> {
    let attribute = Attribute {
        name: "value".into(),
        scalar,
        components,
        domain: Domain::Element,
        storage: Storage::Column { group: 0 },
        min: Vec::new(),
        max: Vec::new(),
    };
    let points = values.len() / attribute.value_bytes();
    let mut payload = Vec::new();
    encode_positions(&mut payload, &vec![0u64; points], 1)?;
    encode_column(&mut payload, &attribute, values)?;
    let manifest = manifest(1, vec![attribute]);
    let decoded = decode_group(&manifest, 0, &node(points, &payload), &payload)?;
    let found = decoded.columns.first().map_or(&[][..], |column| column.bytes.as_slice());
    let wrong = values.iter().zip(found).filter(|(a, b)| a != b).count();
    Ok(wrong + values.len().abs_diff(found.len()))
}

fn node(points: usize, payload: &[u8]) -> Node {
    Node {
        key: NodeKey::ROOT,
        child_mask: 0,
        points: u32::try_from(points).expect("cases are small"),
        bounds: LatticeBox::EMPTY,
        geometric_error: 0.0,
        spacing: 0.0,
        normal_cone: None,
        payloads: vec![PayloadRef {
            offset: 0,
            bytes: u32::try_from(payload.len()).expect("cases are small"),
            crc: crc32fast::hash(payload),
        }],
        child_page: None,
    }
}

fn manifest(side_bits: u8, attributes: Vec<Attribute>) -> Manifest {
    let lattice = Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits };
    let groups = vec![GroupInfo { name: "base".into(), columns: vec![0; 1 + attributes.len()] }];
    Manifest { groups, attributes, ..dataset::manifest(lattice) }
}
