//! Text: XYZ, CSV, TXT, PTS, ASC and whatever else holds a point a line.
//!
//! The delimiter (comma, semicolon, tab, blanks) is told from the first line that holds three
//! numbers. What the columns mean is told, in this order, by the `columns` option, by a header line
//! before the points (`x,y,z,intensity`, also behind `//` or `#`), or by the numbers themselves:
//! see `columns::guessed`, and the note that says how they were understood.
//!
//! Types do not depend on the numbers found, so that the files of one dataset agree: colours are
//! 16-bit (8-bit values stay as they are, fractions of one are scaled), normals single precision,
//! everything else double, which holds every number of a text as it is read. An empty field of such
//! an attribute is NaN.
//!
//! Lines that are not points are dropped and counted, and the first is named; where they are the
//! most, the file is refused.
//!
//! Why not the `csv` crate: it has no notion of blanks as delimiters, of columns without names, or
//! of decimals, and it reads on one thread. Quoting is known as far as numbers and names need it:
//! quotes around a field are taken off, delimiters inside of them are not looked for.

mod columns;
mod detect;
pub(super) mod lines;
pub(super) mod number;
mod parse;
mod sample;
mod split;

use std::{
    fs::File,
    io::{Seek, SeekFrom},
    path::{Path, PathBuf},
};

use rayon::prelude::*;

use self::{
    detect::{Detected, detect},
    lines::{ChunkError, LineChunks},
    parse::{Parsed, parse},
};
use super::{
    Block, CoordinateKind, InputInfo, PointReader, ReadReport,
    ahead::{batch_parts, run_ahead},
    gather::Tally,
};
use crate::error::{Error, Result};

/// Opens a text file: tells its delimiter and columns from its beginning and samples further on.
///
/// `columns` names the columns, as in `x,y,z,intensity,r,g,b,nx,ny,nz,-`: `-` skips one, columns
/// after the last named are skipped too, a name without a meaning of its own becomes an attribute.
///
/// # Errors
/// [`Error::Io`] where the file cannot be read, [`Error::Input`] where it is no text with points or
/// does not have the columns named.
pub fn open(path: &Path, columns: Option<&str>) -> Result<Box<dyn PointReader>> {
    let detected = detect(path, columns)?;
    let info = InputInfo {
        path: path.display().to_string(),
        points: detected.announced,
        coordinates: CoordinateKind::Float { decimals: None, single_precision: false },
        attributes: detected.plan.attributes.clone(),
        crs: None,
        left_out: detected.notes.clone(),
    };
    Ok(Box::new(TextReader { path: path.to_owned(), detected, info }))
}

struct TextReader {
    path: PathBuf,
    detected: Detected,
    info: InputInfo,
}

/// Sums over what was read.
#[derive(Debug, Default)]
struct Total {
    tally: Tally,
    bad_lines: u64,
    first_bad: Option<(u64, String)>,
    announced: u64,
}

impl PointReader for TextReader {
    fn info(&self) -> &InputInfo {
        &self.info
    }

    fn read(self: Box<Self>, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<ReadReport> {
        let Detected { plan, terminator, start: (offset, line), announced, .. } = &self.detected;
        let mut file = File::open(&self.path).map_err(Error::io(&self.path, "cannot open"))?;
        file.seek(SeekFrom::Start(*offset)).map_err(Error::io(&self.path, "cannot read"))?;
        let mut source = LineChunks::new(file, *terminator, *line);
        let mut total = Total { announced: announced.unwrap_or(0), ..Total::default() };
        run_ahead(
            || {
                let mut chunks = Vec::new();
                while chunks.len() < batch_parts()
                    && let Some(chunk) =
                        source.next_chunk().map_err(|error| self.chunk_error(error))?
                {
                    chunks.push(chunk);
                }
                let parts: Vec<Parsed> =
                    chunks.into_par_iter().map(|c| parse(plan, &c, *terminator)).collect();
                Ok((!parts.is_empty()).then_some(parts))
            },
            |parts| {
                for part in parts {
                    total.tally.add(part.tally);
                    total.bad_lines += part.bad_lines;
                    total.announced = total.announced.saturating_add(part.announced);
                    total.first_bad = total.first_bad.take().or(part.first_bad);
                    part.blocks.into_iter().try_for_each(&mut *sink)?;
                }
                Ok(())
            },
        )?;
        self.report(total)
    }
}

impl TextReader {
    fn report(&self, total: Total) -> Result<ReadReport> {
        let wrong = |message| Err(Error::input(self.info.path.clone(), message));
        let mut report = total.tally.report(true);
        report.points_read += total.bad_lines;
        if let Some((line, text)) = total.first_bad {
            if total.tally.points < total.bad_lines {
                return wrong(format!(
                    "not a point cloud: {} of its {} lines hold no point of {} columns (the first: \
                     line {line}: {text})",
                    total.bad_lines,
                    report.points_read,
                    self.detected.plan.columns.len()
                ));
            }
            report.dropped.push((
                format!("line is not a point (the first: line {line}: {text})"),
                total.bad_lines,
            ));
        }
        if self.detected.announced.is_some() && total.announced != report.points_read {
            let found = report.points_read;
            if total.announced > found {
                return wrong(format!(
                    "the count line announces {} points, but only {found} follow: the file is cut \
                     short (or correct the count)",
                    total.announced
                ));
            }
            report.warnings.push(format!(
                "the count line announces {} points, {found} follow; all were read",
                total.announced
            ));
        }
        Ok(report)
    }

    fn chunk_error(&self, error: ChunkError) -> Error {
        match error {
            ChunkError::Io(error) => Error::io(&self.path, "cannot read")(error),
            ChunkError::EndlessLine(line) => Error::input(
                self.info.path.clone(),
                format!("line {line} does not end: not a text point cloud, or damaged"),
            ),
        }
    }
}

#[cfg(test)]
mod tests;
