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
    /// Every type, in the order of their declaration.
    pub const ALL: [Self; 10] = [
        Self::U8,
        Self::I8,
        Self::U16,
        Self::I16,
        Self::U32,
        Self::I32,
        Self::U64,
        Self::I64,
        Self::F32,
        Self::F64,
    ];

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
        let bits = self.bits(bytes);
        match self {
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => bits as f64,
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => self.extended(bits) as f64,
            Self::F32 => f64::from(f32::from_bits(bits as u32)),
            Self::F64 => f64::from_bits(bits),
        }
    }

    /// Value of one little-endian component of an integer type; `None` for floats.
    ///
    /// `bytes` must hold [`size_bytes`](Self::size_bytes) bytes; missing ones read as zero.
    #[must_use]
    pub fn to_i128(self, bytes: &[u8]) -> Option<i128> {
        let bits = self.bits(bytes);
        match self {
            _ if self.is_signed() => Some(self.extended(bits).into()),
            _ if self.is_integer() => Some(bits.into()),
            _ => None,
        }
    }

    /// Whether it is no float.
    #[must_use]
    pub const fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }

    /// Whether it is an integer that can be below zero.
    #[must_use]
    pub const fn is_signed(self) -> bool {
        matches!(self, Self::I8 | Self::I16 | Self::I32 | Self::I64)
    }

    /// The component's bytes, zeros above.
    fn bits(self, bytes: &[u8]) -> u64 {
        let mut raw = [0u8; 8];
        let size = self.size_bytes().min(bytes.len());
        raw[..size].copy_from_slice(&bytes[..size]);
        u64::from_le_bytes(raw)
    }

    /// A signed component with its sign in all bits above.
    const fn extended(self, bits: u64) -> i64 {
        let above = u64::BITS as usize - 8 * self.size_bytes();
        ((bits << above) as i64) >> above
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

    /// Whether it is the elements' normal.
    #[must_use]
    pub fn is_normal(&self) -> bool {
        self.name == "normal" && self.components == 3 && self.domain == Domain::Element
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

#[cfg(test)]
mod tests {
    use super::ScalarType::{self, F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};

    #[test]
    fn components_of_every_type_are_read_with_their_sign() {
        let cases: [(ScalarType, &[u8], f64, Option<i128>); 12] = [
            (U8, &[255], 255.0, Some(255)),
            (I8, &[255], -1.0, Some(-1)),
            (U16, &[0, 128], 32_768.0, Some(32_768)),
            (I16, &[0, 128], -32_768.0, Some(-32_768)),
            (U32, &[255; 4], 4_294_967_295.0, Some(4_294_967_295)),
            (I32, &[255; 4], -1.0, Some(-1)),
            (U64, &[255; 8], 18_446_744_073_709_551_615.0, Some(i128::from(u64::MAX))),
            (I64, &[255; 8], -1.0, Some(-1)),
            (
                I64,
                &[0, 0, 0, 0, 0, 0, 0, 128],
                -9.223_372_036_854_776e18,
                Some(i128::from(i64::MIN)),
            ),
            (I16, &[5], 5.0, Some(5)),
            (F32, &[0, 0, 0x20, 0xc0], -2.5, None),
            (F64, &[0, 0, 0, 0, 0, 0, 4, 0xc0], -2.5, None),
        ];
        for (scalar, bytes, float, integer) in cases {
            assert_eq!(scalar.to_f64(bytes), float, "{scalar:?}");
            assert_eq!(scalar.to_i128(bytes), integer, "{scalar:?}");
        }
    }

    #[test]
    fn all_types_are_there_in_order() {
        assert!(
            ScalarType::ALL.iter().enumerate().all(|(index, &scalar)| scalar as usize == index)
        );
    }
}
