//! The point record formats 0 to 10: which field lies where.
//!
//! One table for the reader and the writer (LAS 1.4 R15, tables 7 to 24). Positions are apart: the
//! first twelve bytes of every record are x, y, z as `i32`.

use lodestream_protocol::ScalarType;

/// Highest point record format that is known.
pub(crate) const LAST_FORMAT: u8 = 10;

/// Bytes of x, y and z at the start of a record.
pub(crate) const POSITION_BYTES: usize = 12;

/// The attributes of a waveform packet reference, in record order; a format has all or none.
pub(crate) const WAVE_FIELDS: [(&str, ScalarType); 7] = [
    ("wave_packet_descriptor_index", ScalarType::U8),
    ("wave_packet_offset", ScalarType::U64),
    ("wave_packet_size", ScalarType::U32),
    ("wave_return_location", ScalarType::F32),
    ("wave_x", ScalarType::F32),
    ("wave_y", ScalarType::F32),
    ("wave_z", ScalarType::F32),
];

/// Where in a record the value of a field is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Place {
    /// Whole bytes from the field's position on.
    Bytes,
    /// `bits` bits of the byte at the field's position, the lowest of them bit `shift`.
    Bits {
        /// Lowest bit.
        shift: u8,
        /// Number of bits.
        bits: u8,
    },
}

/// A field of a point record, delivered as one attribute.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Field {
    /// Attribute name.
    pub(crate) name: &'static str,
    /// Type of each component; [`ScalarType::U8`] for bit fields.
    pub(crate) scalar: ScalarType,
    /// Components.
    pub(crate) components: u8,
    /// Byte position in the record.
    pub(crate) at: usize,
    /// Whole bytes or bits.
    pub(crate) place: Place,
}

/// Whether `format` is one of the extended formats (6 to 10, of LAS 1.4).
pub(crate) const fn is_extended(format: u8) -> bool {
    format >= 6
}

/// The fields of `format` in record order, and the record's length in bytes without extra bytes;
/// `None` for an unknown format.
pub(crate) fn fields(format: u8) -> Option<(Vec<Field>, usize)> {
    if format > LAST_FORMAT {
        return None;
    }
    let mut table = Table { fields: Vec::new(), at: POSITION_BYTES };
    table.bytes("intensity", ScalarType::U16, 1);
    if is_extended(format) {
        table.bits(&[("return_number", 4), ("number_of_returns", 4)]);
        table.bits(&[
            ("synthetic", 1),
            ("key_point", 1),
            ("withheld", 1),
            ("overlap", 1),
            ("scanner_channel", 2),
            ("scan_direction_flag", 1),
            ("edge_of_flight_line", 1),
        ]);
        table.bytes("classification", ScalarType::U8, 1);
        table.bytes("user_data", ScalarType::U8, 1);
        table.bytes("scan_angle", ScalarType::I16, 1);
        table.bytes("point_source_id", ScalarType::U16, 1);
    } else {
        table.bits(&[
            ("return_number", 3),
            ("number_of_returns", 3),
            ("scan_direction_flag", 1),
            ("edge_of_flight_line", 1),
        ]);
        table.bits(&[("classification", 5), ("synthetic", 1), ("key_point", 1), ("withheld", 1)]);
        table.bytes("scan_angle_rank", ScalarType::I8, 1);
        table.bytes("user_data", ScalarType::U8, 1);
        table.bytes("point_source_id", ScalarType::U16, 1);
    }
    if !matches!(format, 0 | 2) {
        table.bytes("gps_time", ScalarType::F64, 1);
    }
    if matches!(format, 2 | 3 | 5 | 7 | 8 | 10) {
        table.bytes("color", ScalarType::U16, 3);
    }
    if matches!(format, 8 | 10) {
        table.bytes("nir", ScalarType::U16, 1);
    }
    if matches!(format, 4 | 5 | 9 | 10) {
        for (name, scalar) in WAVE_FIELDS {
            table.bytes(name, scalar, 1);
        }
    }
    Some((table.fields, table.at))
}

struct Table {
    fields: Vec<Field>,
    at: usize,
}

impl Table {
    fn bytes(&mut self, name: &'static str, scalar: ScalarType, components: u8) {
        self.fields.push(Field { name, scalar, components, at: self.at, place: Place::Bytes });
        self.at += scalar.size_bytes() * usize::from(components);
    }

    /// The fields of one byte, from its lowest bit on.
    fn bits(&mut self, names: &[(&'static str, u8)]) {
        let mut shift = 0;
        for &(name, bits) in names {
            let place = Place::Bits { shift, bits };
            self.fields.push(Field {
                name,
                scalar: ScalarType::U8,
                components: 1,
                at: self.at,
                place,
            });
            shift += bits;
        }
        self.at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn record_lengths_are_those_of_the_specification() {
        let lengths: Vec<usize> =
            (0..=LAST_FORMAT).map(|format| fields(format).expect("a known format").1).collect();
        assert_eq!(lengths, [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67]);
        assert!(fields(11).is_none());
    }

    #[test]
    fn fields_fill_every_bit_once() {
        for format in 0..=LAST_FORMAT {
            let (fields, length) = fields(format).expect("a known format");
            let mut used = vec![0u8; length];
            used[..POSITION_BYTES].fill(0xff);
            for field in fields {
                let size = field.scalar.size_bytes() * usize::from(field.components);
                for byte in &mut used[field.at..field.at + size] {
                    let mask = match field.place {
                        Place::Bytes => 0xff,
                        Place::Bits { shift, bits } => (((1u16 << bits) - 1) << shift) as u8,
                    };
                    assert_eq!(*byte & mask, 0, "format {format}, {}", field.name);
                    *byte |= mask;
                }
            }
            assert!(used.iter().all(|&byte| byte == 0xff), "format {format}: {used:x?}");
        }
    }
}
