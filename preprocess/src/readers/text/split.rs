//! Fields of a line: what separates them, and reading them one by one.

use super::{
    lines::is_blank_byte,
    number::{self, Number},
};

/// What separates the fields of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Delimiter {
    /// Runs of spaces and tabs; a field is never empty.
    Blanks,
    /// One byte (comma, semicolon, tab), blanks around it allowed; a field may be empty, but an
    /// empty one at the end of a line is none.
    Byte(u8),
}

/// A field read as a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Field {
    /// A number, or a word for NaN or infinity.
    Number(Number),
    /// Nothing between two delimiters.
    Empty,
    /// Something else.
    Other,
}

impl Delimiter {
    /// The delimiter of a line that holds numbers; `None` where numbers in it have decimal commas.
    pub fn of(line: &[u8]) -> Option<Self> {
        let has_decimal_comma = |fields: Vec<&[u8]>| fields.into_iter().any(is_decimal_comma);
        if line.contains(&b';') {
            let semicolon = Self::Byte(b';');
            return (!has_decimal_comma(semicolon.fields(line))).then_some(semicolon);
        }
        if line.contains(&b',') {
            return (!has_decimal_comma(Self::Blanks.fields(line))).then_some(Self::Byte(b','));
        }
        // Tabs separate fields, unless they merely pad a table: then fields would be empty, or
        // hold blanks themselves.
        let tab = Self::Byte(b'\t');
        let fields = tab.fields(line);
        let alone = |field: &&[u8]| !field.is_empty() && !field.iter().any(|&b| is_blank_byte(b));
        Some(if fields.len() > 1 && fields.iter().all(alone) { tab } else { Self::Blanks })
    }

    /// All fields of a line, without the blanks and quotes around them.
    pub fn fields(self, line: &[u8]) -> Vec<&[u8]> {
        match self {
            Self::Blanks => {
                line.split(|&b| is_blank_byte(b)).filter(|field| !field.is_empty()).collect()
            }
            Self::Byte(byte) => {
                let mut fields: Vec<&[u8]> = line.split(|&b| b == byte).map(bare).collect();
                if fields.last().is_some_and(|field| field.is_empty()) {
                    fields.pop();
                }
                fields
            }
        }
    }
}

/// Whether a field is a number with a comma for its decimal point.
fn is_decimal_comma(field: &[u8]) -> bool {
    let mut commas = 0;
    let with_point: Vec<u8> = field
        .iter()
        .map(|&byte| {
            commas += u32::from(byte == b',');
            if byte == b',' { b'.' } else { byte }
        })
        .collect();
    // "1," is a number and its delimiter.
    commas == 1
        && !field.contains(&b'.')
        && field.last() != Some(&b',')
        && number::scan(&with_point).is_some_and(|(_, taken)| taken == field.len())
}

/// A field without the blanks and quotes around it.
fn bare(field: &[u8]) -> &[u8] {
    let field = field.trim_ascii();
    match field {
        [b'"', inner @ .., b'"'] | [b'\'', inner @ .., b'\''] => inner.trim_ascii(),
        _ => field,
    }
}

/// Reads the fields of a line from left to right.
pub(super) struct Fields<'a> {
    /// What is left; `None` once the last field of a line without a delimiter at its end is read.
    rest: Option<&'a [u8]>,
    delimiter: Delimiter,
}

impl<'a> Fields<'a> {
    /// The fields of `line`.
    pub fn new(line: &'a [u8], delimiter: Delimiter) -> Self {
        Self { rest: Some(line), delimiter }
    }

    /// The next field; `None` at the end of the line.
    #[inline]
    pub fn next(&mut self) -> Option<Field> {
        let rest = self.rest?;
        let start = self.skip_blanks(rest, 0);
        // The common case in one pass: a number, then the delimiter or the end.
        if let Some((number, taken)) = number::scan(&rest[start..]) {
            let end = start + taken;
            match self.delimiter {
                Delimiter::Blanks if rest.get(end).is_none_or(|&b| is_blank_byte(b)) => {
                    self.rest = Some(&rest[end..]);
                    return Some(Field::Number(number));
                }
                Delimiter::Byte(byte) => {
                    let end = self.skip_blanks(rest, end);
                    if rest.get(end).is_none_or(|&b| b == byte) {
                        self.rest = rest.get(end + 1..);
                        return Some(Field::Number(number));
                    }
                }
                Delimiter::Blanks => {}
            }
        }
        self.other(&rest[start..])
    }

    /// Whether no field is left.
    pub fn is_at_end(&self) -> bool {
        self.rest.is_none_or(|rest| self.skip_blanks(rest, 0) == rest.len())
    }

    /// A field that does not plainly start with a number.
    #[cold]
    fn other(&mut self, rest: &'a [u8]) -> Option<Field> {
        let field = match self.delimiter {
            Delimiter::Blanks => {
                let length = rest.iter().take_while(|&&b| !is_blank_byte(b)).count();
                if length == 0 {
                    return None;
                }
                self.rest = Some(&rest[length..]);
                &rest[..length]
            }
            Delimiter::Byte(byte) => {
                let length = memchr::memchr(byte, rest).unwrap_or(rest.len());
                self.rest = rest.get(length + 1..);
                if self.rest.is_none() && rest.trim_ascii().is_empty() {
                    return None;
                }
                bare(&rest[..length])
            }
        };
        Some(if field.is_empty() {
            Field::Empty
        } else {
            number::parse(field).map_or(Field::Other, Field::Number)
        })
    }

    fn skip_blanks(&self, bytes: &[u8], mut at: usize) -> usize {
        while let Some(&byte) = bytes.get(at)
            && is_blank_byte(byte)
            && self.delimiter != Delimiter::Byte(byte)
        {
            at += 1;
        }
        at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str, delimiter: Delimiter) -> Vec<Option<f64>> {
        let mut fields = Fields::new(line.as_bytes(), delimiter);
        let mut values = Vec::new();
        while let Some(field) = fields.next() {
            values.push(match field {
                Field::Number(number) => Some(number.value),
                Field::Empty => None,
                Field::Other => Some(-999.0),
            });
        }
        assert!(fields.is_at_end());
        values
    }

    #[test]
    fn tells_the_delimiter() {
        for (line, delimiter) in [
            ("1 2 3", Delimiter::Blanks),
            (" 1\t 2 3 ", Delimiter::Blanks),
            ("1\t\t2\t3", Delimiter::Blanks),
            ("1\t2\t3\r", Delimiter::Byte(b'\t')),
            ("1.5,2,3", Delimiter::Byte(b',')),
            ("1.5, 2, 3", Delimiter::Byte(b',')),
            ("1;2; 3;", Delimiter::Byte(b';')),
        ] {
            assert_eq!(Delimiter::of(line.as_bytes()), Some(delimiter), "{line}");
        }
    }

    #[test]
    fn decimal_commas_are_seen() {
        for line in ["665187,522 5648349,895 241,767", "1,5;2,5;3", "-1,5\t2,5\t3,5e1"] {
            assert_eq!(Delimiter::of(line.as_bytes()), None, "{line}");
        }
    }

    #[test]
    fn reads_fields_between_blanks() {
        assert_eq!(read("  1 2.5\t-3 ", Delimiter::Blanks), [1.0, 2.5, -3.0].map(Some));
        assert_eq!(read("1 x2 3y", Delimiter::Blanks), [1.0, -999.0, -999.0].map(Some));
        assert_eq!(read(" \r", Delimiter::Blanks), []);
    }

    #[test]
    fn reads_fields_between_delimiters() {
        let comma = Delimiter::Byte(b',');
        assert_eq!(read("1, 2.5 ,-3", comma), [1.0, 2.5, -3.0].map(Some));
        assert_eq!(read("1,,\"3\",", comma), [Some(1.0), None, Some(3.0)]);
        assert_eq!(read("1,2 3,x", comma), [1.0, -999.0, -999.0].map(Some));
        assert_eq!(read("1\t\t3\r", Delimiter::Byte(b'\t')), [Some(1.0), None, Some(3.0)]);
        assert_eq!(read("", comma), []);
    }

    #[test]
    fn fields_and_their_list_agree_on_how_many_there_are() {
        for line in ["1,2,3", "1,2,3,", "1,,3, ", ",", "1,2,,"] {
            let comma = Delimiter::Byte(b',');
            assert_eq!(read(line, comma).len(), comma.fields(line.as_bytes()).len(), "{line:?}");
        }
    }
}
