//! What a text file is: its line ends, delimiter, header and columns, told from its beginning and a
//! few samples further on.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::Path,
};

use super::{
    columns::{Meanings, Plan, from_header, guessed, listed, named},
    lines::{is_blank, lines, terminator_of},
    parse::is_comment,
    sample::Sample,
    split::{Delimiter, Field, Fields},
};
use crate::error::{Error, Result};

/// Bytes at the beginning of a file that are looked at.
const HEAD_BYTES: usize = 1 << 20;

/// Samples further on, and bytes of each.
const SAMPLES: u64 = 15;
const SAMPLE_BYTES: usize = 64 << 10;

/// What a text file was found to be.
#[derive(Debug)]
pub(super) struct Detected {
    /// How lines become points.
    pub plan: Plan,
    /// Ends lines.
    pub terminator: u8,
    /// Offset of the first line with a point, and its number.
    pub start: (u64, u64),
    /// Points that the count line before that announces (PTS).
    pub announced: Option<u64>,
    /// How the columns were understood and what is not kept, one line each.
    pub notes: Vec<String>,
}

/// Looks at a file; `columns` is the user's list of column names.
///
/// # Errors
/// [`Error::Io`] where it cannot be read, [`Error::Input`] where it is no text with points.
pub(super) fn detect(path: &Path, columns: Option<&str>) -> Result<Detected> {
    let wrong = |message: String| Error::input(path.display().to_string(), message);
    let cannot_read = || Error::io(path, "cannot read");
    let mut file = File::open(path).map_err(Error::io(path, "cannot open"))?;
    let size = file.metadata().map_err(cannot_read())?.len();
    let mut head = Vec::new();
    (&mut file).take(HEAD_BYTES as u64).read_to_end(&mut head).map_err(cannot_read())?;
    let beginning = Beginning::read(&head, size > head.len() as u64).map_err(wrong)?;

    let mut sample = Sample::new(beginning.columns);
    let terminator = beginning.terminator;
    for line in lines(&head[beginning.first_point.0..], terminator).filter(|l| !is_comment(l)) {
        sample.add(line, beginning.delimiter);
    }
    for i in 1..=SAMPLES {
        let offset = size / (SAMPLES + 1) * i;
        if offset < head.len() as u64 {
            continue;
        }
        let mut bytes = Vec::new();
        file.seek(SeekFrom::Start(offset)).map_err(cannot_read())?;
        (&mut file).take(SAMPLE_BYTES as u64).read_to_end(&mut bytes).map_err(cannot_read())?;
        // The first and the last line are likely cut.
        let start = memchr::memchr(terminator, &bytes).map_or(bytes.len(), |at| at + 1);
        let end = memchr::memrchr(terminator, &bytes).unwrap_or(0).max(start);
        for line in lines(&bytes[start..end], terminator).filter(|l| !is_comment(l)) {
            sample.add(line, beginning.delimiter);
        }
    }
    // Single bad lines are dropped and counted; a file of them is something else.
    if sample.misfits() > sample.rows() {
        return Err(wrong(format!(
            "not a point cloud: most lines have not the {} columns of line {}",
            beginning.columns, beginning.first_point.1
        )));
    }
    let is_pts = beginning.count_lines > 0
        || path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("pts"));
    let (plan, notes) = beginning.plan(&sample, columns, is_pts).map_err(wrong)?;
    let (offset, line) = beginning.first_point;
    Ok(Detected {
        plan,
        terminator,
        start: (offset as u64, line),
        announced: beginning.announced,
        notes,
    })
}

/// What the beginning of a text file tells.
#[derive(Debug, PartialEq, Eq)]
struct Beginning {
    terminator: u8,
    delimiter: Delimiter,
    /// Columns of the first line with a point.
    columns: usize,
    /// Offset and number of that line.
    first_point: (usize, u64),
    /// Points that count lines before it announce, and how many such lines there are.
    announced: Option<u64>,
    count_lines: usize,
    /// Lines before it, by number, that may name the columns; comment marks taken off.
    before: Vec<(u64, String)>,
}

impl Beginning {
    /// Reads `head`, the first bytes of a file; `is_cut` tells that there are more.
    fn read(head: &[u8], is_cut: bool) -> Result<Self, String> {
        let start = check_text(head)?;
        let text = &head[start..];
        let terminator = terminator_of(text);
        let whole = match memchr::memrchr(terminator, text) {
            Some(last) if is_cut => &text[..=last],
            _ => text,
        };
        let (mut offset, mut count_lines, mut announced) = (start, 0, None);
        let mut before = Vec::new();
        for (line, number) in lines(whole, terminator).zip(1_u64..) {
            if let Some(count) = count_line(line) {
                count_lines += 1;
                announced = Some(count);
                if count_lines == 2 {
                    return Err(format!(
                        "line {number} is a second count: a PTX scan (columns, rows, a matrix, \
                         then points in the scanner's own system) is not a list of points; export \
                         it as PTS, E57 or LAS"
                    ));
                }
            } else if !is_comment(line) {
                let delimiter = Delimiter::of(line).ok_or_else(|| {
                    format!(
                        "line {number} writes decimals with a comma ({}): replace decimal commas \
                         by points",
                        shown(line)
                    )
                })?;
                let columns = delimiter.fields(line).len();
                if numbers(line, delimiter) >= 3 {
                    let first_point = (offset, number);
                    return Ok(Self {
                        terminator,
                        delimiter,
                        columns,
                        first_point,
                        announced,
                        count_lines,
                        before,
                    });
                }
            }
            if !is_blank(line) && count_line(line).is_none() {
                before.push((number, String::from_utf8_lossy(uncommented(line)).into_owned()));
            }
            offset += line.len() + 1;
        }
        Err(match lines(whole, terminator).zip(1_u64..).find(|(line, _)| !is_blank(line)) {
            None => "the file holds nothing but blanks".to_owned(),
            Some((line, number)) => format!(
                "not a point cloud: no line at its beginning holds three numbers (line {number}: \
                 {})",
                shown(line)
            ),
        })
    }

    /// The plan for reading the file and what a user should know of it.
    fn plan(
        &self,
        sample: &Sample,
        columns: Option<&str>,
        is_pts: bool,
    ) -> Result<(Plan, Vec<String>), String> {
        let mut notes = Vec::new();
        let meanings = match columns {
            Some(list) => self.by_option(list)?,
            None => self
                .by_header(sample, &mut notes)
                .map_or_else(|| self.by_guess(sample, is_pts, &mut notes), Ok)?,
        };
        let mut plan = Plan::new(self.delimiter, &meanings, sample, &mut notes);
        plan.more_columns = columns.is_some();
        plan.count_lines = self.count_lines > 0;
        Ok((plan, notes))
    }

    fn by_option(&self, list: &str) -> Result<Meanings, String> {
        let meanings = named(list)?;
        if meanings.len() > self.columns {
            return Err(format!(
                "columns {list:?} are {}, but line {} has {}",
                meanings.len(),
                self.first_point.1,
                self.columns
            ));
        }
        Ok(meanings)
    }

    fn by_header(&self, sample: &Sample, notes: &mut Vec<String>) -> Option<Meanings> {
        for (number, line) in self.before.iter().rev() {
            let fields = self.delimiter.fields(line.as_bytes());
            let names: Vec<String> =
                fields.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect();
            if names.len() != self.columns {
                continue;
            }
            if let Some(meanings) = from_header(&names, sample) {
                let skipped = names.iter().zip(&meanings).filter(|(_, meaning)| meaning.is_none());
                notes.extend(
                    skipped
                        .map(|(name, _)| format!("column {name:?}: no numbers were found in it")),
                );
                return Some(meanings);
            }
            notes.push(format!(
                "line {number} names no columns x, y and z ({}): columns are guessed",
                shown(line.as_bytes())
            ));
        }
        None
    }

    fn by_guess(
        &self,
        sample: &Sample,
        is_pts: bool,
        notes: &mut Vec<String>,
    ) -> Result<Meanings, String> {
        let meanings = guessed(sample, self.columns, is_pts).ok_or_else(|| {
            "not a point cloud: there are not three columns of numbers".to_owned()
        })?;
        if meanings.len() > 3 {
            notes.push(format!(
                "columns, guessed from their numbers: {} (if that is wrong, name them: --columns)",
                listed(&meanings)
            ));
        }
        Ok(meanings)
    }
}

/// Refuses what is not text; gives the length of a byte order mark.
fn check_text(head: &[u8]) -> Result<usize, String> {
    if head.is_empty() {
        return Err("the file is empty".to_owned());
    }
    if head.starts_with(&[0xff, 0xfe]) || head.starts_with(&[0xfe, 0xff]) {
        return Err("the text is UTF-16: save it as UTF-8".to_owned());
    }
    // Control characters that no text holds; 0x1a ended text files under DOS.
    let is_binary = |byte: &u8| matches!(byte, 0..=8 | 14..=25 | 27..=31 | 127);
    if let Some(at) = head.iter().position(is_binary) {
        return Err(format!(
            "not a text point cloud: byte {at} is {:#04x}, which no text holds",
            head[at]
        ));
    }
    Ok(if head.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 })
}

/// The number of a line that holds one whole number and nothing else.
pub(super) fn count_line(line: &[u8]) -> Option<u64> {
    std::str::from_utf8(line.trim_ascii()).ok()?.parse().ok()
}

/// Fields of a line that are numbers.
fn numbers(line: &[u8], delimiter: Delimiter) -> usize {
    let mut fields = Fields::new(line, delimiter);
    std::iter::from_fn(|| fields.next()).filter(|f| matches!(f, Field::Number(_))).count()
}

/// A line without the marks that make it a comment.
fn uncommented(line: &[u8]) -> &[u8] {
    let line = line.trim_ascii();
    let marks = line.iter().take_while(|&&byte| matches!(byte, b'#' | b'/')).count();
    line[marks..].trim_ascii()
}

/// A line for a message: short and printable.
pub(super) fn shown(line: &[u8]) -> String {
    let line = line.trim_ascii();
    let cut = if line.len() > 60 { "…" } else { "" };
    format!("{:?}{cut}", String::from_utf8_lossy(&line[..line.len().min(60)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str) -> Result<(Plan, Vec<String>), String> {
        let beginning = Beginning::read(text.as_bytes(), false)?;
        let mut sample = Sample::new(beginning.columns);
        for line in lines(&text.as_bytes()[beginning.first_point.0..], beginning.terminator) {
            sample.add(line, beginning.delimiter);
        }
        beginning.plan(&sample, None, false)
    }

    fn names(text: &str) -> Vec<String> {
        plan(text).expect(text).0.attributes.into_iter().map(|a| a.name).collect()
    }

    #[test]
    fn headers_name_the_columns_commented_or_not() {
        assert_eq!(names("x,y,z,dip\n1,2,3,4\n"), ["dip"]);
        assert_eq!(names("//X Y Z Intensity\n1 2 3 4\n"), ["intensity"]);
        assert_eq!(names("# made by hand\n# x y z quality\n\n1 2 3 4\n"), ["quality"]);
        assert_eq!(names("\u{feff}\"Z\";\"GPS time\";\"Y\";\"X\"\r\n1;2;3;4\r\n"), ["gps_time"]);
    }

    #[test]
    fn a_header_that_names_no_coordinates_is_told_of() {
        let (plan, notes) = plan("a b c d\n1 2 3 -4\n").expect("points");
        assert_eq!(plan.attributes[0].name, "intensity");
        assert_eq!(notes.len(), 2, "{notes:?}");
        assert!(notes[0].contains("line 1 names no columns x, y and z"));
        assert!(notes[1].contains("x,y,z,intensity"));
    }

    #[test]
    fn the_first_point_is_found_behind_prose_and_counts() {
        let text = "Exported today\n12\n\n1 2 3\n4 5 6\n";
        let beginning = Beginning::read(text.as_bytes(), false).expect("points");
        assert_eq!(beginning.first_point, (19, 4));
        assert_eq!(beginning.announced, Some(12));
    }

    #[test]
    fn what_is_no_point_cloud_is_refused_with_its_reason() {
        for (text, reason) in [
            ("", "empty"),
            ("\n \n", "nothing but blanks"),
            ("hello\nworld\n", "no line at its beginning holds three numbers (line 1: \"hello\")"),
            ("x,y,z\n", "no line at its beginning holds three numbers"),
            ("1,5 2,5 3,5\n", "line 1 writes decimals with a comma"),
            ("x;y;z\n1,5;2,5;3,5\n", "line 2 writes decimals with a comma"),
            ("15\n71\n0 0 0\n", "PTX"),
            ("1 2 3\n\0\n", "byte 6 is 0x00"),
        ] {
            let why = plan(text).expect_err(text);
            assert!(why.contains(reason), "{text:?}: {why}");
        }
        assert!(check_text(&[0xff, 0xfe, b'1', 0]).expect_err("refused").contains("UTF-16"));
    }
}
