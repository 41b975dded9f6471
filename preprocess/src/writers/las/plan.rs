//! Which point format holds the attributes, and where each of them goes.
//!
//! Nothing is lost: an attribute that no field of the format can hold, by its type or by its values,
//! becomes extra bytes with a descriptor.

use lodestream_protocol::{Attribute, ScalarType};

use super::extra_bytes::Descriptor;
use crate::{
    error::{Error, Result},
    readers::las::point_format::{Field, Place, WAVE_FIELDS, fields, is_extended},
    writers::source::{is_per_point, limits, range},
};

/// A format with every extended field, to ask what such fields can hold.
const RICHEST: u8 = 10;

/// The legacy format with every field that legacy formats have.
const RICHEST_LEGACY: u8 = 5;

/// What 8-bit colours are multiplied with, so that 255 becomes 65535.
const COLOR_FACTOR: u16 = 257;

/// How points become records.
#[derive(Debug)]
pub(super) struct Plan {
    /// Point record format.
    pub(super) format: u8,
    /// Bytes of a record.
    pub(super) record_bytes: usize,
    /// Bytes of a record that are extra.
    pub(super) extra_bytes: usize,
    /// What goes where.
    pub(super) steps: Vec<Step>,
    /// What the extra bytes are.
    pub(super) descriptors: Vec<Descriptor>,
    /// Where the return number comes from, to count points by return.
    pub(super) return_number: Option<usize>,
    /// What a user should know of.
    pub(super) notes: Vec<String>,
}

/// An attribute on its way into records.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Step {
    /// Index of the attribute.
    pub(super) attribute: usize,
    /// First byte in the record.
    pub(super) at: usize,
    /// What happens to the value.
    pub(super) change: Change,
}

/// What happens to a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Change {
    /// `len` bytes as they are.
    Copy { len: usize },
    /// Integers of another type, each multiplied by `factor`.
    Integers { from: ScalarType, to: ScalarType, components: usize, factor: u16 },
    /// An integer as some bits of a byte.
    Bits { from: ScalarType, shift: u8, bits: u8 },
}

impl Plan {
    /// Chooses the smallest format that has a field for every attribute that can be in one.
    pub(super) fn new(attributes: &[Attribute]) -> Result<Self> {
        let format = choose_format(attributes);
        let (fields, format_bytes) = fields(format).expect("one of the known formats");
        let mut plan = Self {
            format,
            record_bytes: format_bytes,
            extra_bytes: 0,
            steps: Vec::new(),
            descriptors: Vec::new(),
            return_number: None,
            notes: Vec::new(),
        };
        for (index, attribute) in attributes.iter().enumerate() {
            if !is_per_point(attribute) {
                plan.notes.push(format!(
                    "attribute {} is left out: it belongs to textures, not to points",
                    attribute.name
                ));
                continue;
            }
            let field = fields.iter().find(|field| field.name == attribute.name);
            let change = field.and_then(|field| Some((field, change_for(attribute, field)?)));
            if let Some((field, change)) = change {
                plan.steps.push(Step { attribute: index, at: field.at, change });
                if attribute.name == "return_number" {
                    plan.return_number = Some(index);
                }
                if attribute.name == "color" && attribute.scalar == ScalarType::U8 {
                    plan.notes.push(
                        "colours of 8 bits are written as LAS asks, times 257 in 16 bits".into(),
                    );
                }
            } else {
                plan.add_extra(index, attribute);
            }
        }
        plan.extra_bytes = plan.record_bytes - format_bytes;
        if u16::try_from(plan.record_bytes).is_err() {
            return Err(Error::Setup(format!(
                "a point takes {} bytes, more than a LAS record holds (65535); export to PLY, or \
                 fewer attributes",
                plan.record_bytes
            )));
        }
        Ok(plan)
    }

    fn add_extra(&mut self, index: usize, attribute: &Attribute) {
        let value_bytes = attribute.value_bytes();
        let change = Change::Copy { len: value_bytes };
        self.steps.push(Step { attribute: index, at: self.record_bytes, change });
        self.record_bytes += value_bytes;
        Descriptor::add(&mut self.descriptors, attribute, &mut self.notes);
    }
}

fn choose_format(attributes: &[Attribute]) -> u8 {
    let fits = |format: u8, name: &str| {
        let (fields, _) = fields(format).expect("one of the known formats");
        let field = fields.iter().find(|field| field.name == name);
        let attribute = attributes.iter().find(|attribute| attribute.name == name);
        attribute.zip(field).is_some_and(|(attribute, field)| {
            is_per_point(attribute) && change_for(attribute, field).is_some()
        })
    };
    let extended = attributes
        .iter()
        .filter(|attribute| attribute.name != "nir")
        .any(|a| fits(RICHEST, &a.name) && !fits(RICHEST_LEGACY, &a.name))
        || fits(RICHEST, "nir");
    let color = fits(RICHEST, "color");
    let nir = fits(RICHEST, "nir");
    let time = fits(RICHEST, "gps_time");
    let wave = WAVE_FIELDS.iter().all(|(name, _)| fits(RICHEST, name));
    let format = match (extended, wave, color, nir, time) {
        (true, true, false, false, _) => 9,
        (true, true, ..) => 10,
        (true, false, _, true, _) => 8,
        (true, false, true, false, _) => 7,
        (true, false, false, false, _) => 6,
        (false, true, true, ..) => 5,
        (false, true, false, ..) => 4,
        (false, false, true, _, true) => 3,
        (false, false, true, _, false) => 2,
        (false, false, false, _, true) => 1,
        (false, false, false, _, false) => 0,
    };
    debug_assert_eq!(is_extended(format), extended);
    format
}

/// How `attribute` goes into `field` without loss; `None` where it cannot.
fn change_for(attribute: &Attribute, field: &Field) -> Option<Change> {
    if attribute.components != field.components {
        return None;
    }
    let from = attribute.scalar;
    match field.place {
        Place::Bytes if from == field.scalar => Some(Change::Copy { len: attribute.value_bytes() }),
        Place::Bytes => {
            let to = field.scalar;
            if !from.is_integer() || !to.is_integer() {
                return None;
            }
            let is_color = field.name == "color" && from == ScalarType::U8;
            let factor = if is_color { COLOR_FACTOR } else { 1 };
            let components = usize::from(field.components);
            lies_in(attribute, limits(to)).then_some(Change::Integers {
                from,
                to,
                components,
                factor,
            })
        }
        Place::Bits { shift, bits } => {
            let greatest = f64::from((1u16 << bits) - 1);
            (from.is_integer() && lies_in(attribute, (0.0, greatest))).then_some(Change::Bits {
                from,
                shift,
                bits,
            })
        }
    }
}

fn lies_in(attribute: &Attribute, (lowest, highest): (f64, f64)) -> bool {
    let (least, greatest) = range(attribute);
    lowest <= least && greatest <= highest
}

#[cfg(test)]
mod tests {
    use lodestream_protocol::{Domain, Storage};

    use super::*;

    fn attribute(name: &str, scalar: ScalarType, components: u8, max: f64) -> Attribute {
        Attribute {
            name: name.into(),
            scalar,
            components,
            domain: Domain::Element,
            storage: Storage::Column { group: 0 },
            min: vec![0.0; usize::from(components)],
            max: vec![max; usize::from(components)],
        }
    }

    fn format_of(attributes: &[&Attribute]) -> u8 {
        let attributes: Vec<Attribute> = attributes.iter().map(|&a| a.clone()).collect();
        Plan::new(&attributes).expect("the record is short").format
    }

    #[test]
    fn the_format_is_the_smallest_that_holds_all() {
        use ScalarType::{F32, F64, I8, I16, U8, U16};
        let intensity = attribute("intensity", U16, 1, 9.0);
        let time = attribute("gps_time", F64, 1, 9.0);
        let color = attribute("color", U16, 3, 65535.0);
        let class = attribute("classification", U8, 1, 31.0);
        let high_class = attribute("classification", U8, 1, 32.0);
        let nir = attribute("nir", U16, 1, 1.0);
        let angle = attribute("scan_angle", I16, 1, 1.0);
        let rank = attribute("scan_angle_rank", I8, 1, 1.0);
        let normal = attribute("normal", F32, 3, 1.0);
        assert_eq!(format_of(&[]), 0);
        assert_eq!(format_of(&[&intensity, &class, &rank, &normal]), 0);
        assert_eq!(format_of(&[&time]), 1);
        assert_eq!(format_of(&[&color]), 2);
        assert_eq!(format_of(&[&color, &time, &class]), 3);
        assert_eq!(format_of(&[&high_class]), 6);
        assert_eq!(format_of(&[&angle, &rank]), 6);
        assert_eq!(format_of(&[&high_class, &color]), 7);
        assert_eq!(format_of(&[&nir]), 8);
        assert_eq!(format_of(&[&nir, &color, &time]), 8);
        assert_eq!(format_of(&[&attribute("return_number", U8, 1, 7.0)]), 0);
        assert_eq!(format_of(&[&attribute("return_number", U8, 1, 8.0)]), 6);
        // Beyond any field: extra bytes, no reason for another format.
        assert_eq!(format_of(&[&attribute("return_number", U8, 1, 16.0)]), 0);
        assert_eq!(format_of(&[&attribute("intensity", F32, 1, 1.0)]), 0);
    }

    #[test]
    fn waveform_references_need_all_their_parts() {
        let mut all: Vec<Attribute> =
            WAVE_FIELDS.iter().map(|&(name, scalar)| attribute(name, scalar, 1, 1.0)).collect();
        assert_eq!(format_of(&all.iter().collect::<Vec<_>>()), 4);
        all.push(attribute("overlap", ScalarType::U8, 1, 1.0));
        assert_eq!(format_of(&all.iter().collect::<Vec<_>>()), 9);
        all.push(attribute("color", ScalarType::U8, 3, 1.0));
        assert_eq!(format_of(&all.iter().collect::<Vec<_>>()), 10);
        all.remove(0);
        let plan = Plan::new(&all).expect("the record is short");
        assert_eq!((plan.format, plan.descriptors.len()), (7, 6));
    }

    #[test]
    fn what_no_field_holds_becomes_extra_bytes_in_order() {
        let attributes = [
            attribute("intensity", ScalarType::U32, 1, 65536.0),
            attribute("normal", ScalarType::F32, 3, 1.0),
            attribute("user_data", ScalarType::U16, 1, 255.0),
        ];
        let plan = Plan::new(&attributes).expect("the record is short");
        assert_eq!((plan.format, plan.record_bytes, plan.extra_bytes), (0, 36, 16));
        assert_eq!(
            plan.steps,
            [
                Step { attribute: 0, at: 20, change: Change::Copy { len: 4 } },
                Step { attribute: 1, at: 24, change: Change::Copy { len: 12 } },
                Step {
                    attribute: 2,
                    at: 17,
                    change: Change::Integers {
                        from: ScalarType::U16,
                        to: ScalarType::U8,
                        components: 1,
                        factor: 1
                    }
                },
            ]
        );
    }
}
