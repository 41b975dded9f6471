//! What a dataset's nodes weigh in a rival's encoding, so that its way to fetch is judged with the bytes that
//! it would have to fetch.
//!
//! PotreeConverter 2 with `--encoding BROTLI` stores a node as one stream of brotli (quality 6, a window of 22
//! bits) over columns in the Morton order of the points: positions at the cloud's resolution, from the node's
//! lowest corner, as two interleaved halves of 8 bytes; colours interleaved in 8 bytes; every other attribute
//! as it is. A viewer fetches all of it, whatever it shows. (Columns and
//! parameters are those of version 2.1.)
//!
//! It is given what costs it nothing: attributes that are the same everywhere are left out, and colours of 8
//! bits stay so.

use std::{collections::HashMap, io, sync::Arc};

use lodestream_protocol::{
    Attribute, Dataset, Manifest, MortonCode, Node, NodePoints, ReadAt, ScalarType,
};
use rayon::prelude::*;

/// As the converter has it.
const QUALITY: i32 = 6;

/// log2 of the bytes that are looked back at.
const WINDOW_BITS: i32 = 22;

/// Bits of half a position, interleaved: 16 of each axis.
const HALF_BITS: u32 = 48;

/// What the nodes of a dataset weigh.
#[derive(Debug, Default)]
pub struct Weights {
    /// Bytes of each node, by where its first group begins in the file.
    pub nodes: Arc<HashMap<u64, u64>>,
    /// Bytes of all of them, if the files were made without what is not shown.
    pub shown: u64,
}

/// Weighs the nodes; `shown` are the groups that the picture needs besides the first.
///
/// # Errors
/// Where the dataset cannot be read.
pub fn weigh<R: ReadAt + Sync>(dataset: &Dataset<R>, shown: &[usize]) -> anyhow::Result<Weights> {
    let manifest = dataset.manifest();
    let groups: Vec<usize> = (0..manifest.groups.len()).collect();
    let is_shown = |attribute: &Attribute| {
        attribute.group().is_some_and(|group| group == 0 || shown.contains(&group))
    };
    let encode = |node: &Node| {
        let points = dataset.read_node(node, &groups)?;
        let all = payload(manifest, &points)?.len() as u64;
        let shows_all =
            points.columns.iter().all(|column| is_shown(&manifest.attributes[column.attribute]));
        let shown = if shows_all {
            all
        } else {
            compressed(&columns(manifest, &points, is_shown))?.len() as u64
        };
        Ok((node.payloads.first().map(|payload| (payload.offset, all)), shown))
    };
    let nodes = dataset.hierarchy()?;
    let weighed = nodes.par_iter().map(encode).collect::<anyhow::Result<Vec<_>>>()?;
    Ok(Weights {
        shown: weighed.iter().map(|(_, shown)| shown).sum(),
        nodes: Arc::new(weighed.into_iter().filter_map(|(node, _)| node).collect()),
    })
}

/// A node as the converter stores it.
///
/// # Errors
/// None that a machine with enough memory has.
pub fn payload(manifest: &Manifest, points: &NodePoints) -> io::Result<Vec<u8>> {
    compressed(&columns(manifest, points, |_| true))
}

/// The columns of a node before they are compressed, one after the other; of attributes that are kept.
fn columns(
    manifest: &Manifest,
    points: &NodePoints,
    keeps: impl Fn(&Attribute) -> bool,
) -> Vec<u8> {
    let positions = &points.positions;
    let low = |axis: usize| positions.iter().map(|q| q[axis]).min().unwrap_or(0);
    let low = [low(0), low(1), low(2)];
    let code = |q: &[u32; 3]| u128::encode(std::array::from_fn(|axis| q[axis] - low[axis]));
    let mut order: Vec<(u128, usize)> = positions.iter().map(code).zip(0..).collect();
    order.sort_unstable();

    let half = |code: u128| ((code & ((1 << HALF_BITS) - 1)) as u64).to_le_bytes();
    let mut bytes = Vec::new();
    for (code, _) in &order {
        bytes.extend(half(code >> HALF_BITS));
        bytes.extend(half(*code));
    }
    for column in &points.columns {
        let attribute = &manifest.attributes[column.attribute];
        if !keeps(attribute) {
            continue;
        }
        let len = attribute.value_bytes();
        let values = order.iter().map(|(_, point)| &column.bytes[point * len..][..len]);
        let is_color = attribute.name == "color" && attribute.components == 3;
        match attribute.scalar {
            ScalarType::U8 if is_color => {
                values.for_each(|v| bytes.extend(interleaved([v[0], v[1], v[2]].map(u32::from))));
            }
            ScalarType::U16 if is_color => values.for_each(|v| {
                let component = |i: usize| u32::from(u16::from_le_bytes([v[2 * i], v[2 * i + 1]]));
                bytes.extend(interleaved([component(0), component(1), component(2)]));
            }),
            _ => values.for_each(|value| bytes.extend(value)),
        }
    }
    bytes
}

fn interleaved(color: [u32; 3]) -> [u8; 8] {
    u64::encode(color).to_le_bytes()
}

/// What they compress to.
fn compressed(mut bytes: &[u8]) -> io::Result<Vec<u8>> {
    let parameters = brotli::enc::BrotliEncoderParams {
        quality: QUALITY,
        lgwin: WINDOW_BITS,
        size_hint: bytes.len(),
        ..Default::default()
    };
    let mut compressed = Vec::new();
    brotli::BrotliCompress(&mut bytes, &mut compressed, &parameters)?;
    Ok(compressed)
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{Column, NodeKey};
    use proptest::prelude::*;

    use super::*;
    use crate::engine::Policy;

    fn manifest(color: ScalarType) -> Manifest {
        let attribute = |name: &str, scalar, components| Attribute {
            name: name.into(),
            scalar,
            components,
            domain: lodestream_protocol::Domain::Element,
            storage: lodestream_protocol::Storage::Column { group: 0 },
            min: Vec::new(),
            max: Vec::new(),
        };
        Manifest {
            attributes: vec![
                attribute("color", color, 3),
                attribute("intensity", ScalarType::U16, 1),
            ],
            ..crate::render::testing::manifest()
        }
    }

    proptest! {
        #[test]
        fn columns_say_what_the_points_are(
            points in prop::collection::vec((any::<[u32; 3]>(), any::<[u16; 3]>(), any::<u16>()), 1..40),
        ) {
            let node = NodePoints {
                positions: points.iter().map(|p| p.0).collect(),
                columns: vec![
                    Column { attribute: 0, bytes: points.iter().flat_map(|p| p.1).flat_map(u16::to_le_bytes).collect() },
                    Column { attribute: 1, bytes: points.iter().flat_map(|p| p.2.to_le_bytes()).collect() },
                ],
                ..NodePoints::new(NodeKey::ROOT)
            };
            let columns = columns(&manifest(ScalarType::U16), &node, |_| true);
            prop_assert_eq!(columns.len(), (16 + 8 + 2) * points.len());
            let word = |at: usize| u64::from_le_bytes(columns[at..at + 8].try_into().expect("eight bytes"));
            let low: [u32; 3] = std::array::from_fn(|axis| points.iter().map(|p| p.0[axis]).min().expect("one"));
            let mut found: Vec<_> = (0..points.len()).map(|i| {
                let code = u128::from(word(16 * i)) << HALF_BITS | u128::from(word(16 * i + 8));
                let q = code.decode();
                let position = std::array::from_fn::<u32, 3, _>(|axis| q[axis] + low[axis]);
                let color = word(16 * points.len() + 8 * i).decode().map(|c| c as u16);
                let at = 24 * points.len() + 2 * i;
                (position, color, u16::from_le_bytes([columns[at], columns[at + 1]]))
            }).collect();
            let mut given = points.clone();
            given.sort_unstable();
            found.sort_unstable();
            prop_assert_eq!(found, given);
        }
    }

    #[test]
    fn what_is_alike_weighs_little_and_what_is_random_all_of_it() {
        let random: Vec<u8> = std::iter::repeat_with(|| fastrand::u8(..)).take(10_000).collect();
        assert!(compressed(&random).expect("compressed").len() >= 10_000);
        assert!(compressed(&[7; 10_000]).expect("compressed").len() < 100);
        assert_eq!("potree-brotli".parse(), Ok(Policy::PotreeBrotli));
    }
}
