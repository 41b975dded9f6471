//! The layout of a vertex: which property becomes what.

use lodestream_protocol::ScalarType;

use super::header::{Element, PropertyKind};
use crate::readers::{
    CoordinateKind, InputAttribute,
    names::{Role, roles, sanitized},
    slot::{Rule, Slot, add_attribute, row_bytes},
};

/// What becomes of a property.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Field {
    /// A coordinate: 0 = x, 1 = y, 2 = z.
    Axis(usize),
    /// An attribute, or a component of one.
    Value(Slot),
    /// Nothing: a scalar nobody asked for, or a list.
    Unused,
}

/// Which property of a vertex becomes what.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// Per property, in file order: its type and what becomes of it.
    pub fields: Vec<(PropertyKind, Field)>,
    /// Attributes of each point.
    pub attributes: Vec<InputAttribute>,
    /// How coordinates are to be understood.
    pub coordinates: CoordinateKind,
    /// What is not kept, one line each.
    pub left_out: Vec<String>,
}

impl Layout {
    /// The layout that keeps every scalar property. Colours in floating point are multiplied by
    /// `float_color_scale`.
    ///
    /// # Errors
    /// What keeps the element from being points.
    pub fn new(vertex: &Element, float_color_scale: f64) -> Result<Self, String> {
        let mut left_out = Vec::new();
        let mut scalars = Vec::new();
        for (index, property) in vertex.properties.iter().enumerate() {
            match property.kind {
                PropertyKind::Scalar(scalar) => {
                    scalars.push((index, property.name.as_str(), scalar));
                }
                PropertyKind::List { .. } => left_out.push(format!(
                    "property {}: a list per vertex, which a point cannot carry",
                    property.name
                )),
            }
        }
        let names: Vec<&str> = scalars.iter().map(|&(_, name, _)| name).collect();
        let mut roles = roles(&names);
        let types_of = |roles: &[Role], role: fn(usize) -> Role| -> Option<[ScalarType; 3]> {
            let find = |part| Some(scalars[roles.iter().position(|r| *r == role(part))?].2);
            Some([find(0)?, find(1)?, find(2)?])
        };

        let axes = types_of(&roles, Role::Axis).ok_or_else(|| {
            let listed = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
            format!("vertices have no properties x, y and z (they have: {listed})")
        })?;
        let coordinates = coordinate_kind(axes)?;

        let mut attributes = Vec::new();
        let mut color = Vec::new();
        if let Some(types) = types_of(&roles, Role::Color) {
            if let Some((scalar, rule)) = color_storage(types, float_color_scale) {
                color = add_attribute(&mut attributes, "color", scalar, 3, rule);
            } else {
                left_out.push(
                    "colour: red, green and blue are partly integers, partly floating point; kept \
                     as attributes of their own"
                        .to_owned(),
                );
                demote(&mut roles, &names, |role| matches!(role, Role::Color(_)));
            }
        }
        let mut normal = Vec::new();
        if let Some(types) = types_of(&roles, Role::Normal) {
            if types.iter().all(|&t| is_float(t)) {
                let double = types.contains(&ScalarType::F64);
                let scalar = if double { ScalarType::F64 } else { ScalarType::F32 };
                normal = add_attribute(&mut attributes, "normal", scalar, 3, Rule::Exact);
            } else {
                left_out.push(
                    "normal: nx, ny and nz are integers of unknown scale; kept as attributes of \
                     their own"
                        .to_owned(),
                );
                demote(&mut roles, &names, |role| matches!(role, Role::Normal(_)));
            }
        }

        let mut fields: Vec<(PropertyKind, Field)> =
            vertex.properties.iter().map(|property| (property.kind, Field::Unused)).collect();
        for (role, &(index, _, scalar)) in roles.iter().zip(&scalars) {
            fields[index].1 = match role {
                Role::Axis(axis) => Field::Axis(*axis),
                Role::Color(part) => Field::Value(color[*part]),
                Role::Normal(part) => Field::Value(normal[*part]),
                Role::Scalar(name) => {
                    Field::Value(add_attribute(&mut attributes, name, scalar, 1, Rule::Exact)[0])
                }
            };
        }
        Ok(Self { fields, attributes, coordinates, left_out })
    }

    /// A layout of the same vertices that delivers the colour alone, unscaled, as three doubles;
    /// `None` where the colour is not in floating point.
    pub fn float_color_only(&self) -> Option<Self> {
        let mut attributes = Vec::new();
        let slots = add_attribute(&mut attributes, "color", ScalarType::F64, 3, Rule::Exact);
        let mut found = 0;
        let mut fields = self.fields.clone();
        for (kind, field) in &mut fields {
            if let Field::Value(slot) = *field {
                let PropertyKind::Scalar(scalar) = *kind else { continue };
                let is_color = matches!(slot.rule, Rule::Color { .. }) && is_float(scalar);
                *field = if is_color { Field::Value(slots[found]) } else { Field::Unused };
                found += usize::from(is_color);
            }
        }
        (found == 3).then(|| Self { fields, attributes, left_out: Vec::new(), ..*self })
    }

    /// Bytes of attributes per point.
    pub fn row_bytes(&self) -> usize {
        row_bytes(&self.attributes)
    }
}

/// Coordinates in integers are exact with no decimals; those in text tell theirs when read.
fn coordinate_kind(axes: [ScalarType; 3]) -> Result<CoordinateKind, String> {
    if axes.iter().any(|t| matches!(t, ScalarType::I64 | ScalarType::U64)) {
        return Err("coordinates are 64-bit integers, which a double cannot hold exactly; write \
                    them as double or int"
            .to_owned());
    }
    let integers = !axes.iter().any(|&t| is_float(t));
    Ok(CoordinateKind::Float {
        decimals: integers.then_some(0),
        single_precision: !integers && !axes.contains(&ScalarType::F64),
    })
}

/// How a colour of these component types is stored; `None` where they do not fit together.
fn color_storage(types: [ScalarType; 3], float_scale: f64) -> Option<(ScalarType, Rule)> {
    if types == [ScalarType::U8; 3] {
        Some((ScalarType::U8, Rule::Exact))
    } else if types == [ScalarType::U16; 3] {
        Some((ScalarType::U16, Rule::Exact))
    } else if types.iter().all(|&t| is_float(t)) {
        Some((ScalarType::U16, Rule::Color { scale: float_scale }))
    } else if types.iter().any(|&t| is_float(t)) {
        None
    } else {
        Some((ScalarType::U16, Rule::Color { scale: 1.0 }))
    }
}

/// Makes scalars of the components of a triple, under their own names ([`roles`] kept them free).
fn demote(roles: &mut [Role], names: &[&str], is_part: fn(&Role) -> bool) {
    for (role, name) in roles.iter_mut().zip(names).filter(|(role, _)| is_part(role)) {
        *role = Role::Scalar(sanitized(name));
    }
}

const fn is_float(scalar: ScalarType) -> bool {
    matches!(scalar, ScalarType::F32 | ScalarType::F64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readers::ply::header::Header;

    fn layout(properties: &[&str]) -> Result<Layout, String> {
        let properties: String = properties.iter().map(|p| format!("property {p}\n")).collect();
        let header = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
        let header = Header::parse(header.as_bytes()).expect("a header");
        Layout::new(&header.elements[0], 65535.0)
    }

    fn described(layout: &Layout) -> Vec<String> {
        let describe = |a: &InputAttribute| format!("{} {:?}x{}", a.name, a.scalar, a.components);
        layout.attributes.iter().map(describe).collect()
    }

    const XYZ: [&str; 3] = ["float x", "float y", "float z"];

    #[test]
    fn colours_keep_their_depth_and_floats_become_16_bit() {
        for (kind, expected) in [
            ("uchar", "color U8x3"),
            ("ushort", "color U16x3"),
            ("float", "color U16x3"),
            ("int", "color U16x3"),
        ] {
            let color = ["red", "green", "blue"].map(|part| format!("{kind} {part}"));
            let properties: Vec<&str> =
                XYZ.into_iter().chain(color.iter().map(String::as_str)).collect();
            assert_eq!(described(&layout(&properties).expect("points")), [expected]);
        }
    }

    #[test]
    fn everything_else_is_kept_under_its_own_name() {
        let properties = [
            "uchar alpha",
            "double nx",
            "float ny",
            "float nz",
            "float scalar_intensity",
            "list uchar int around",
            "double z",
            "double y",
            "double x",
            "char Quality (%)",
        ];
        // A name holds no blanks in PLY: the last line is refused rather than misread.
        assert!(layout_error(&properties).contains("is not understood"));
        let kept = layout(&properties[..9]).expect("points");
        assert_eq!(described(&kept), ["normal F64x3", "alpha U8x1", "intensity F32x1"]);
        assert_eq!(kept.left_out.len(), 1);
        assert_eq!(kept.row_bytes(), 29);
    }

    fn layout_error(properties: &[&str]) -> String {
        let properties: String = properties.iter().map(|p| format!("property {p}\n")).collect();
        let header = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
        Header::parse(header.as_bytes()).expect_err("refused")
    }

    #[test]
    fn triples_of_unfit_types_are_kept_apart() {
        let properties = [
            "float x", "float y", "float z", "uchar r", "uchar g", "float b", "int nx", "int ny",
            "int nz",
        ];
        let kept = layout(&properties).expect("points");
        assert_eq!(
            described(&kept),
            ["r U8x1", "g U8x1", "b F32x1", "nx I32x1", "ny I32x1", "nz I32x1"]
        );
        assert_eq!(kept.left_out.len(), 2);
    }

    #[test]
    fn coordinates_tell_their_precision() {
        let kind = |properties: &[&str]| layout(properties).expect("points").coordinates;
        let float =
            |decimals, single_precision| CoordinateKind::Float { decimals, single_precision };
        assert_eq!(kind(&XYZ), float(None, true));
        assert_eq!(kind(&["double x", "float y", "float z"]), float(None, false));
        assert_eq!(kind(&["int x", "short y", "uchar z"]), float(Some(0), false));
        assert_eq!(kind(&["int x", "short y", "float z"]), float(None, true));
        assert!(layout(&["int64 x", "int y", "int z"]).expect_err("refused").contains("64-bit"));
    }

    #[test]
    fn vertices_without_coordinates_are_refused_by_what_they_have() {
        let message = layout(&["float x", "float y", "float w"]).expect_err("refused");
        assert!(message.contains("no properties x, y and z (they have: x, y, w)"), "{message}");
    }
}
