//! Columns: a node's values, and their encodings.
//!
//! The payload of a node and a group is its columns one after the other, each a byte of encoding,
//! a length and the data. Group 0 starts with the positions. All parts together are lossless.
//!
//! Numbers go through `pco`: on aerial scans it packs Morton deltas to 3.1 bytes a point and
//! decodes at several hundred million values a second a core, ahead of zstd and bit-packing on both.

use pco::{
    ChunkConfig, DeltaSpec, ModeSpec,
    data_types::Number,
    standalone::{simple_compress, simple_decompress_into},
};

use crate::{
    attribute::{Attribute, Domain, ScalarType},
    color::{FineColors, decode_coarse_colors, decode_fine_colors},
    error::{Error, Result, corrupt},
    hierarchy::{MAX_NODE_POINTS, Node},
    manifest::Manifest,
    position::{FinePositions, decode_fine_positions, decode_positions},
};

/// How a column's data is to be read; the byte in front of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Encoding {
    /// One value, which all elements share.
    Constant = 0,
    /// Values interleaved, little-endian. Positions: three u32 each.
    Raw = 1,
    /// One pco stream per component.
    Pco = 2,
    /// Three pco streams: `c1`, `c0 - c1`, `c2 - c1`, modulo the component's width (for a colour:
    /// green, red - green, blue - green).
    PcoColor = 3,
    /// One pco stream of u64: node-relative Morton codes, ascending. Nodes of at most 21 bits.
    Morton = 4,
    /// Two pco streams of u64: bits 48.. and bits 0..48 of the node-relative Morton codes, for
    /// nodes of more than 21 bits.
    MortonWide = 5,
    /// A byte `s`, and one pco stream of u64: node-relative Morton codes without their lowest `3s`
    /// bits, ascending. A position is the centre of its cell of side `2^s`.
    Cells = 6,
    /// A byte `s`, and the lowest `3s` bits of the Morton codes: one pco stream of u16 (`s` up to 5),
    /// u32 (up to 10) or u64 (up to 21), else two as in [`MortonWide`](Self::MortonWide).
    FinePositions = 7,
    /// Colours to their highest bits: how they are parted, and three pco streams of i32. See
    /// [`encode_colors`](crate::encode_colors).
    CoarseColor = 8,
    /// What these lack: how they are parted, and three pco streams of i32.
    FineColor = 9,
}

impl Encoding {
    fn parse(byte: u8) -> Result<Self> {
        Ok(match byte {
            0 => Self::Constant,
            1 => Self::Raw,
            2 => Self::Pco,
            3 => Self::PcoColor,
            4 => Self::Morton,
            5 => Self::MortonWide,
            6 => Self::Cells,
            7 => Self::FinePositions,
            8 => Self::CoarseColor,
            9 => Self::FineColor,
            other => return Err(corrupt("column", format!("unknown encoding {other}"))),
        })
    }
}

/// Below this many values a raw column is tried too: pco's own tables can outweigh it.
pub(crate) const TRY_RAW_BELOW: usize = 256;
/// pco effort. On Autzen levels 4, 6 and 8 give 5.59, 5.40 and 5.37 bytes a point; 6 makes the build
/// about 6 % longer than 4 does, 8 about 10 %.
const PCO_LEVEL: usize = 6;

/// A decoded column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Index into [`Manifest::attributes`].
    pub attribute: usize,
    /// Values interleaved, little-endian: [`Attribute::value_bytes`] each.
    pub bytes: Vec<u8>,
}

/// A decoded group of a node.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DecodedGroup {
    /// For group 0: positions in lattice units relative to the node's lowest corner, in Morton
    /// order, or the centres of the cells that they lie in; empty for other groups.
    pub positions: Vec<[u32; 3]>,
    /// log2 of the side of these cells in lattice units; 0 where the positions are whole.
    pub cell_bits: u8,
    /// Whether there are colours that lack their last bits.
    pub has_coarse_colors: bool,
    /// For the group of [`Fine`](crate::Fine) positions, where the node has any.
    pub fine: Option<FinePositions>,
    /// For that group, where group 0 has coarse colours of the node.
    pub fine_colors: Option<FineColors>,
    /// One per attribute of the group, in the manifest's order.
    pub columns: Vec<Column>,
}

pub(crate) fn config(scalar: ScalarType, delta: DeltaSpec) -> ChunkConfig {
    let mode = match scalar {
        ScalarType::F32 | ScalarType::F64 => ModeSpec::Auto,
        _ => ModeSpec::Classic,
    };
    ChunkConfig::default()
        .with_compression_level(PCO_LEVEL)
        .with_mode_spec(mode)
        .with_delta_spec(delta)
        .with_enable_8_bit(true)
}

pub(crate) fn push_column(out: &mut Vec<u8>, encoding: Encoding, data: &[u8]) -> Result<()> {
    let len = u32::try_from(data.len())
        .map_err(|_| corrupt("column", "more than 4 GiB of one node's values"))?;
    out.push(encoding as u8);
    out.extend_from_slice(&len.to_le_bytes());
    out.extend_from_slice(data);
    Ok(())
}

pub(crate) fn push_stream<T: Number>(
    data: &mut Vec<u8>,
    values: &[T],
    config: &ChunkConfig,
) -> Result<()> {
    let stream = simple_compress(values, config).map_err(|e| corrupt("column", e.to_string()))?;
    let len = u32::try_from(stream.len())
        .map_err(|_| corrupt("column", "more than 4 GiB of one node's values"))?;
    data.extend_from_slice(&len.to_le_bytes());
    data.extend_from_slice(&stream);
    Ok(())
}

/// Calls `$body` with `$t` bound to the Rust type of `$scalar`.
macro_rules! with_scalar {
    ($scalar:expr, $t:ident => $body:expr) => {
        match $scalar {
            ScalarType::U8 => {
                type $t = u8;
                $body
            }
            ScalarType::I8 => {
                type $t = i8;
                $body
            }
            ScalarType::U16 => {
                type $t = u16;
                $body
            }
            ScalarType::I16 => {
                type $t = i16;
                $body
            }
            ScalarType::U32 => {
                type $t = u32;
                $body
            }
            ScalarType::I32 => {
                type $t = i32;
                $body
            }
            ScalarType::U64 => {
                type $t = u64;
                $body
            }
            ScalarType::I64 => {
                type $t = i64;
                $body
            }
            ScalarType::F32 => {
                type $t = f32;
                $body
            }
            ScalarType::F64 => {
                type $t = f64;
                $body
            }
        }
    };
}

/// A scalar that columns are made of.
trait Scalar: Number + bytemuck::Pod {
    fn swap_if_big_endian(self) -> Self;
}

macro_rules! impl_scalar {
    ($($t:ty),*) => { $(impl Scalar for $t {
        fn swap_if_big_endian(self) -> Self { <$t>::from_le_bytes(bytemuck::bytes_of(&self).try_into().expect("own size")) }
    })* };
}
impl_scalar!(u8, i8, u16, i16, u32, i32, u64, i64, f32, f64);

/// Component `component` of every interleaved value.
fn component<T: Scalar>(values: &[u8], component: usize, components: usize) -> Vec<T> {
    let size = size_of::<T>();
    values
        .chunks_exact(size * components)
        .map(|v| {
            bytemuck::pod_read_unaligned::<T>(&v[component * size..][..size]).swap_if_big_endian()
        })
        .collect()
}

/// Appends the column of one attribute: `values` interleaved, little-endian.
///
/// # Errors
/// [`Error::Corrupt`] where `values` is no whole number of values or too large.
pub fn encode_column(out: &mut Vec<u8>, attribute: &Attribute, values: &[u8]) -> Result<()> {
    let value_bytes = attribute.value_bytes();
    if !values.len().is_multiple_of(value_bytes) {
        return Err(corrupt("column", format!("{}: a value is cut", attribute.name)));
    }
    if let Some(first) = values.get(..value_bytes)
        && values.chunks_exact(value_bytes).all(|v| v == first)
    {
        return push_column(out, Encoding::Constant, first);
    }
    let components = usize::from(attribute.components);
    let mut data = Vec::new();
    let encoding = match attribute.scalar {
        ScalarType::U8 if components == 3 => color::<u8>(&mut data, values, u8::wrapping_sub)?,
        ScalarType::U16 if components == 3 => color::<u16>(&mut data, values, u16::wrapping_sub)?,
        scalar => with_scalar!(scalar, T => {
            for c in 0..components {
                let delta = if size_of::<T>() == 8 { DeltaSpec::Auto } else { DeltaSpec::TryConsecutive(1) };
                push_stream(&mut data, &component::<T>(values, c, components), &config(scalar, delta))?;
            }
            Encoding::Pco
        }),
    };
    if values.len() / value_bytes < TRY_RAW_BELOW && data.len() >= values.len() {
        return push_column(out, Encoding::Raw, values);
    }
    push_column(out, encoding, &data)
}

fn color<T: Scalar>(data: &mut Vec<u8>, values: &[u8], sub: fn(T, T) -> T) -> Result<Encoding> {
    let [red, green, blue] = [0, 1, 2].map(|c| component::<T>(values, c, 3));
    let minus_green = |v: &[T]| v.iter().zip(&green).map(|(&v, &g)| sub(v, g)).collect::<Vec<T>>();
    let config = config(ScalarType::U16, DeltaSpec::TryConsecutive(1));
    push_stream(data, &green, &config)?;
    push_stream(data, &minus_green(&red), &config)?;
    push_stream(data, &minus_green(&blue), &config)?;
    Ok(Encoding::PcoColor)
}

/// Splits `bytes` at `len`, or says what is missing.
pub(crate) fn take<'a>(bytes: &mut &'a [u8], len: usize) -> Result<&'a [u8]> {
    let (head, tail) = bytes.split_at_checked(len).ok_or(Error::Truncated {
        what: "column",
        needed: len as u64,
        available: bytes.len() as u64,
    })?;
    *bytes = tail;
    Ok(head)
}

pub(crate) fn take_u32(bytes: &mut &[u8]) -> Result<usize> {
    let raw = take(bytes, 4)?;
    Ok(u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]) as usize)
}

pub(crate) fn take_column<'a>(bytes: &mut &'a [u8]) -> Result<(Encoding, &'a [u8])> {
    let encoding = Encoding::parse(take(bytes, 1)?[0])?;
    let len = take_u32(bytes)?;
    Ok((encoding, take(bytes, len)?))
}

pub(crate) fn take_stream<T: Number + Default>(data: &mut &[u8], count: usize) -> Result<Vec<T>> {
    let len = take_u32(data)?;
    let stream = take(data, len)?;
    let mut values = vec![T::default(); count];
    let progress = simple_decompress_into(stream, &mut values)
        .map_err(|e| corrupt("column", e.to_string()))?;
    if progress.n_processed != count || !progress.finished {
        return Err(corrupt("column", format!("not the {count} values of its node")));
    }
    Ok(values)
}

pub(crate) fn check_used(data: &[u8]) -> Result<()> {
    if data.is_empty() { Ok(()) } else { Err(corrupt("column", "bytes are left over")) }
}

pub(crate) fn decode_column(
    bytes: &mut &[u8],
    attribute: &Attribute,
    count: usize,
) -> Result<Vec<u8>> {
    let (encoding, mut data) = take_column(bytes)?;
    let components = usize::from(attribute.components);
    let values = match encoding {
        Encoding::Constant => take(&mut data, attribute.value_bytes())?.repeat(count),
        Encoding::Raw => take(&mut data, count * attribute.value_bytes())?.to_vec(),
        Encoding::Pco => with_scalar!(attribute.scalar, T => {
            decode_components::<T>(&mut data, count, components)?
        }),
        Encoding::PcoColor if components == 3 => match attribute.scalar {
            ScalarType::U8 => decode_color::<u8>(&mut data, count, u8::wrapping_add)?,
            ScalarType::U16 => decode_color::<u16>(&mut data, count, u16::wrapping_add)?,
            other => return Err(corrupt("column", format!("colour of {other:?}"))),
        },
        other => {
            return Err(corrupt("column", format!("{}: encoding {other:?}", attribute.name)));
        }
    };
    check_used(data)?;
    Ok(values)
}

fn decode_components<T: Scalar + Default>(
    data: &mut &[u8],
    count: usize,
    components: usize,
) -> Result<Vec<u8>> {
    if components == 1 {
        let values = take_stream::<T>(data, count)?;
        return Ok(to_le_bytes(values));
    }
    let mut values = vec![T::default(); count * components];
    for c in 0..components {
        for (value, v) in values.chunks_exact_mut(components).zip(take_stream::<T>(data, count)?) {
            value[c] = v;
        }
    }
    Ok(to_le_bytes(values))
}

fn decode_color<T: Scalar + Default>(
    data: &mut &[u8],
    count: usize,
    add: fn(T, T) -> T,
) -> Result<Vec<u8>> {
    let green = take_stream::<T>(data, count)?;
    let red = take_stream::<T>(data, count)?;
    let blue = take_stream::<T>(data, count)?;
    let values: Vec<T> = green
        .iter()
        .zip(red.iter().zip(&blue))
        .flat_map(|(&g, (&r, &b))| [add(r, g), g, add(b, g)])
        .collect();
    Ok(to_le_bytes(values))
}

fn to_le_bytes<T: Scalar>(mut values: Vec<T>) -> Vec<u8> {
    if cfg!(target_endian = "big") {
        values.iter_mut().for_each(|v| *v = v.swap_if_big_endian());
    }
    bytemuck::cast_slice(&values).to_vec()
}

/// Decodes one group of a node from its payload.
///
/// # Errors
/// [`Error::Checksum`] where `payload` is not what was written; [`Error::Corrupt`] or
/// [`Error::Truncated`] where it contradicts the format.
pub fn decode_group(
    manifest: &Manifest,
    group: usize,
    node: &Node,
    payload: &[u8],
) -> Result<DecodedGroup> {
    check_group(node, group, payload)?;
    decode_unchecked(manifest, group, node, payload)
}

/// Checks that `payload` is what was written for that group of `node`, without decoding it.
///
/// # Errors
/// [`Error::Checksum`] where it is not, [`Error::Corrupt`] where the node has no such group.
pub fn check_group(node: &Node, group: usize, payload: &[u8]) -> Result<()> {
    let reference = node.payloads.get(group).ok_or_else(|| corrupt("node", "no such group"))?;
    let found = crc32fast::hash(payload);
    if found != reference.crc {
        return Err(Error::Checksum {
            what: format!("node {} group {group}", node.key),
            expected: reference.crc,
            found,
        });
    }
    Ok(())
}

/// [`decode_group`] without the checksum: for fuzzing the decoder behind it.
///
/// # Errors
/// [`Error::Corrupt`] or [`Error::Truncated`] where `payload` contradicts the format.
pub fn decode_unchecked(
    manifest: &Manifest,
    group: usize,
    node: &Node,
    mut payload: &[u8],
) -> Result<DecodedGroup> {
    let count = node.points.min(MAX_NODE_POINTS) as usize;
    let mut decoded = DecodedGroup::default();
    if count == 0 {
        check_used(payload)?;
        return Ok(decoded);
    }
    let bits = manifest.lattice.node_bits(node.key.level());
    let color = manifest.fine_color();
    if group == 0 {
        (decoded.positions, decoded.cell_bits) = decode_positions(&mut payload, count, bits)?;
    } else if manifest.fine.is_some_and(|fine| fine.group == group) {
        // What group 0 tells whole has no second part.
        if payload.first() == Some(&(Encoding::FinePositions as u8)) {
            decoded.fine = Some(decode_fine_positions(&mut payload, count, bits)?);
        }
        if let Some(index) = color
            && !payload.is_empty()
        {
            let color = &manifest.attributes[index];
            decoded.fine_colors = Some(decode_fine_colors(&mut payload, color, index, count)?);
        }
    }
    let mut texels = 0;
    for (index, attribute) in manifest.attributes.iter().enumerate() {
        if attribute.group() != Some(group) {
            continue;
        }
        let values = match attribute.domain {
            Domain::Element => count,
            Domain::Texel => texels,
        };
        let coarse = if color == Some(index) {
            decode_coarse_colors(&mut payload, attribute.scalar, values)?
        } else {
            None
        };
        let bytes = match coarse {
            Some((shown, is_coarse)) => {
                decoded.has_coarse_colors = is_coarse;
                shown
            }
            None => decode_column(&mut payload, attribute, values)?,
        };
        if attribute.name == "texture_size" {
            texels = count_texels(attribute, &bytes)?;
        }
        decoded.columns.push(Column { attribute: index, bytes });
    }
    check_used(payload)?;
    Ok(decoded)
}

/// Texels of all rectangles of a node, from its decoded `texture_size` column.
fn count_texels(attribute: &Attribute, sizes: &[u8]) -> Result<usize> {
    let size = attribute.scalar.size_bytes();
    let mut texels = 0.0;
    for value in sizes.chunks_exact(2 * size) {
        texels += attribute.scalar.to_f64(&value[..size]) * attribute.scalar.to_f64(&value[size..]);
    }
    if !(0.0..=f64::from(MAX_NODE_POINTS)).contains(&texels) {
        return Err(corrupt("column", format!("{texels} texels in one node")));
    }
    Ok(texels as usize)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attribute::Storage;
    use proptest::prelude::*;

    fn scalars() -> impl Strategy<Value = ScalarType> {
        use ScalarType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
        prop::sample::select(vec![U8, I8, U16, I16, U32, I32, U64, I64, F32, F64])
    }

    proptest! {
        #[test]
        fn columns_of_any_bits_read_back(
            scalar in scalars(), components in 1u8..5, bytes in prop::collection::vec(any::<u8>(), 0..4000),
            narrow in any::<bool>(),
        ) {
            let attribute = Attribute {
                name: "a".into(), scalar, components, domain: Domain::Element,
                storage: Storage::Column { group: 0 }, min: vec![], max: vec![],
            };
            let len = attribute.value_bytes();
            let count = bytes.len() / len;
            let mut values = bytes[..count * len].to_vec();
            if narrow {
                values.iter_mut().for_each(|v| *v &= 3);
            }
            let mut column = Vec::new();
            encode_column(&mut column, &attribute, &values)?;
            let back = decode_column(&mut &column[..], &attribute, count)?;
            prop_assert_eq!(back, values);
        }

        #[test]
        fn garbage_never_panics(bytes in prop::collection::vec(any::<u8>(), 0..300), count in 0usize..1000) {
            let attribute = Attribute {
                name: "a".into(), scalar: ScalarType::U16, components: 3, domain: Domain::Element,
                storage: Storage::Column { group: 0 }, min: vec![], max: vec![],
            };
            let _ = decode_column(&mut &bytes[..], &attribute, count);
        }
    }
}
