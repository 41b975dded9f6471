//! The first phase: every input is read once, into the store.

use super::{Job, report::Dropped};
use crate::{
    error::{Error, Result},
    inputs::{self, OpenedInput},
    readers::CoordinateKind,
    schema::{RowMap, Schema},
    store::{RawBlock, StoreWriter},
};

/// What reading found.
pub(super) struct Read {
    pub(super) schema: Schema,
    pub(super) writer: StoreWriter,
    pub(super) kinds: Vec<CoordinateKind>,
    pub(super) names: Vec<String>,
    pub(super) crs: Option<String>,
    pub(super) points_read: u64,
    pub(super) dropped: Vec<Dropped>,
}

/// Reads all inputs.
///
/// # Errors
/// What is wrong with an input or the disk; [`Error::Setup`] where no point is left.
pub(super) fn read(
    job: &Job,
    opened: Vec<OpenedInput>,
    warnings: &mut Vec<String>,
) -> Result<Read> {
    let dropped = &job.config.drop_attributes;
    let schema = Schema::union(opened.iter().map(|i| &i.info.attributes[..]), dropped);
    for name in dropped {
        if !opened.iter().any(|i| i.info.attributes.iter().any(|a| a.name == *name)) {
            return Err(Error::Setup(format!("--drop {name}: no input has this attribute")));
        }
    }
    let mut read = Read {
        writer: StoreWriter::new(opened.len(), job.config.memory_bytes / 2, job.folder),
        kinds: Vec::new(),
        names: Vec::new(),
        crs: None,
        points_read: 0,
        dropped: Vec::new(),
        schema,
    };
    for (index, input) in opened.into_iter().enumerate() {
        let info = input.info;
        for attribute in &read.schema.attributes {
            if !info.attributes.iter().any(|a| a.name == attribute.name) {
                let name = &attribute.name;
                warnings.push(format!("{}: has no {name}; stored as zero", info.path));
            }
        }
        match (&read.crs, &info.crs) {
            (None, Some(crs)) => read.crs = Some(crs.clone()),
            (Some(known), Some(crs)) if known != crs => warnings.push(format!(
                "{}: its coordinate reference system differs from that of the inputs before; \
                 coordinates are taken as they are",
                info.path
            )),
            _ => {}
        }
        let map = RowMap::new(&info.attributes, &read.schema);
        let (schema, writer) = (&read.schema, &mut read.writer);
        let report = input.reader.read(&mut |block| {
            job.check()?;
            let count = block.positions.len();
            let rows = map.apply(block.attributes, count, schema);
            writer.push(RawBlock { input: index as u32, positions: block.positions, rows })?;
            job.progress.advance(count as u64);
            Ok(())
        })?;
        read.points_read += report.points_read;
        for (reason, points) in report.dropped {
            read.dropped.push(Dropped { reason: format!("{}: {reason}", info.path), points });
        }
        warnings.extend(report.warnings.iter().map(|line| format!("{}: {line}", info.path)));
        read.kinds.push(match info.coordinates {
            CoordinateKind::Float { single_precision, decimals } => {
                CoordinateKind::Float { decimals: report.decimals.or(decimals), single_precision }
            }
            scaled => scaled,
        });
        read.names.push(inputs::display_name(&info.path));
    }
    read.refuse_nothing()?;
    Ok(read)
}

impl Read {
    /// Points that were kept.
    pub(super) fn points(&self) -> u64 {
        self.writer.points.iter().sum()
    }

    fn refuse_nothing(&self) -> Result<()> {
        if self.points() > 0 {
            return Ok(());
        }
        let dropped: u64 = self.dropped.iter().map(|d| d.points).sum();
        let reasons: Vec<&str> = self.dropped.iter().map(|d| d.reason.as_str()).collect();
        Err(Error::Setup(match dropped {
            0 => format!("{}: no points, so there is nothing to build", self.names.join(", ")),
            _ => format!("all {dropped} points are unusable: {}", reasons.join("; ")),
        }))
    }
}
