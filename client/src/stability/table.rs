//! The table, for programs and for terminals.

use std::fmt::Write;

use serde::Serialize;

use super::{ALGORITHMS, Naive, Row};

/// All rows.
#[derive(Debug, Clone, Serialize)]
pub struct Table {
    /// In the order of the algorithms and of their cases.
    pub rows: Vec<Row>,
}

/// A line of the CSV file.
#[derive(Serialize)]
struct Line<'a> {
    algorithm: &'a str,
    case: &'a str,
    error: String,
    unit: &'a str,
    tolerance: String,
    passed: bool,
    reason: &'a str,
    reference: &'a str,
    /// `name: error; …`, a plain failure with an exclamation mark.
    shortcuts: String,
}

/// What the JSON file holds.
#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    version: u32,
    cases: usize,
    missed: usize,
    rows: &'a [Row],
}

impl Table {
    /// Rows that have not passed.
    pub fn missed(&self) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(|row| !row.passed)
    }

    /// Shortcuts that fail, plain to see, where the algorithm holds.
    pub fn failing_shortcuts(&self) -> impl Iterator<Item = (&Row, &Naive)> {
        self.rows
            .iter()
            .flat_map(|row| row.naive.iter().map(move |naive| (row, naive)))
            .filter(|(_, naive)| naive.fails)
    }

    /// The rows of an algorithm.
    pub fn of(&self, algorithm: &str) -> impl Iterator<Item = &Row> {
        self.rows.iter().filter(move |row| row.algorithm == algorithm)
    }

    /// As CSV with a header line. Numbers have all digits that tell them apart.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in &self.rows {
            let shortcuts = row.naive.iter().map(|Naive { name, error, fails }| {
                format!("{name}: {error:?}{}", if *fails { "!" } else { "" })
            });
            let line = Line {
                algorithm: row.algorithm,
                case: &row.case,
                error: format!("{:?}", row.error),
                unit: row.unit,
                tolerance: format!("{:?}", row.tolerance),
                passed: row.passed,
                reason: row.reason,
                reference: row.reference,
                shortcuts: shortcuts.collect::<Vec<_>>().join("; "),
            };
            writer.serialize(line).expect("lines of text and numbers go into memory");
        }
        let bytes = writer.into_inner().expect("memory can be written");
        String::from_utf8(bytes).expect("made of strings")
    }

    /// As JSON. What is not a finite number is its name as a string.
    #[must_use]
    pub fn json(&self) -> String {
        let document = Document {
            format: "lodestream-stability",
            version: 1,
            cases: self.rows.len(),
            missed: self.missed().count(),
            rows: &self.rows,
        };
        let text = serde_json::to_string_pretty(&document);
        text.expect("strings and finite numbers always serialize") + "\n"
    }

    /// For a terminal: a line per row, and one that sums up.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        let widest = self.rows.iter().map(|row| row.case.chars().count()).max().unwrap_or(0);
        for algorithm in &ALGORITHMS {
            for (i, row) in self.of(algorithm.name).enumerate() {
                let name = if i == 0 { algorithm.name } else { "" };
                let verdict = if row.passed { "ok" } else { "MISS" };
                let worst = row.naive.iter().filter(|naive| naive.fails);
                let worst = worst.max_by(|a, b| size(a.error).total_cmp(&size(b.error)));
                let worst = worst.map_or(String::new(), |naive| {
                    format!("   {}: {}", naive.name, short(naive.error))
                });
                // A write to a string does not fail.
                let _ = writeln!(
                    text,
                    "{name:12} {:widest$}  {:>9} of {:>9} {:24} {verdict}{worst}",
                    row.case,
                    short(row.error),
                    short(row.tolerance),
                    row.unit,
                );
            }
        }
        text + &self.summary() + "\n"
    }

    /// One sentence.
    #[must_use]
    pub fn summary(&self) -> String {
        let (cases, missed) = (self.rows.len(), self.missed().count());
        let failing = self.rows.iter().filter(|row| row.naive.iter().any(|n| n.fails)).count();
        let held = if missed == 0 {
            "all within their tolerance".to_owned()
        } else {
            format!("{missed} beyond their tolerance")
        };
        format!("{cases} cases, {held}; in {failing} of them a usual shortcut plainly fails")
    }
}

/// For sorting: what is no number is the worst.
fn size(error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { error }
}

/// Two digits, or all of a whole number.
pub(super) fn short(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        "none".into()
    } else if value.fract() == 0.0 && size < 1e6 {
        format!("{value}")
    } else if (0.01..100.0).contains(&size) {
        let decimals = (1.0 - size.log10().floor()).max(0.0) as usize;
        format!("{value:.decimals$}")
    } else {
        format!("{value:.1e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let row = Row::new("a, \"b\"", (1e-17, "m"), (1e-15, "because"), "exact");
        let mut row = row.beside("single", f64::NAN);
        row.algorithm = "eigen";
        let mut missed = Row::holds("c", false, "because", "exact");
        missed.algorithm = "eigen";
        Table { rows: vec![row, missed] }
    }

    #[test]
    fn csv_and_json_can_be_read_again() {
        let table = table();
        let csv = table.csv();
        let mut reader = csv::Reader::from_reader(csv.as_bytes());
        let line = reader.records().next().expect("a line").expect("CSV");
        assert_eq!((&line[1], &line[2], &line[8]), ("a, \"b\"", "1e-17", "single: NaN!"));
        let json: serde_json::Value = serde_json::from_str(&table.json()).expect("JSON");
        assert_eq!(json["missed"], 1);
        assert_eq!(json["rows"][0]["naive"][0]["error"], "NaN");
    }

    #[test]
    fn a_terminal_sees_what_was_missed() {
        let text = table().text();
        assert!(text.contains("MISS") && text.contains("single: none"), "{text}");
        assert!(text.ends_with(
            "2 cases, 1 beyond their tolerance; in 1 of them a usual shortcut plainly fails\n"
        ));
    }

    #[test]
    fn numbers_are_short() {
        let shorts = [0.0, 1.0, 1234.0, 1.24e-16, f64::NAN, 0.512, 3.44, 44.4, 0.0351].map(short);
        assert_eq!(shorts, ["0", "1", "1234", "1.2e-16", "none", "0.51", "3.4", "44", "0.035"]);
    }
}
