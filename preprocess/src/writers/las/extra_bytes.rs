//! Descriptors of extra bytes (LAS 1.4 R15, tables 24 and 25).

use lodestream_protocol::{Attribute, ScalarType};

use crate::readers::las::extra_bytes::{DESCRIPTOR_BYTES, NAME_BYTES, number_of};

/// What some extra bytes are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Descriptor {
    name: String,
    /// Number of the type.
    kind: u8,
    /// Bytes, for the type 0.
    options: u8,
}

impl Descriptor {
    /// Describes an attribute: as one value of up to three components, as plain bytes, or else
    /// component by component.
    pub(super) fn add(all: &mut Vec<Self>, attribute: &Attribute, notes: &mut Vec<String>) {
        let Attribute { name, scalar, components, .. } = attribute;
        let number = number_of(*scalar);
        match (components, scalar) {
            (1..=3, _) => {
                all.push(Self::named(all, name, number + 10 * (components - 1), 0, notes));
            }
            (_, ScalarType::U8) => all.push(Self::named(all, name, 0, *components, notes)),
            _ => {
                notes.push(format!(
                    "attribute {name}: its {components} components are written as {name}[0], …"
                ));
                for component in 0..*components {
                    let part = format!("{name}[{component}]");
                    all.push(Self::named(all, &part, number, 0, notes));
                }
            }
        }
    }

    fn named(all: &[Self], name: &str, kind: u8, options: u8, notes: &mut Vec<String>) -> Self {
        let mut short = truncated(name, NAME_BYTES).to_owned();
        let mut number = 2u32;
        while all.iter().any(|other| other.name == short) {
            let suffix = format!("_{number}");
            short = format!("{}{suffix}", truncated(name, NAME_BYTES - suffix.len()));
            number += 1;
        }
        if short != name {
            notes.push(format!(
                "attribute {name} is written as {short}: names have at most {NAME_BYTES} bytes"
            ));
        }
        Self { name: short, kind, options }
    }

    /// The descriptor as it lies in the file.
    pub(super) fn bytes(&self) -> [u8; DESCRIPTOR_BYTES] {
        let mut bytes = [0; DESCRIPTOR_BYTES];
        bytes[2] = self.kind;
        bytes[3] = self.options;
        bytes[4..4 + self.name.len()].copy_from_slice(self.name.as_bytes());
        bytes
    }
}

/// The longest start of `text` of at most `bytes` bytes.
fn truncated(text: &str, bytes: usize) -> &str {
    let end = (0..=bytes.min(text.len())).rev().find(|&end| text.is_char_boundary(end));
    &text[..end.unwrap_or(0)]
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{Domain, Storage};

    use super::*;

    fn described(attributes: &[(&str, ScalarType, u8)]) -> (Vec<(String, u8, u8)>, Vec<String>) {
        let (mut all, mut notes) = (Vec::new(), Vec::new());
        for &(name, scalar, components) in attributes {
            let attribute = Attribute {
                name: name.into(),
                scalar,
                components,
                domain: Domain::Element,
                storage: Storage::Column { group: 0 },
                min: Vec::new(),
                max: Vec::new(),
            };
            Descriptor::add(&mut all, &attribute, &mut notes);
        }
        (all.into_iter().map(|d| (d.name, d.kind, d.options)).collect(), notes)
    }

    #[test]
    fn types_are_those_of_the_specification() {
        let (all, notes) = described(&[
            ("a", ScalarType::U8, 1),
            ("b", ScalarType::F64, 2),
            ("c", ScalarType::F32, 3),
            ("d", ScalarType::U8, 7),
            ("e", ScalarType::I16, 4),
        ]);
        let expected = [
            ("a", 1, 0),
            ("b", 20, 0),
            ("c", 29, 0),
            ("d", 0, 7),
            ("e[0]", 4, 0),
            ("e[1]", 4, 0),
            ("e[2]", 4, 0),
            ("e[3]", 4, 0),
        ];
        assert_eq!(all, expected.map(|(name, kind, options)| (name.to_owned(), kind, options)));
        assert_eq!(notes.len(), 1);
    }

    #[test]
    fn long_names_are_cut_at_a_character_and_stay_unique() {
        let (all, notes) = described(&[
            ("0123456789012345678901234567890é", ScalarType::U8, 1),
            ("0123456789012345678901234567890è", ScalarType::U8, 1),
        ]);
        assert_eq!(all[0].0, "0123456789012345678901234567890");
        assert_eq!(all[1].0, "012345678901234567890123456789_2");
        assert_eq!(notes.len(), 2);
    }
}
