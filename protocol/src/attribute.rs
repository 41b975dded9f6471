//! Attributes: what a primitive carries besides its position.

use serde::{Deserialize, Serialize};

/// Scalar type of one component, stored little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ScalarType {
    /// Unsigned 8 bit.
    U8,
    /// Signed 8 bit.
    I8,
    /// Unsigned 16 bit.
    U16,
    /// Signed 16 bit.
    I16,
    /// Unsigned 32 bit.
    U32,
    /// Signed 32 bit.
    I32,
    /// Unsigned 64 bit.
    U64,
    /// Signed 64 bit.
    I64,
    /// IEEE 754 binary32.
    F32,
    /// IEEE 754 binary64.
    F64,
}

impl ScalarType {
    /// Size of one component in bytes.
    #[must_use]
    pub const fn size_bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Value of one little-endian component as f64 (u64 and i64 beyond 2^53 are rounded).
    ///
    /// `bytes` must hold [`size_bytes`](Self::size_bytes) bytes; missing ones read as zero.
    #[must_use]
    pub fn to_f64(self, bytes: &[u8]) -> f64 {
        let mut raw = [0u8; 8];
        let size = self.size_bytes().min(bytes.len());
        raw[..size].copy_from_slice(&bytes[..size]);
        let bits = u64::from_le_bytes(raw);
        let [b0, b1, b2, b3, ..] = raw;
        match self {
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits as f64,
            Self::I8 => f64::from(i8::from_le_bytes([b0])),
            Self::I16 => f64::from(i16::from_le_bytes([b0, b1])),
            Self::I32 => f64::from(i32::from_le_bytes([b0, b1, b2, b3])),
            Self::I64 => i64::from_le_bytes(raw) as f64,
            Self::F32 => f64::from(f32::from_le_bytes([b0, b1, b2, b3])),
            Self::F64 => f64::from_le_bytes(raw),
        }
    }
}

/// What one value of an attribute belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum Domain {
    /// One value per primitive.
    #[default]
    Element,
    /// One value per texel of a textured rectangle; a node holds the sum over its rectangles of
    /// `texture_size.0 * texture_size.1` of them, row by row, rectangle after rectangle.
    Texel,
}

/// Where the values of an attribute are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Storage {
    /// A column in the payload of column group `group` of every node.
    Column {
        /// Index into [`Manifest::groups`](crate::Manifest::groups).
        group: usize,
    },
    /// Every primitive has this one value: nothing is stored per node. Little-endian bytes of all
    /// components, in lower-case hexadecimal.
    Constant {
        /// Hexadecimal bytes, `2 * components * size` characters.
        value: String,
    },
}

/// One attribute of the dataset.
///
/// Names with a fixed meaning: `color` (red, green, blue), `intensity`, `classification`, `normal`
/// (unit vector), `gps_time`, `radius`, `axis_u`, `axis_v`, `texture_size`, `texel_color`,
/// `texel_height`. LAS names are kept as the specification spells them, in snake case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Attribute {
    /// Unique name.
    pub name: String,
    /// Type of each component.
    #[serde(rename = "type")]
    pub scalar: ScalarType,
    /// Components per value, 1 to 64.
    pub components: u8,
    /// What a value belongs to.
    #[serde(default)]
    pub domain: Domain,
    /// Where the values are.
    pub storage: Storage,
    /// Smallest value per component over the dataset.
    #[serde(default)]
    pub min: Vec<f64>,
    /// Largest value per component over the dataset.
    #[serde(default)]
    pub max: Vec<f64>,
}

impl Attribute {
    /// Bytes of one value, all components.
    #[must_use]
    pub fn value_bytes(&self) -> usize {
        self.scalar.size_bytes() * usize::from(self.components)
    }

    /// The column group that holds the values, or `None` for a constant.
    #[must_use]
    pub fn group(&self) -> Option<usize> {
        match self.storage {
            Storage::Column { group } => Some(group),
            Storage::Constant { .. } => None,
        }
    }

    /// The constant value as little-endian bytes, where the attribute is constant and well-formed.
    #[must_use]
    pub fn constant(&self) -> Option<Vec<u8>> {
        let Storage::Constant { value } = &self.storage else { return None };
        if !value.is_ascii() || value.len() != 2 * self.value_bytes() {
            return None;
        }
        (0..value.len()).step_by(2).map(|i| u8::from_str_radix(&value[i..i + 2], 16).ok()).collect()
    }

    /// [`Storage::Constant`] of the given little-endian bytes.
    #[must_use]
    pub fn constant_storage(bytes: &[u8]) -> Storage {
        Storage::Constant { value: bytes.iter().map(|b| format!("{b:02x}")).collect() }
    }
}
