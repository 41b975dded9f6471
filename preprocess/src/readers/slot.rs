//! Slots: where a number goes in a point's row of attributes, and how.

use lodestream_protocol::ScalarType;

use super::InputAttribute;

/// Where a number goes in a row of attribute bytes ([`Block::attributes`](super::Block)).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slot {
    /// First byte in the row.
    pub offset: usize,
    /// Type it is stored as.
    pub scalar: ScalarType,
    /// How it becomes that type.
    pub rule: Rule,
}

/// How a number becomes the type of its slot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Rule {
    /// As it is; an integer that the type cannot hold is refused.
    Exact,
    /// A colour component, stored as U8 or U16: multiplied, rounded and clamped to the range.
    Color {
        /// Steps of the stored type per unit of the source.
        scale: f64,
    },
}

/// What became of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stored {
    /// It is in the row (a float at most rounded to the slot's precision, a scaled colour to its
    /// nearest step).
    Kept,
    /// Something else is in the row: a colour that was NaN, out of range or, where colours are
    /// integers, had a fraction.
    Altered,
    /// The type cannot hold it; the row is as it was.
    Unfit,
}

/// Integers up to here are exact in an f64.
const EXACT_INTEGERS: f64 = 9_007_199_254_740_992.0;

impl Slot {
    /// Stores `value` into `row`, which must reach to the slot's end.
    #[inline]
    pub fn store(&self, row: &mut [u8], value: f64) -> Stored {
        if let Rule::Color { scale } = self.rule {
            let limit = if self.scalar == ScalarType::U8 { 255 } else { u16::MAX };
            let scaled = value * scale;
            // The cast saturates: below zero and NaN are 0, above is the highest.
            let color = ((scaled + 0.5) as u16).min(limit);
            let in_range = scaled >= 0.0 && scaled <= f64::from(limit);
            let whole = scale != 1.0 || f64::from(color) == scaled;
            match self.scalar {
                // At most 255 here.
                ScalarType::U8 => self.put(row, [color.to_le_bytes()[0]]),
                _ => self.put(row, color.to_le_bytes()),
            }
            return if in_range && whole { Stored::Kept } else { Stored::Altered };
        }
        match self.scalar {
            ScalarType::F32 => self.put(row, (value as f32).to_le_bytes()),
            ScalarType::F64 => self.put(row, value.to_le_bytes()),
            _ => {
                // Saturates; what does not come back the same is no integer, or too large to be
                // sure of its last digit.
                let integer = value as i64;
                let exact = integer as f64 == value && value.abs() <= EXACT_INTEGERS;
                if !exact || !self.store_integer(row, i128::from(integer)) {
                    return Stored::Unfit;
                }
            }
        }
        Stored::Kept
    }

    /// Stores an integer of any size as it is; false, and nothing is stored, where the slot's
    /// type cannot hold it. Floating-point slots take the nearest value.
    pub fn store_integer(&self, row: &mut [u8], value: i128) -> bool {
        macro_rules! put_as {
            ($integer:ty) => {
                match <$integer>::try_from(value) {
                    Ok(fitting) => self.put(row, fitting.to_le_bytes()),
                    Err(_) => return false,
                }
            };
        }
        match self.scalar {
            ScalarType::U8 => put_as!(u8),
            ScalarType::I8 => put_as!(i8),
            ScalarType::U16 => put_as!(u16),
            ScalarType::I16 => put_as!(i16),
            ScalarType::U32 => put_as!(u32),
            ScalarType::I32 => put_as!(i32),
            ScalarType::U64 => put_as!(u64),
            ScalarType::I64 => put_as!(i64),
            ScalarType::F32 => self.put(row, (value as f32).to_le_bytes()),
            ScalarType::F64 => self.put(row, (value as f64).to_le_bytes()),
        }
        true
    }

    #[inline]
    fn put<const N: usize>(&self, row: &mut [u8], bytes: [u8; N]) {
        row[self.offset..self.offset + N].copy_from_slice(&bytes);
    }
}

/// Bytes of a row holding all `attributes`.
pub(super) fn row_bytes(attributes: &[InputAttribute]) -> usize {
    attributes.iter().map(|a| a.scalar.size_bytes() * usize::from(a.components)).sum()
}

/// Appends an attribute and returns one slot per component.
pub(super) fn add_attribute(
    attributes: &mut Vec<InputAttribute>,
    name: &str,
    scalar: ScalarType,
    components: u8,
    rule: Rule,
) -> Vec<Slot> {
    let start = row_bytes(attributes);
    attributes.push(InputAttribute { name: name.to_owned(), scalar, components });
    (0..usize::from(components))
        .map(|c| Slot { offset: start + c * scalar.size_bytes(), scalar, rule })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn store(scalar: ScalarType, rule: Rule, value: f64) -> (Stored, f64) {
        let mut row = [0u8; 10];
        let stored = Slot { offset: 2, scalar, rule }.store(&mut row, value);
        assert_eq!(row[..2], [0, 0], "bytes before the slot are left alone");
        (stored, scalar.to_f64(&row[2..]))
    }

    #[test]
    fn integers_that_the_type_cannot_hold_are_unfit() {
        assert_eq!(store(ScalarType::U8, Rule::Exact, 255.0), (Stored::Kept, 255.0));
        assert_eq!(store(ScalarType::I16, Rule::Exact, -32768.0), (Stored::Kept, -32768.0));
        for (scalar, value) in [
            (ScalarType::U8, 256.0),
            (ScalarType::U8, -1.0),
            (ScalarType::U8, 0.5),
            (ScalarType::I32, f64::NAN),
            (ScalarType::I64, f64::INFINITY),
            (ScalarType::U64, 1e300),
        ] {
            assert_eq!(store(scalar, Rule::Exact, value), (Stored::Unfit, 0.0), "{value}");
        }
    }

    #[test]
    fn scaled_colours_are_rounded_and_clamped() {
        let rule = Rule::Color { scale: 65535.0 };
        assert_eq!(store(ScalarType::U16, rule, 1.0), (Stored::Kept, 65535.0));
        assert_eq!(store(ScalarType::U16, rule, 0.5), (Stored::Kept, 32768.0));
        assert_eq!(store(ScalarType::U16, rule, 1.5), (Stored::Altered, 65535.0));
        assert_eq!(store(ScalarType::U16, rule, -0.1), (Stored::Altered, 0.0));
        assert_eq!(store(ScalarType::U16, rule, f64::NAN), (Stored::Altered, 0.0));
    }

    #[test]
    fn integer_colours_tell_of_lost_fractions_and_overflow() {
        let rule = Rule::Color { scale: 1.0 };
        assert_eq!(store(ScalarType::U8, rule, 117.0), (Stored::Kept, 117.0));
        assert_eq!(store(ScalarType::U8, rule, 117.4), (Stored::Altered, 117.0));
        assert_eq!(store(ScalarType::U16, rule, 70000.0), (Stored::Altered, 65535.0));
    }

    #[test]
    fn wide_integers_are_stored_to_the_last_bit() {
        let slot = Slot { offset: 0, scalar: ScalarType::I64, rule: Rule::Exact };
        let mut row = [0u8; 8];
        assert!(slot.store_integer(&mut row, i128::from(i64::MIN) + 1));
        assert_eq!(i64::from_le_bytes(row), i64::MIN + 1);
        assert!(!slot.store_integer(&mut row, i128::from(i64::MAX) + 1));
    }
}
