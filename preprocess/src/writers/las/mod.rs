//! LAS and LAZ files.
//!
//! The point format is the smallest that has a field for every attribute that can be in one; the
//! rest goes into described extra bytes, so that reading the file gives all values again. What does
//! not come back the same: fields that the format has and the dataset lacks are zeros; colours of
//! 8 bits are written times 257 in 16 bits, as the specification asks (colours that have 16 bits
//! already are written as they are, even where only 0 to 255 occur); names beyond 32 bytes are cut.
//! Scale and offset are those of the dataset's lattice, so that coordinates are the same to the
//! bit; where its integers do not fit the 32 bits that LAS has, the offset is moved by whole steps.

mod extra_bytes;
mod header;
mod plan;
mod records;

use std::{
    io::{self, Seek as _, SeekFrom, Write as _},
    path::{Path, PathBuf},
};

use laz::{LasZipError, ParLasZipCompressor};

use self::{
    header::{Front, Grid},
    plan::Plan,
    records::{Tally, append},
};
use super::{ExportBlock, ExportInfo, PointWriter};
use crate::{
    error::{Error, Result},
    target::Target,
};

/// Records that are gathered before they are written, bytes.
const GATHERED_BYTES: usize = 4 << 20;

/// Creates the file.
pub(super) fn create(
    path: &Path,
    info: ExportInfo,
    compressed: bool,
) -> Result<Box<dyn PointWriter>> {
    let mut plan = Plan::new(&info.attributes)?;
    let mut notes = std::mem::take(&mut plan.notes);
    let grid = Grid::new(&info);
    let front = Front::new(&plan, &info, grid, compressed, &mut notes)?;
    let failed = Error::io(path, "cannot write");
    let mut target = Target::create(path)?;
    // Room for the header, which is known at the end.
    let room = vec![0; front.bytes(&Tally::EMPTY)?.len()];
    target.write_all(&room).map_err(failed)?;
    let (output, gathered_bytes) = match &front.laz {
        Some(laz) => {
            // A thread compresses a whole chunk: as many as keep all of them busy.
            let chunk_bytes = laz.chunk_size() as usize * plan.record_bytes;
            let chunks = 2 * rayon::current_num_threads();
            let laz = ParLasZipCompressor::new(target, laz.clone())
                .map_err(|e| Error::io(path, "cannot compress")(laz_error(e)))?;
            (Output::Compressed(Box::new(laz)), chunks * chunk_bytes)
        }
        None => (Output::Plain(target), GATHERED_BYTES),
    };
    Ok(Box::new(LasWriter {
        path: path.to_owned(),
        info,
        plan,
        grid,
        front,
        output,
        records: Vec::new(),
        gathered_bytes,
        tally: Tally::EMPTY,
        notes,
    }))
}

struct LasWriter {
    path: PathBuf,
    info: ExportInfo,
    plan: Plan,
    grid: Grid,
    front: Front,
    output: Output,
    /// Records not yet written.
    records: Vec<u8>,
    gathered_bytes: usize,
    tally: Tally,
    notes: Vec<String>,
}

enum Output {
    Plain(Target),
    Compressed(Box<ParLasZipCompressor<Target>>),
}

impl PointWriter for LasWriter {
    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn write(&mut self, block: &ExportBlock) -> Result<()> {
        let Self { plan, info, grid, records, .. } = self;
        let tally = append(plan, &info.attributes, grid.shift, block, records)?;
        self.tally.merge(&tally);
        if self.records.len() >= self.gathered_bytes {
            self.pass_on()?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.pass_on()?;
        let failed = |e| Error::io(&self.path, "cannot write")(e);
        let mut target = match self.output {
            Output::Plain(target) => target,
            Output::Compressed(mut laz) => {
                laz.done().map_err(|e| failed(laz_error(e)))?;
                laz.into_inner()
            }
        };
        let front = self.front.bytes(&self.tally)?;
        target.seek(SeekFrom::Start(0)).map_err(failed)?;
        target.write_all(&front).map_err(failed)?;
        target.finish()
    }
}

impl LasWriter {
    fn pass_on(&mut self) -> Result<()> {
        let passed = match &mut self.output {
            Output::Plain(target) => target.write_all(&self.records),
            Output::Compressed(_) if self.records.is_empty() => Ok(()),
            Output::Compressed(laz) => laz.compress_many(&self.records),
        };
        self.records.clear();
        passed.map_err(Error::io(&self.path, "cannot write"))
    }
}

fn laz_error(error: LasZipError) -> io::Error {
    match error {
        LasZipError::IoError(e) => e,
        other => io::Error::other(other.to_string()),
    }
}
