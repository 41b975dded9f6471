//! Extra bytes: what a file carries in its records beyond the point format, and how it says so.
//!
//! Descriptors are those of LAS 1.4 R15, tables 24 and 25. Raw values are kept, not scaled ones: a
//! scale turns integers into floats that compress badly and round. That there was one is reported.

use lodestream_protocol::ScalarType;

use crate::readers::InputAttribute;

/// Bytes of one descriptor.
pub(crate) const DESCRIPTOR_BYTES: usize = 192;

/// Bytes of a descriptor's name.
pub(crate) const NAME_BYTES: usize = 32;

/// Most undescribed bytes of a record that are kept, as one attribute.
const MOST_UNDESCRIBED: usize = 64;

/// An attribute in the extra bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ExtraAttribute {
    /// As delivered.
    pub(super) attribute: InputAttribute,
    /// Byte position in the extra bytes.
    pub(super) at: usize,
}

/// What the extra bytes hold.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct ExtraBytes {
    /// What is kept, in record order.
    pub(super) attributes: Vec<ExtraAttribute>,
    /// What is not kept, one line each.
    pub(super) left_out: Vec<String>,
    /// What a user should know of.
    pub(super) warnings: Vec<String>,
}

impl ExtraBytes {
    /// Makes sense of `available` extra bytes a record by their descriptors; `taken` are the names
    /// of the attributes that the point format has.
    pub(super) fn parse(descriptors: &[u8], available: usize, taken: &[&str]) -> Self {
        let mut extra = Self::default();
        let mut at = 0;
        let mut descriptors = descriptors.chunks_exact(DESCRIPTOR_BYTES);
        for descriptor in descriptors.by_ref() {
            let Some(end) = extra.add(descriptor, at, available, taken) else { break };
            at = end;
        }
        for descriptor in descriptors {
            let name = text(&descriptor[4..4 + NAME_BYTES]);
            extra.left_out.push(format!("extra bytes {name:?}: where they lie is not known"));
        }
        let rest = available.saturating_sub(at);
        if rest > MOST_UNDESCRIBED {
            extra.left_out.push(format!("{rest} bytes of each record: nothing describes them"));
        } else if rest > 0 {
            extra.keep("extra_bytes", ScalarType::U8, rest, at, taken);
        }
        extra
    }

    /// Adds what `descriptor` says of the bytes from `at` on; returns the position behind them, or
    /// `None` where that cannot be told.
    fn add(
        &mut self,
        descriptor: &[u8],
        at: usize,
        available: usize,
        taken: &[&str],
    ) -> Option<usize> {
        let (kind, options) = (descriptor[2], descriptor[3]);
        let name = text(&descriptor[4..4 + NAME_BYTES]);
        let (scalar, components) = match kind {
            // Undocumented: as many bytes as `options` says.
            0 => (ScalarType::U8, usize::from(options)),
            1..=30 => (scalar_of(kind), usize::from(kind - 1) / 10 + 1),
            _ => {
                self.left_out.push(format!("extra bytes {name:?}: type {kind} is not known"));
                return None;
            }
        };
        let end = at + scalar.size_bytes() * components;
        if end > available {
            self.left_out
                .push(format!("extra bytes {name:?}: described, but the record ends before them"));
            return None;
        }
        if components > MOST_UNDESCRIBED {
            self.left_out.push(format!(
                "extra bytes {name:?}: {components} undocumented bytes (at most \
                 {MOST_UNDESCRIBED} are kept)"
            ));
        } else if components > 0 {
            self.keep(&name, scalar, components, at, taken);
            self.note_meaning(descriptor, &name);
        }
        Some(end)
    }

    fn keep(
        &mut self,
        name: &str,
        scalar: ScalarType,
        components: usize,
        at: usize,
        taken: &[&str],
    ) {
        let unique = {
            let is_taken = |candidate: &str| {
                is_reserved(candidate, components)
                    || taken.contains(&candidate)
                    || self.attributes.iter().any(|other| other.attribute.name == candidate)
            };
            let stem = if name.is_empty() { "extra_bytes" } else { name };
            std::iter::once(stem.to_owned())
                .chain((2..).map(|n: u32| format!("{stem}_{n}")))
                .find(|candidate| !is_taken(candidate))
                .expect("there are more numbers than attributes")
        };
        if unique != name {
            self.warnings.push(format!("extra bytes {name:?} are kept under the name {unique:?}"));
        }
        let components = u8::try_from(components).expect("at most 64, checked by the callers");
        self.attributes.push(ExtraAttribute {
            attribute: InputAttribute { name: unique, scalar, components },
            at,
        });
    }

    /// Reports the parts of a descriptor that give values a meaning and are not kept.
    fn note_meaning(&mut self, descriptor: &[u8], name: &str) {
        const HAS_NO_DATA: u8 = 1;
        const HAS_SCALE: u8 = 8;
        const HAS_OFFSET: u8 = 16;
        let (kind, options) = (descriptor[2], descriptor[3]);
        if kind == 0 {
            return;
        }
        let f64_at = |at: usize| {
            let bytes = descriptor[at..].first_chunk().expect("a descriptor has 192 bytes");
            f64::from_le_bytes(*bytes)
        };
        let scale = if options & HAS_SCALE == 0 { 1.0 } else { f64_at(112) };
        let offset = if options & HAS_OFFSET == 0 { 0.0 } else { f64_at(136) };
        #[expect(clippy::float_cmp, reason = "exactly these values mean that nothing is scaled")]
        if scale != 1.0 || offset != 0.0 {
            self.left_out.push(format!(
                "extra bytes {name:?}: their scale {scale} and offset {offset} (raw values are \
                 kept)"
            ));
        }
        if options & HAS_NO_DATA != 0 {
            let raw: [u8; 8] = *descriptor[40..].first_chunk().expect("192 bytes");
            // Eight bytes whatever the type: integers are widened, floats are f64.
            let value = match scalar_of(kind) {
                ScalarType::F32 | ScalarType::F64 => f64::from_le_bytes(raw).to_string(),
                scalar if scalar.is_signed() => i64::from_le_bytes(raw).to_string(),
                _ => u64::from_le_bytes(raw).to_string(),
            };
            self.left_out.push(format!(
                "extra bytes {name:?}: the mark that {value} means no data (the values are kept)"
            ));
        }
    }
}

/// The number by which a descriptor names the type of one component; plus 10 and 20 for two and three.
pub(crate) fn number_of(scalar: ScalarType) -> u8 {
    // Our order is that of the specification, which counts from 1.
    let (_, number) = ScalarType::ALL
        .into_iter()
        .zip(1..)
        .find(|(other, _)| *other == scalar)
        .expect("the list has every type");
    number
}

/// The type that a number from 1 to 30 names.
fn scalar_of(number: u8) -> ScalarType {
    ScalarType::ALL[usize::from(number.saturating_sub(1)) % ScalarType::ALL.len()]
}

/// Whether a name means something to readers of a dataset that such extra bytes are not.
fn is_reserved(name: &str, components: usize) -> bool {
    match name {
        "color" | "normal" => components != 3,
        "position" | "axis_u" | "axis_v" | "texture_size" | "texel_color" | "texel_height" => true,
        _ => false,
    }
}

/// The text before the first zero.
fn text(bytes: &[u8]) -> String {
    let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(text).trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn descriptor(kind: u8, options: u8, name: &str) -> Vec<u8> {
        let mut bytes = vec![0; DESCRIPTOR_BYTES];
        bytes[2] = kind;
        bytes[3] = options;
        bytes[4..4 + name.len()].copy_from_slice(name.as_bytes());
        bytes
    }

    fn names(extra: &ExtraBytes) -> Vec<(&str, ScalarType, u8, usize)> {
        extra
            .attributes
            .iter()
            .map(|e| (e.attribute.name.as_str(), e.attribute.scalar, e.attribute.components, e.at))
            .collect()
    }

    #[test]
    fn keeps_types_components_and_the_undescribed_rest() {
        let bytes =
            [descriptor(3, 0, "a"), descriptor(29, 0, "normal"), descriptor(0, 5, "raw")].concat();
        let extra = ExtraBytes::parse(&bytes, 2 + 12 + 5 + 3, &[]);
        assert_eq!(
            names(&extra),
            [
                ("a", ScalarType::U16, 1, 0),
                ("normal", ScalarType::F32, 3, 2),
                ("raw", ScalarType::U8, 5, 14),
                ("extra_bytes", ScalarType::U8, 3, 19),
            ]
        );
        assert_eq!(extra.left_out, Vec::<String>::new());
    }

    #[test]
    fn renames_what_collides_and_says_so() {
        let bytes =
            [descriptor(1, 0, "intensity"), descriptor(1, 0, ""), descriptor(1, 0, "position")]
                .concat();
        let extra = ExtraBytes::parse(&bytes, 3, &["intensity"]);
        assert_eq!(
            names(&extra).iter().map(|n| n.0).collect::<Vec<_>>(),
            ["intensity_2", "extra_bytes", "position_2"]
        );
        assert_eq!(extra.warnings.len(), 3);
    }

    #[test]
    fn drops_by_name_what_cannot_be_kept() {
        let bytes = [descriptor(0, 200, "blob"), descriptor(77, 0, "odd")].concat();
        let extra = ExtraBytes::parse(&bytes, 200 + 65, &[]);
        assert!(extra.attributes.is_empty());
        assert_eq!(extra.left_out.len(), 3, "{:?}", extra.left_out);
        assert!(extra.left_out[0].contains("\"blob\""));
        assert!(extra.left_out[1].contains("\"odd\""));
        assert!(extra.left_out[2].contains("65 bytes"));
    }

    #[test]
    fn drops_what_is_described_beyond_the_record_and_all_behind_it() {
        let bytes = [descriptor(10, 0, "late"), descriptor(1, 0, "later")].concat();
        let extra = ExtraBytes::parse(&bytes, 4, &[]);
        assert_eq!(names(&extra), [("extra_bytes", ScalarType::U8, 4, 0)]);
        assert!(extra.left_out[0].contains("\"late\""));
        assert!(extra.left_out[1].contains("\"later\""));
    }

    #[test]
    fn reports_scale_and_no_data() {
        let mut bytes = descriptor(4, 1 | 8 | 16, "height");
        bytes[40..48].copy_from_slice(&(-9999i64).to_le_bytes());
        bytes[112..120].copy_from_slice(&0.01f64.to_le_bytes());
        bytes[136..144].copy_from_slice(&5.0f64.to_le_bytes());
        let extra = ExtraBytes::parse(&bytes, 2, &[]);
        assert_eq!(names(&extra), [("height", ScalarType::I16, 1, 0)]);
        assert!(extra.left_out[0].contains("scale 0.01 and offset 5"), "{:?}", extra.left_out);
        assert!(extra.left_out[1].contains("-9999"), "{:?}", extra.left_out);
    }
}
