//! Names: what the columns of a PLY or text file mean, and what they are called in a dataset.

use std::collections::HashSet;

/// What a column is, told by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Role {
    /// Coordinate: 0 = x, 1 = y, 2 = z.
    Axis(usize),
    /// Colour component: 0 = red, 1 = green, 2 = blue.
    Color(usize),
    /// Component of the normal.
    Normal(usize),
    /// An attribute of its own, under this name, which no other column bears.
    Scalar(String),
}

/// Triples that mean a coordinate, in order of preference.
const AXES: &[[&str; 3]] =
    &[["x", "y", "z"], ["easting", "northing", "elevation"], ["easting", "northing", "height"]];

/// Triples that mean a colour, in order of preference.
const COLORS: &[[&str; 3]] = &[
    ["red", "green", "blue"],
    ["r", "g", "b"],
    ["diffuse_red", "diffuse_green", "diffuse_blue"],
    ["rf", "gf", "bf"],
];

/// Triples that mean a normal, in order of preference.
const NORMALS: &[[&str; 3]] = &[["nx", "ny", "nz"], ["normal_x", "normal_y", "normal_z"]];

/// Names under which an attribute is known by another one.
const ALIASES: &[(&str, &str)] = &[
    ("i", "intensity"),
    ("scalar_intensity", "intensity"),
    ("class", "classification"),
    ("scalar_classification", "classification"),
    ("a", "alpha"),
];

/// Names that mean something other than one scalar per point to readers of a dataset.
const RESERVED: &[&str] = &[
    "position",
    "color",
    "normal",
    "axis_u",
    "axis_v",
    "texture_size",
    "texel_color",
    "texel_height",
];

/// Tells the role of each column from its name. Only complete triples are coordinates, colours or
/// normals: a lone `b` stays what it is called. The names of all scalars are unique.
pub(super) fn roles<S: AsRef<str>>(names: &[S]) -> Vec<Role> {
    let clean: Vec<String> = names.iter().map(|name| sanitized(name.as_ref())).collect();
    let mut roles: Vec<Option<Role>> = vec![None; clean.len()];
    let mut assign = |families: &[[&str; 3]], role: fn(usize) -> Role| {
        let columns = families.iter().find_map(|family| {
            let found = family.map(|part| clean.iter().position(|name| name == part));
            Some([found[0]?, found[1]?, found[2]?])
        });
        for (part, column) in columns.into_iter().flatten().enumerate() {
            roles[column] = Some(role(part));
        }
    };
    assign(AXES, Role::Axis);
    assign(COLORS, Role::Color);
    assign(NORMALS, Role::Normal);

    // The names of triples stay free for their columns, should these turn out to be scalars.
    let in_triples = roles.iter().zip(&clean).filter(|(role, _)| role.is_some());
    let mut taken: HashSet<String> = RESERVED.iter().map(|&name| name.to_owned()).collect();
    taken.extend(in_triples.map(|(_, name)| name.clone()));
    // A column that bears a name outright keeps it before one that is merely known by it.
    let borne: HashSet<&str> = clean.iter().map(String::as_str).collect();
    let mut named = Vec::with_capacity(clean.len());
    for (role, name) in roles.into_iter().zip(&clean) {
        named.push(role.unwrap_or_else(|| {
            let alias = ALIASES.iter().find(|(from, to)| from == name && !borne.contains(to));
            Role::Scalar(unique(alias.map_or(name, |&(_, to)| to), &mut taken))
        }));
    }
    named
}

/// A name in snake case: ASCII letters in lower case, digits and single underscores; a bracketed
/// unit is dropped (`X (m)` is `x`). Never empty.
pub(super) fn sanitized(name: &str) -> String {
    let name = name.trim().trim_matches(['"', '\'']);
    let name = match name.find(['(', '[']) {
        Some(bracket) if bracket > 0 => &name[..bracket],
        _ => name,
    };
    let mut clean = String::with_capacity(name.len());
    for c in name.chars() {
        if c.is_ascii_alphanumeric() {
            clean.push(c.to_ascii_lowercase());
        } else if !clean.is_empty() && !clean.ends_with('_') {
            clean.push('_');
        }
    }
    clean.truncate(clean.trim_end_matches('_').len());
    if clean.is_empty() { "unnamed".to_owned() } else { clean }
}

/// `name`, or the first of `name_2`, `name_3`, … that is not `taken`; takes it.
fn unique(name: &str, taken: &mut HashSet<String>) -> String {
    let mut candidate = name.to_owned();
    let mut number = 2_u64;
    while !taken.insert(candidate.clone()) {
        candidate = format!("{name}_{number}");
        number += 1;
    }
    candidate
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(name: &str) -> Role {
        Role::Scalar(name.to_owned())
    }

    #[test]
    fn recognises_coordinates_colours_and_normals_in_any_order() {
        assert_eq!(
            roles(&["nz", "Red", "BLUE", "x", "Z", "y", "green", "nx", "ny"]),
            [
                Role::Normal(2),
                Role::Color(0),
                Role::Color(2),
                Role::Axis(0),
                Role::Axis(2),
                Role::Axis(1),
                Role::Color(1),
                Role::Normal(0),
                Role::Normal(1),
            ]
        );
    }

    #[test]
    fn an_incomplete_triple_is_scalars() {
        assert_eq!(
            roles(&["x", "y", "z", "r", "b"]),
            [Role::Axis(0), Role::Axis(1), Role::Axis(2), scalar("r"), scalar("b")]
        );
    }

    #[test]
    fn scalars_get_unique_unreserved_names() {
        assert_eq!(
            roles(&["GPS Time [s]", "gps-time", "normal", "position", "??", "__a b__"]),
            [
                scalar("gps_time"),
                scalar("gps_time_2"),
                scalar("normal_2"),
                scalar("position_2"),
                scalar("unnamed"),
                scalar("a_b"),
            ]
        );
    }

    #[test]
    fn an_alias_yields_to_a_column_that_bears_the_name() {
        assert_eq!(roles(&["scalar_Intensity"]), [scalar("intensity")]);
        assert_eq!(
            roles(&["scalar_Intensity", "intensity"]),
            [scalar("scalar_intensity"), scalar("intensity")]
        );
    }

    #[test]
    fn the_name_of_a_triple_is_not_given_twice() {
        let names = ["red", "green", "blue", "red"];
        assert_eq!(roles(&names)[3], scalar("red_2"));
    }

    #[test]
    fn the_second_family_of_colours_is_scalars() {
        let both = ["diffuse_red", "diffuse_green", "diffuse_blue", "red", "green", "blue"];
        assert_eq!(
            roles(&both),
            [
                scalar("diffuse_red"),
                scalar("diffuse_green"),
                scalar("diffuse_blue"),
                Role::Color(0),
                Role::Color(1),
                Role::Color(2),
            ]
        );
    }
}
