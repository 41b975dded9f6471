//! Columns: what each means, told by an option, by a header line or by its numbers.

use std::fmt::Write;

use lodestream_protocol::ScalarType;

use super::{sample::Sample, split::Delimiter};
use crate::readers::{
    InputAttribute,
    color::ColorRange,
    names::{Role, roles},
    slot::{Rule, Slot, add_attribute},
};

/// What becomes of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Column {
    /// Nothing.
    Skip,
    /// A coordinate: 0 = x, 1 = y, 2 = z.
    Axis(usize),
    /// An attribute, or a component of one.
    Value(Slot),
}

/// How lines become points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    /// What separates fields.
    pub delimiter: Delimiter,
    /// What becomes of each column.
    pub columns: Vec<Column>,
    /// Whether lines may have more columns than these.
    pub more_columns: bool,
    /// Whether a line with one whole number announces points (PTS).
    pub count_lines: bool,
    /// Attributes of each point.
    pub attributes: Vec<InputAttribute>,
}

/// The meaning of each column; `None` for one that is skipped.
pub(super) type Meanings = Vec<Option<Role>>;

/// Meanings named by the user: a list like `x,y,z,intensity,r,g,b,nx,ny,nz,-`.
///
/// # Errors
/// What is wrong with the list.
pub(super) fn named(list: &str) -> Result<Meanings, String> {
    let names: Vec<&str> = list.split(',').map(str::trim).collect();
    for (i, name) in names.iter().enumerate() {
        if name.is_empty() {
            return Err(format!("columns {list:?}: the name of column {} is empty", i + 1));
        }
        if *name != "-" && names[..i].contains(name) {
            return Err(format!("columns {list:?}: {name} is named twice"));
        }
    }
    with_roles(&names, |name| *name == "-")
        .ok_or_else(|| format!("columns {list:?}: x, y and z must be among them"))
}

/// Meanings from a header line's names; `None` where x, y and z are not among them. Columns that
/// hold no numbers are skipped.
pub(super) fn from_header(names: &[String], sample: &Sample) -> Option<Meanings> {
    let numeric = sample.numeric_columns();
    let columns: Vec<(usize, &String)> = names.iter().enumerate().collect();
    let is_skipped = |(column, _): &(usize, &String)| !numeric.contains(column);
    let names: Vec<&str> = columns
        .iter()
        .map(|column| if is_skipped(column) { "-" } else { column.1.as_str() })
        .collect();
    with_roles(&names, |name| *name == "-")
}

fn with_roles(names: &[&str], is_skipped: impl Fn(&&str) -> bool) -> Option<Meanings> {
    let kept: Vec<&str> = names.iter().copied().filter(|name| !is_skipped(name)).collect();
    let kept_roles = roles(&kept);
    if !(0..3).all(|axis| kept_roles.contains(&Role::Axis(axis))) {
        return None;
    }
    let mut kept_roles = kept_roles.into_iter();
    Some(names.iter().map(|name| if is_skipped(name) { None } else { kept_roles.next() }).collect())
}

/// Meanings guessed from the numbers: x, y, z first; then, in any order, a colour, a normal, an
/// intensity. Where intensity and colour could be either way round, the colour is taken to come
/// first, except in a PTS file. Columns that fit nothing are kept as `column_7` and the like.
/// `None` where there are not three columns of numbers.
pub(super) fn guessed(sample: &Sample, columns: usize, is_pts: bool) -> Option<Meanings> {
    let numeric = sample.numeric_columns();
    let (axes, mut rest) = (numeric.get(..3)?, numeric[3..].to_vec());
    let mut meanings: Meanings = vec![None; columns];
    for (axis, &column) in axes.iter().enumerate() {
        meanings[column] = Some(Role::Axis(axis));
    }
    let triples = |rest: &[usize]| -> Vec<[usize; 3]> {
        let neighbours = rest.windows(3).filter(|w| w[0] + 2 == w[2]);
        neighbours.map(|w| [w[0], w[1], w[2]]).collect()
    };

    let normal = triples(&rest).into_iter().find(|&triple| sample.is_unit_vector(triple));
    for (part, column) in normal.into_iter().flatten().enumerate() {
        meanings[column] = Some(Role::Normal(part));
        rest.retain(|&other| other != column);
    }

    let mut colors: Vec<(ColorRange, [usize; 3])> = triples(&rest)
        .into_iter()
        .filter_map(|triple| Some((sample.color_candidate(triple)?, triple)))
        .collect();
    if is_pts && colors.len() > 1 {
        // x y z intensity red green blue
        colors.rotate_left(1);
    }
    // A 12-bit or fractional intensity beside 8-bit colours would else pass for one of them.
    colors.sort_by_key(|&(range, _)| range);
    let color = colors.first().copied();
    if let Some((_, triple)) = color {
        for (part, column) in triple.into_iter().enumerate() {
            meanings[column] = Some(Role::Color(part));
            rest.retain(|&other| other != column);
        }
    }

    let lone = if rest.len() == 1 { rest.first().copied() } else { None };
    for column in rest {
        let after_color = color.filter(|(_, triple)| triple[2] + 1 == column);
        let name = match after_color {
            Some((range, _)) if lone.is_some() => {
                let opaque = if range == ColorRange::Unit { 1.0 } else { 255.0 };
                if sample.is_constant(column, opaque) { "alpha" } else { "intensity" }.to_owned()
            }
            None if lone.is_some() && axes[2] + 1 == column => "intensity".to_owned(),
            _ => format!("column_{}", column + 1),
        };
        meanings[column] = Some(Role::Scalar(name));
    }
    Some(meanings)
}

/// Meanings as the list that [`named`] reads.
pub(super) fn listed(meanings: &[Option<Role>]) -> String {
    let mut list = String::new();
    for meaning in meanings {
        let separator = if list.is_empty() { "" } else { "," };
        let name = match meaning {
            None => "-",
            Some(Role::Axis(axis)) => ["x", "y", "z"][*axis],
            Some(Role::Color(part)) => ["r", "g", "b"][*part],
            Some(Role::Normal(part)) => ["nx", "ny", "nz"][*part],
            Some(Role::Scalar(name)) => name,
        };
        // Writing to a string cannot fail.
        let _ = write!(list, "{separator}{name}");
    }
    list
}

impl Plan {
    /// The plan for columns of these meanings; `notes` takes a line for what a user should know.
    ///
    /// Types do not depend on the numbers found, so that the files of a dataset agree: colours are
    /// 16-bit (8-bit values stay as they are), normals single precision, anything else is a double,
    /// which holds every number of a text as it is read (the codec finds the integers among them).
    pub fn new(
        delimiter: Delimiter,
        meanings: &[Option<Role>],
        sample: &Sample,
        notes: &mut Vec<String>,
    ) -> Self {
        let mut attributes = Vec::new();
        let find = |role: fn(usize) -> Role| {
            let at = |part| meanings.iter().position(|m| m.as_ref() == Some(&role(part)));
            Some([at(0)?, at(1)?, at(2)?])
        };
        let mut color = Vec::new();
        if let Some(columns) = find(Role::Color) {
            let range = sample.color_range(columns);
            if range.scale() != 1.0 {
                notes.push(range.note());
            }
            let rule = Rule::Color { scale: range.scale() };
            color = add_attribute(&mut attributes, "color", ScalarType::U16, 3, rule);
        }
        let mut normal = Vec::new();
        if find(Role::Normal).is_some() {
            normal = add_attribute(&mut attributes, "normal", ScalarType::F32, 3, Rule::Exact);
        }
        let mut columns = Vec::with_capacity(meanings.len());
        for meaning in meanings {
            columns.push(match meaning {
                None => Column::Skip,
                Some(Role::Axis(axis)) => Column::Axis(*axis),
                Some(Role::Color(part)) => Column::Value(color[*part]),
                Some(Role::Normal(part)) => Column::Value(normal[*part]),
                Some(Role::Scalar(name)) => Column::Value(
                    add_attribute(&mut attributes, name, ScalarType::F64, 1, Rule::Exact)[0],
                ),
            });
        }
        Self { delimiter, columns, more_columns: false, count_lines: false, attributes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(lines: &[&str]) -> (Sample, usize) {
        let columns = Delimiter::Blanks.fields(lines[0].as_bytes()).len();
        let mut sample = Sample::new(columns);
        for line in lines {
            sample.add(line.as_bytes(), Delimiter::Blanks);
        }
        (sample, columns)
    }

    fn guess(lines: &[&str]) -> String {
        let (sample, columns) = sample(lines);
        listed(&guessed(&sample, columns, false).expect("three columns"))
    }

    #[test]
    fn common_layouts_are_guessed() {
        for (lines, expected) in [
            (&["1 2 3"][..], "x,y,z"),
            (&["1 2 3 -1613"], "x,y,z,intensity"),
            (&["1 2 3 117 73 49"], "x,y,z,r,g,b"),
            (&["1 2 3 0.5 0.7 1"], "x,y,z,r,g,b"),
            (&["1 2 3 0.6 -0.8 0"], "x,y,z,nx,ny,nz"),
            (&["1 2 3 -1613 52 70 64"], "x,y,z,intensity,r,g,b"),
            (&["1 2 3 4095 52 70 64"], "x,y,z,intensity,r,g,b"),
            (&["1 2 3 0.25 52 70 64", "1 2 3 0.5 52 70 64"], "x,y,z,intensity,r,g,b"),
            (&["1 2 3 117.0 73.0 49.0 255.0"], "x,y,z,r,g,b,alpha"),
            (&["1 2 3 117 73 49 12"], "x,y,z,r,g,b,intensity"),
            (&["1 2 3 117 73 49 -12.5"], "x,y,z,r,g,b,intensity"),
            (&["1 2 3 117 73 49 0 0 -1"], "x,y,z,r,g,b,nx,ny,nz"),
            (&["1 2 3 0 0 -1 117 73 49"], "x,y,z,nx,ny,nz,r,g,b"),
            (&["1 2 3 -5 117 73 49 0 0.6 0.8"], "x,y,z,intensity,r,g,b,nx,ny,nz"),
            (&["1 2 3 -4 -5"], "x,y,z,column_4,column_5"),
            (&["P1 1 2 3 117 73 49"], "-,x,y,z,r,g,b"),
        ] {
            assert_eq!(guess(lines), expected, "{lines:?}");
        }
    }

    #[test]
    fn where_either_fits_the_intensity_comes_first_in_pts_only() {
        let (sample, columns) = sample(&["1 2 3 200 52 70 64"]);
        let list = |is_pts| listed(&guessed(&sample, columns, is_pts).expect("three columns"));
        assert_eq!(list(true), "x,y,z,intensity,r,g,b");
        assert_eq!(list(false), "x,y,z,r,g,b,intensity");
    }

    #[test]
    fn two_columns_are_no_points() {
        let (sample, columns) = sample(&["1 2 word"]);
        assert_eq!(guessed(&sample, columns, false), None);
    }

    #[test]
    fn named_columns_are_taken_as_named() {
        let meanings = named("X, y,z,-,i,r,g,b,dip").expect("a list");
        assert_eq!(listed(&meanings), "x,y,z,-,intensity,r,g,b,dip");
        assert!(named("x,y").expect_err("refused").contains("x, y and z must be among them"));
        assert!(named("x,y,z,,i").expect_err("refused").contains("column 4 is empty"));
        assert!(named("x,y,z,i,i").expect_err("refused").contains("i is named twice"));
    }

    #[test]
    fn a_header_skips_columns_of_words() {
        let names = ["Label", "Y [m]", "X [m]", "Z [m]", "GPS Time"].map(str::to_owned);
        let (sample, _) = sample(&["tree 1 2 3 4"]);
        let meanings = from_header(&names, &sample).expect("coordinates");
        assert_eq!(listed(&meanings), "-,y,x,z,gps_time");
    }

    #[test]
    fn colours_of_every_range_become_16_bit() {
        for (line, scale, noted) in [
            ("1 2 3 117 73 49", 1.0, 0),
            ("1 2 3 117.5 73 49", 257.0, 1),
            ("1 2 3 0 0.5 1", 65535.0, 1),
            ("1 2 3 60000 0 1", 1.0, 0),
        ] {
            let (sample, columns) = sample(&[line]);
            let meanings = guessed(&sample, columns, false).expect("three columns");
            let mut notes = Vec::new();
            let plan = Plan::new(Delimiter::Blanks, &meanings, &sample, &mut notes);
            assert_eq!(plan.attributes[0].scalar, ScalarType::U16);
            let expected = Slot { offset: 0, scalar: ScalarType::U16, rule: Rule::Color { scale } };
            assert_eq!(plan.columns[3], Column::Value(expected), "{line}");
            assert_eq!(notes.len(), noted, "{line}");
        }
    }
}
