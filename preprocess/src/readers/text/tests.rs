//! Whole files: written, then read back.

use proptest::prelude::*;

use super::*;
use crate::readers::{
    InputAttribute,
    testing::{Cloud, file, refusal_of},
};

fn read(text: &str, columns: Option<&str>) -> Result<Cloud> {
    let file = file(text.as_bytes());
    Cloud::read(open(file.path(), columns)?)
}

fn refusal(text: &str, columns: Option<&str>) -> String {
    refusal_of(read(text, columns))
}

/// The names of the attributes and the values of point `index`, flattened.
fn values(cloud: &Cloud, index: usize) -> (Vec<&str>, Vec<f64>) {
    let size = |a: &InputAttribute| a.scalar.size_bytes() * usize::from(a.components);
    let row_bytes: usize = cloud.info.attributes.iter().map(size).sum();
    let mut row = &cloud.attributes[index * row_bytes..];
    let (mut names, mut values) = (Vec::new(), Vec::new());
    for attribute in &cloud.info.attributes {
        names.push(attribute.name.as_str());
        for component in row[..size(attribute)].chunks_exact(attribute.scalar.size_bytes()) {
            values.push(attribute.scalar.to_f64(component));
        }
        row = &row[size(attribute)..];
    }
    (names, values)
}

#[test]
fn a_csv_with_a_header_is_read_by_its_names() {
    let text = "\u{feff}Z,Y,X,Red,Green,Blue,Return Number,Name\r\n\
        3,2,1.50,10,20,30,1,oak\r\n6,5,4.25,40,50,60,,elm\r\n";
    let cloud = read(text, None).expect("points");
    assert_eq!(cloud.positions, [[1.5, 2.0, 3.0], [4.25, 5.0, 6.0]]);
    let (names, first) = values(&cloud, 0);
    assert_eq!(names, ["color", "return_number"]);
    assert_eq!(first, [10.0, 20.0, 30.0, 1.0]);
    assert!(values(&cloud, 1).1[3].is_nan(), "an empty field");
    assert_eq!(cloud.report.decimals, Some(2));
    assert_eq!(cloud.info.left_out, ["column \"Name\": no numbers were found in it"]);
}

#[test]
fn the_option_names_and_skips_columns() {
    let text = "7 1 2 3 0.25 9 9\n8 4 5 6 0.5 9 9\n";
    let cloud = read(text, Some("-,x,y,z,i")).expect("points");
    assert_eq!(cloud.positions, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    assert_eq!(values(&cloud, 1), (vec!["intensity"], vec![0.5]));
    assert_eq!(cloud.info.left_out, [""; 0], "nothing was guessed");
    let why = refusal(text, Some("x,y,z,a,b,c,d,e"));
    assert!(why.contains("are 8, but line 1 has 7"), "{why}");
}

#[test]
fn a_pts_file_is_read_behind_its_counts() {
    let text = "2\n1 2 3 -1613 52 70 64\n4 5 6 -1998 58 76 67\n1\n7 8 9 0 1 2 3\n";
    let cloud = read(text, None).expect("points");
    assert_eq!(cloud.info.points, Some(2));
    assert_eq!(cloud.positions.len(), 3);
    assert_eq!(values(&cloud, 1), (vec!["color", "intensity"], vec![58.0, 76.0, 67.0, -1998.0]));
    assert!(cloud.report.dropped.is_empty() && cloud.report.warnings.is_empty());

    let why = refusal(&text.replace("2\n1 2", "4\n1 2"), None);
    assert!(why.contains("announces 5 points, but only 3 follow"), "{why}");
    let fewer = read(&text.replace("2\n1 2", "1\n1 2"), None).expect("points");
    assert!(fewer.report.warnings[0].contains("announces 2 points, 3 follow"));
}

#[test]
fn bad_lines_are_dropped_and_counted_and_the_first_is_named() {
    let text = "# x y z\n1 2 3\n4 5\n\n// a remark\nend of it\n6 7 8\n9 9 nan\n1 1 1\n";
    let cloud = read(text, None).expect("points");
    assert_eq!(cloud.positions, [[1.0, 2.0, 3.0], [6.0, 7.0, 8.0], [1.0, 1.0, 1.0]]);
    assert_eq!(
        cloud.report.dropped,
        [
            ("coordinate is NaN or infinite".to_owned(), 1),
            ("line is not a point (the first: line 3: \"4 5\")".to_owned(), 2),
        ]
    );
    assert_eq!(cloud.report.points_read, 6);
}

#[test]
fn a_file_of_bad_lines_is_refused() {
    let why = refusal("1 2 3\nfoo\nbar\n", None);
    assert!(why.contains("most lines have not the 3 columns of line 1"), "{why}");
    let why = refusal("1 2 3 4\n5 6 7 x\n8 9 0 y\n", Some("x,y,z,i"));
    assert!(
        why.contains("2 of its 3 lines hold no point of 4 columns (the first: line 2"),
        "{why}"
    );
}

#[test]
fn colours_that_do_not_fit_are_counted() {
    let text = "1 2 3 0.5 1 0\n".repeat(100) + "1 2 3 0.5 1.5 -1\n";
    let cloud = read(&text, Some("x,y,z,r,g,b")).expect("points");
    assert_eq!(values(&cloud, 0).1, [32768.0, 65535.0, 0.0]);
    assert_eq!(values(&cloud, 100).1, [32768.0, 65535.0, 0.0]);
    assert_eq!(cloud.report.warnings.len(), 1, "{:?}", cloud.report);
    assert!(cloud.report.warnings[0].starts_with("2 colour components"), "{:?}", cloud.report);
}

proptest! {
    #[test]
    fn what_is_printed_is_read_back_exactly(
        rows in proptest::collection::vec(
            (
                [-1_000_000_000_i64..1_000_000_000, -1_000_000_000..1_000_000_000, -1000..1000],
                proptest::num::f64::NORMAL,
                any::<[u8; 3]>(),
            ),
            1..50,
        ),
        places in 0_usize..7,
        (delimiter, line_end) in prop::sample::select(vec![
            (" ", "\n"), ("\t", "\r\n"), (",", "\n"), (", ", "\r"), (";", "\n"), ("  ", "\r"),
        ]),
        header: bool,
        last_end: bool,
    ) {
        let scale = 10_f64.powi(i32::try_from(places).expect("small"));
        let mut lines = Vec::new();
        if header {
            lines.push(["x", "y", "z", "q", "r", "g", "b"].join(delimiter));
        }
        for (position, quality, color) in &rows {
            let mut fields: Vec<String> =
                position.iter().map(|&q| format!("{:.places$}", q as f64 / scale)).collect();
            fields.push(format!("{quality:e}"));
            fields.extend(color.iter().map(u8::to_string));
            lines.push(fields.join(delimiter));
        }
        let mut text = lines.join(line_end);
        if last_end {
            text += line_end;
        }
        let columns = if header { None } else { Some("x,y,z,q,r,g,b") };
        let cloud = read(&text, columns).expect("points");
        prop_assert_eq!(cloud.positions.len(), rows.len());
        prop_assert!(usize::from(cloud.report.decimals.expect("few decimals")) <= places);
        for (i, (position, quality, color)) in rows.iter().enumerate() {
            prop_assert_eq!(cloud.positions[i], position.map(|q| q as f64 / scale));
            let (_, found) = values(&cloud, i);
            if rows.iter().all(|(_, _, color)| color.iter().all(|&c| c <= 1)) {
                continue; // read as colours from 0 to 1
            }
            prop_assert_eq!(found, [f64::from(color[0]), f64::from(color[1]), f64::from(color[2]), *quality]);
        }
    }

    #[test]
    fn any_text_is_read_or_refused(text in "[0-9 .,;eE+-]{0,40}(\n[0-9 .,;nax/#-]{0,40}){0,10}") {
        let _ = read(&text, None);
        let _ = read(&text, Some("x,y,z,-,i"));
    }
}

#[test]
fn chunks_keep_the_order_of_the_file() {
    let count = 300_000_u32;
    let text: String = (0..count).map(|i| format!("{i} 0.25 1\n")).collect();
    let cloud = read(&text, None).expect("points");
    assert_eq!(cloud.positions.len(), 300_000);
    assert!((0..count).zip(&cloud.positions).all(|(i, p)| *p == [f64::from(i), 0.25, 1.0]));
    assert_eq!(cloud.report.decimals, Some(2));
}
