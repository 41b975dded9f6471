//! Where the values of an attribute come from in a block: a column, or the attribute's constant.

use lodestream_protocol::{Attribute, Domain, ScalarType};

use super::ExportBlock;
use crate::error::{Error, Result};

/// The values of one attribute in a block.
#[derive(Debug, Clone)]
pub(super) struct Source<'a> {
    bytes: SourceBytes<'a>,
    value_bytes: usize,
}

#[derive(Debug, Clone)]
enum SourceBytes<'a> {
    Column(&'a [u8]),
    Constant(Vec<u8>),
}

impl<'a> Source<'a> {
    /// Finds the values of attribute `index`.
    pub(super) fn find(
        attribute: &Attribute,
        index: usize,
        block: &'a ExportBlock,
    ) -> Result<Self> {
        let value_bytes = attribute.value_bytes();
        let column = block.columns.iter().find(|column| column.attribute == index);
        let bytes = if let Some(column) = column {
            let points = block.positions.len();
            if points.checked_mul(value_bytes) != Some(column.bytes.len()) {
                return Err(Error::Setup(format!(
                    "attribute {}: {} bytes for {points} points of {value_bytes} bytes each",
                    attribute.name,
                    column.bytes.len()
                )));
            }
            SourceBytes::Column(&column.bytes)
        } else if let Some(constant) = attribute.constant() {
            SourceBytes::Constant(constant)
        } else {
            return Err(Error::Setup(format!("attribute {} has no values", attribute.name)));
        };
        Ok(Self { bytes, value_bytes })
    }

    /// The value of a point, little-endian.
    pub(super) fn value(&self, point: usize) -> &[u8] {
        match &self.bytes {
            SourceBytes::Column(bytes) => &bytes[point * self.value_bytes..][..self.value_bytes],
            SourceBytes::Constant(value) => value,
        }
    }
}

/// Whether an attribute has a value for each point.
pub(super) fn is_per_point(attribute: &Attribute) -> bool {
    attribute.domain == Domain::Element
}

/// The least and greatest value of a type, as floats; inexact for 64 bits.
pub(super) fn limits(scalar: ScalarType) -> (f64, f64) {
    let bits = 8 * scalar.size_bytes() as i32;
    if scalar.is_signed() {
        (-f64::from(bits - 1).exp2(), f64::from(bits - 1).exp2() - 1.0)
    } else if scalar.is_integer() {
        (0.0, f64::from(bits).exp2() - 1.0)
    } else {
        (f64::NEG_INFINITY, f64::INFINITY)
    }
}

/// The least and greatest value that the components of an attribute take, where the manifest tells,
/// else what its type can hold.
pub(super) fn range(attribute: &Attribute) -> (f64, f64) {
    let components = usize::from(attribute.components);
    let (min, max) = (&attribute.min, &attribute.max);
    let told = min.len() == components
        && max.len() == components
        && min.iter().chain(max).all(|value| value.is_finite());
    if !told {
        return limits(attribute.scalar);
    }
    let least = min.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = max.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (least, greatest)
}

/// Whether 64-bit integers of this attribute are exact as binary64.
pub(super) fn is_exact_as_f64(attribute: &Attribute) -> bool {
    const EXACT: f64 = 9_007_199_254_740_992.0; // 2^53
    let (least, greatest) = range(attribute);
    least > -EXACT && greatest < EXACT
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{Column, Storage};

    use super::*;

    fn attribute(scalar: ScalarType, storage: Storage) -> Attribute {
        Attribute {
            name: "a".into(),
            scalar,
            components: 1,
            domain: Domain::Element,
            storage,
            min: vec![-3.0],
            max: vec![7.0],
        }
    }

    #[test]
    fn limits_are_those_of_the_type() {
        assert_eq!(limits(ScalarType::I16), (-32768.0, 32767.0));
        assert_eq!(limits(ScalarType::U8), (0.0, 255.0));
    }

    #[test]
    fn a_block_must_bring_what_is_not_constant() {
        let column = attribute(ScalarType::U16, Storage::Column { group: 0 });
        let mut block = ExportBlock { positions: vec![[0; 3]; 2], columns: Vec::new() };
        assert!(Source::find(&column, 0, &block).is_err());
        block.columns.push(Column { attribute: 0, bytes: vec![1, 0, 2] });
        assert!(Source::find(&column, 0, &block).is_err());
        block.columns[0].bytes.push(0);
        let source = Source::find(&column, 0, &block).expect("two values for two points");
        assert_eq!((source.value(0), source.value(1)), (&[1, 0][..], &[2, 0][..]));

        let constant = attribute(ScalarType::U16, Attribute::constant_storage(&[9, 1]));
        let source = Source::find(&constant, 1, &block).expect("a constant");
        assert_eq!(source.value(1), [9, 1]);
    }
}
