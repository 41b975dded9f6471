//! Input of the target `columns`.

use lodestream_protocol::{
    Attribute, Domain, Fine, GroupInfo, Manifest, Node, NodeKey, Primitive, ScalarType, Storage,
};

use crate::{leaf, manifest};

const TEXEL: u8 = 1 << 7;
const TEXTURE_SIZE: u8 = 1 << 6;
const COLOR: u8 = 1 << 5;
const SCALAR_MASK: u8 = 0b1111;
/// More elements only make a run slower: no decoder behaves differently beyond.
const MAX_POINTS: u32 = 1 << 18;

/// A node's payload of group 0 and all that a reader knows about it beforehand.
///
/// Bytes: lattice bits, level, elements (u24), attributes; for each of those a byte with its scalar
/// type, whether it holds texture sizes or colours and whether it belongs to texels, and a byte with its
/// components; the payload.
#[derive(Debug)]
pub struct ColumnsInput<'a> {
    /// What the payload is read with.
    pub manifest: Manifest,
    /// Whose payload it is.
    pub node: Node,
    /// The payload.
    pub payload: &'a [u8],
}

impl<'a> ColumnsInput<'a> {
    /// Takes the fuzzer's bytes apart; `None` where they describe no valid manifest.
    #[must_use]
    pub fn parse(data: &'a [u8]) -> Option<Self> {
        let (&[side_bits, level, p0, p1, p2, count], mut payload) = data.split_first_chunk()?;
        let side_bits = side_bits % 33;
        let level = level % (side_bits + 1);
        let mut attributes = Vec::new();
        for index in 0..count % 5 {
            let (&[kind, components], rest) = payload.split_first_chunk()?;
            payload = rest;
            attributes.push(Attribute {
                name: match kind & (TEXTURE_SIZE | COLOR) {
                    0 => format!("a{index}"),
                    COLOR => "color".into(),
                    _ => "texture_size".into(),
                },
                scalar: ScalarType::ALL[usize::from(kind & SCALAR_MASK) % ScalarType::ALL.len()],
                components,
                domain: if kind & TEXEL == 0 { Domain::Element } else { Domain::Texel },
                storage: Storage::Column { group: 0 },
                min: Vec::new(),
                max: Vec::new(),
            });
        }
        let textured = attributes.iter().any(|a| a.domain == Domain::Texel);
        if textured {
            attributes.extend(
                Primitive::Rectangle
                    .required_attributes()
                    .iter()
                    .filter(|(name, _)| *name != "texture_size")
                    .map(|&(name, components)| constant(name, components)),
            );
        }
        let mut manifest = manifest(side_bits, side_bits + 1, 1, attributes);
        if textured {
            manifest.primitive = Primitive::Rectangle;
        }
        manifest.to_json().ok()?;
        let points = u32::from_le_bytes([p0, p1, p2, 0]) % MAX_POINTS;
        let node = leaf(NodeKey::new(level, [0; 3])?, points);
        Some(Self { manifest, node, payload })
    }

    /// Undoes [`parse`](Self::parse), for a node of up to four stored attributes.
    #[must_use]
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        let [p0, p1, p2, _] = self.node.points.to_le_bytes();
        let stored: Vec<_> = self.manifest.columns_of(0).collect();
        let count = u8::try_from(stored.len()).ok().filter(|count| *count < 5)?;
        let mut bytes =
            vec![self.manifest.lattice.side_bits, self.node.key.level(), p0, p1, p2, count];
        for attribute in stored {
            let scalar = ScalarType::ALL.iter().position(|s| *s == attribute.scalar)?;
            let name = match attribute.name.as_str() {
                "texture_size" => TEXTURE_SIZE,
                "color" => COLOR,
                _ => 0,
            };
            let texel = if attribute.domain == Domain::Texel { TEXEL } else { 0 };
            bytes.push(u8::try_from(scalar).ok()? | name | texel);
            bytes.push(attribute.components);
        }
        bytes.extend_from_slice(self.payload);
        Some(bytes)
    }
}

/// The manifest of a dataset that has positions and colours in two parts; `manifest` is of one that has
/// them in one. The second part is its last group.
#[must_use]
pub fn in_parts(manifest: &Manifest) -> Manifest {
    let mut manifest = manifest.clone();
    let group = manifest.groups.len();
    manifest.groups.push(GroupInfo { name: "fine".into(), columns: vec![0, 0] });
    manifest.fine = Some(Fine { group, color: true, cells_per_spacing: 2 });
    manifest
}

fn constant(name: &str, components: u8) -> Attribute {
    Attribute {
        name: name.into(),
        scalar: ScalarType::U8,
        components,
        domain: Domain::Element,
        storage: Attribute::constant_storage(&vec![0; usize::from(components)]),
        min: Vec::new(),
        max: Vec::new(),
    }
}
