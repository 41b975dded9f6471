//! A sample of a text file's numbers, to tell what its columns are.

use super::split::{Delimiter, Field, Fields};
use crate::readers::color::ColorRange;

/// Rows of numbers from several places of a file.
#[derive(Debug, Default)]
pub(super) struct Sample {
    columns: usize,
    /// Row by row; NaN where a field is no number.
    values: Vec<f64>,
    /// Per column, fields that are numbers.
    numbers: Vec<usize>,
    /// Lines that have another number of fields.
    misfits: usize,
}

/// Rows that are enough to judge by.
const ENOUGH_ROWS: usize = 20_000;

impl Sample {
    /// An empty sample of rows with so many columns.
    pub fn new(columns: usize) -> Self {
        Self { columns, values: Vec::new(), numbers: vec![0; columns], misfits: 0 }
    }

    /// Adds a line, where it has the right number of fields and there are not enough rows yet.
    pub fn add(&mut self, line: &[u8], delimiter: Delimiter) {
        if self.rows() >= ENOUGH_ROWS {
            return;
        }
        let start = self.values.len();
        let mut fields = Fields::new(line, delimiter);
        while let Some(field) = fields.next() {
            self.values.push(match field {
                Field::Number(number) => number.value,
                Field::Empty | Field::Other => f64::NAN,
            });
        }
        if self.values.len() != start + self.columns {
            self.values.truncate(start);
            self.misfits += 1;
            return;
        }
        for (numbers, value) in self.numbers.iter_mut().zip(&self.values[start..]) {
            *numbers += usize::from(!value.is_nan());
        }
    }

    /// Rows in the sample.
    pub fn rows(&self) -> usize {
        self.values.len() / self.columns.max(1)
    }

    /// Lines that were no rows: they have another number of fields.
    pub fn misfits(&self) -> usize {
        self.misfits
    }

    /// Columns that hold numbers.
    pub fn numeric_columns(&self) -> Vec<usize> {
        (0..self.columns).filter(|&column| self.numbers[column] > 0).collect()
    }

    /// Whether every number of the column is `value`.
    pub fn is_constant(&self, column: usize, value: f64) -> bool {
        self.column(column).all(|v| v == value)
    }

    /// How the columns are to be read, where they hold a colour.
    pub fn color_range(&self, columns: [usize; 3]) -> ColorRange {
        ColorRange::of(columns.into_iter().flat_map(|column| self.column(column)))
    }

    /// How the columns are to be read, where they may hold a colour: all of them in one range, and
    /// whole beyond 255.
    pub fn color_candidate(&self, columns: [usize; 3]) -> Option<ColorRange> {
        let values = || columns.into_iter().flat_map(|column| self.column(column));
        let range = self.color_range(columns);
        let most = if range == ColorRange::Unit { 1.0 } else { 65535.0 };
        let fits = values().all(|v| (0.0..=most).contains(&v));
        let whole = range != ColorRange::Word || values().all(|v| v.fract() == 0.0);
        (fits && whole).then_some(range)
    }

    /// Whether the columns hold vectors of length one (or zero: unknown normals), which could not
    /// as well be colours.
    pub fn is_unit_vector(&self, columns: [usize; 3]) -> bool {
        let mut telling = false;
        let unit = self.values.chunks_exact(self.columns.max(1)).all(|row| {
            let vector = columns.map(|column| row[column]);
            telling |= vector.iter().any(|v| *v < 0.0 || v.fract() != 0.0);
            let square: f64 = vector.iter().map(|v| v * v).sum();
            // Two digits are the fewest that normals are written with.
            square == 0.0 || (square - 1.0).abs() < 0.03
        });
        unit && telling
    }

    fn column(&self, column: usize) -> impl Iterator<Item = f64> {
        self.values
            .iter()
            .skip(column)
            .step_by(self.columns.max(1))
            .copied()
            .filter(|v| !v.is_nan())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(lines: &[&str]) -> Sample {
        let columns = Delimiter::Blanks.fields(lines[0].as_bytes()).len();
        let mut sample = Sample::new(columns);
        for line in lines {
            sample.add(line.as_bytes(), Delimiter::Blanks);
        }
        sample
    }

    #[test]
    fn rows_of_another_length_are_left_out() {
        assert_eq!(sample(&["1 2 3", "1 2", "1 2 3 4", "4 5 6"]).rows(), 2);
    }

    #[test]
    fn columns_of_words_are_not_numeric() {
        assert_eq!(sample(&["a 1 2", "b x 3"]).numeric_columns(), [1, 2]);
    }

    #[test]
    fn colours_are_told_by_their_range() {
        let range = |row: &str| sample(&[row]).color_candidate([0, 1, 2]);
        assert_eq!(range("0 0.5 1"), Some(ColorRange::Unit));
        assert_eq!(range("0 0 1"), Some(ColorRange::Unit));
        assert_eq!(range("0 0.5 1.5"), None);
        assert_eq!(range("0 117.0 255"), Some(ColorRange::Byte));
        assert_eq!(range("0 117 256"), Some(ColorRange::Word));
        assert_eq!(range("0 117.5 256"), None);
        assert_eq!(range("-1 2 3"), None);
        assert_eq!(range("1 2 65536"), None);
    }

    #[test]
    fn unit_vectors_are_told_from_colours() {
        assert!(sample(&["0.6 0.8 0", "0 0 0"]).is_unit_vector([0, 1, 2]));
        assert!(sample(&["0 0 -1"]).is_unit_vector([0, 1, 2]));
        assert!(!sample(&["0 0 1", "1 0 0"]).is_unit_vector([0, 1, 2]), "red and blue");
        assert!(!sample(&["0.6 0.8 0", "0.6 0.8 0.9"]).is_unit_vector([0, 1, 2]));
    }
}
