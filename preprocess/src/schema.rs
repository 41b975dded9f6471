//! The union of all inputs' attributes, and how an input's rows become rows of the union.

use lodestream_protocol::ScalarType;

use crate::readers::InputAttribute;

/// Attributes of every point in the store: rows of values, little-endian, without padding.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Schema {
    /// The attributes.
    pub attributes: Vec<InputAttribute>,
    /// Where each attribute starts in a row.
    pub offsets: Vec<usize>,
    /// Bytes of a row.
    pub row_bytes: usize,
}

/// Bytes of one value.
pub fn value_bytes(attribute: &InputAttribute) -> usize {
    attribute.scalar.size_bytes() * usize::from(attribute.components)
}

impl Schema {
    /// Lays out rows of the given attributes.
    pub fn new(attributes: Vec<InputAttribute>) -> Self {
        let mut row_bytes = 0;
        let offsets = attributes
            .iter()
            .map(|a| {
                let at = row_bytes;
                row_bytes += value_bytes(a);
                at
            })
            .collect();
        Self { attributes, offsets, row_bytes }
    }

    /// The union over inputs, in order of first appearance, less `dropped` names. An attribute that
    /// comes in different types gets the smallest type that holds them all.
    pub fn union<'a>(
        inputs: impl Iterator<Item = &'a [InputAttribute]>,
        dropped: &[String],
    ) -> Self {
        let mut attributes: Vec<InputAttribute> = Vec::new();
        for attribute in inputs.flatten().filter(|a| !dropped.contains(&a.name)) {
            match attributes.iter_mut().find(|a| a.name == attribute.name) {
                Some(known) => {
                    known.scalar = wider(known.scalar, attribute.scalar);
                    known.components = known.components.max(attribute.components);
                }
                None => attributes.push(attribute.clone()),
            }
        }
        Self::new(attributes)
    }
}

/// The smallest scalar type that holds all values of both (64-bit integers beside floats: f64).
fn wider(a: ScalarType, b: ScalarType) -> ScalarType {
    use ScalarType::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    if a == b {
        return a;
    }
    if !a.is_integer() || !b.is_integer() {
        let small = |s| matches!(s, F32 | U8 | I8 | U16 | I16);
        return if small(a) && small(b) { F32 } else { F64 };
    }
    let size = a.size_bytes().max(b.size_bytes());
    if a.is_signed() || b.is_signed() {
        // An unsigned type needs the next larger signed one.
        let unsigned_size = [a, b].iter().filter(|s| !s.is_signed()).map(|s| s.size_bytes()).max();
        let size = size.max(unsigned_size.map_or(0, |s| 2 * s));
        return match size {
            1 => I8,
            2 => I16,
            4 => I32,
            8 => I64,
            _ => F64,
        };
    }
    match size {
        1 => U8,
        2 => U16,
        4 => U32,
        _ => U64,
    }
}

/// Turns an input's rows into rows of the union.
#[derive(Debug)]
pub enum RowMap {
    /// The rows are the same.
    Same,
    /// Value by value; what the input lacks stays zero.
    Convert {
        /// Bytes of an input row.
        from_bytes: usize,
        /// The moves.
        moves: Vec<Move>,
    },
}

/// One component's way from an input row to a union row.
#[derive(Debug)]
pub struct Move {
    from: usize,
    from_scalar: ScalarType,
    to: usize,
    to_scalar: ScalarType,
    /// 8-bit colours beside 16-bit ones are stretched to their range: 255 becomes 65535.
    stretch: bool,
}

impl RowMap {
    /// The map from rows of `input` to rows of `union`.
    pub fn new(input: &[InputAttribute], union: &Schema) -> Self {
        if input == union.attributes {
            return Self::Same;
        }
        let own = Schema::new(input.to_vec());
        let mut moves = Vec::new();
        for (attribute, &from) in input.iter().zip(&own.offsets) {
            let Some(slot) = union.attributes.iter().position(|a| a.name == attribute.name) else {
                continue;
            };
            let target = &union.attributes[slot];
            for c in 0..usize::from(attribute.components) {
                moves.push(Move {
                    from: from + c * attribute.scalar.size_bytes(),
                    from_scalar: attribute.scalar,
                    to: union.offsets[slot] + c * target.scalar.size_bytes(),
                    to_scalar: target.scalar,
                    stretch: target.name == "color"
                        && (attribute.scalar, target.scalar) == (ScalarType::U8, ScalarType::U16),
                });
            }
        }
        Self::Convert { from_bytes: own.row_bytes, moves }
    }

    /// The rows of `count` points as rows of the union.
    pub fn apply(&self, rows: Vec<u8>, count: usize, union: &Schema) -> Vec<u8> {
        let Self::Convert { from_bytes, moves } = self else { return rows };
        let mut out = vec![0; count * union.row_bytes];
        if union.row_bytes == 0 || *from_bytes == 0 {
            return out;
        }
        for (from, to) in rows.chunks_exact(*from_bytes).zip(out.chunks_exact_mut(union.row_bytes))
        {
            for step in moves {
                let from = &from[step.from..step.from + step.from_scalar.size_bytes()];
                let to = &mut to[step.to..step.to + step.to_scalar.size_bytes()];
                step.convert(from, to);
            }
        }
        out
    }
}

impl Move {
    fn convert(&self, from: &[u8], to: &mut [u8]) {
        use ScalarType::{F32, F64};
        if self.stretch {
            to.copy_from_slice(&(u16::from(from[0]) * 257).to_le_bytes());
        } else if self.from_scalar == self.to_scalar {
            to.copy_from_slice(from);
        } else if self.to_scalar == F64 {
            to.copy_from_slice(&self.from_scalar.to_f64(from).to_le_bytes());
        } else if self.to_scalar == F32 {
            to.copy_from_slice(&(self.from_scalar.to_f64(from) as f32).to_le_bytes());
        } else {
            // A wider integer: the bytes, extended by the sign.
            let negative =
                self.from_scalar.is_signed() && from.last().is_some_and(|b| b & 0x80 != 0);
            to.fill(if negative { 0xff } else { 0 });
            to[..from.len()].copy_from_slice(from);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, scalar: ScalarType, components: u8) -> InputAttribute {
        InputAttribute { name: name.into(), scalar, components }
    }

    #[test]
    fn union_widens_types_and_keeps_values() {
        let a = [attribute("color", ScalarType::U8, 3), attribute("t", ScalarType::I8, 1)];
        let b = [attribute("t", ScalarType::U16, 1), attribute("color", ScalarType::U16, 3)];
        let union = Schema::union([&a[..], &b[..]].into_iter(), &[]);
        assert_eq!(union.attributes[0].scalar, ScalarType::U16);
        assert_eq!(union.attributes[1].scalar, ScalarType::I32);
        let row = RowMap::new(&a, &union).apply(vec![255, 0, 1, 0xfe], 1, &union);
        assert_eq!(row, [0xff, 0xff, 0, 0, 1, 1, 0xfe, 0xff, 0xff, 0xff]);
        let row = RowMap::new(&b, &union).apply(vec![7, 0, 1, 0, 2, 0, 3, 0], 1, &union);
        assert_eq!(row, [1, 0, 2, 0, 3, 0, 7, 0, 0, 0]);
    }

    #[test]
    fn dropped_and_absent_attributes_leave_no_trace() {
        let a = [attribute("x1", ScalarType::U8, 1), attribute("x2", ScalarType::U8, 1)];
        let union = Schema::union([&a[..]].into_iter(), &["x1".into()]);
        assert_eq!(RowMap::new(&a, &union).apply(vec![1, 2, 3, 4], 2, &union), [2, 4]);
        assert_eq!(RowMap::new(&[], &union).apply(vec![], 2, &union), [0, 0]);
    }
}
