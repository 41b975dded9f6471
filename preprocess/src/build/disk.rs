//! Whether there is room for what is to be built.

use std::path::Path;

use super::Job;
use crate::{
    error::{Error, Result},
    inputs::OpenedInput,
    readers::CoordinateKind,
    schema::Schema,
};

/// Refuses before any work what cannot be written at its end.
pub(super) fn check_output(output: &Path, folder: &Path) -> Result<()> {
    if output.is_dir() {
        return Err(Error::Setup(format!(
            "{}: is a folder; name a file, as in {}",
            output.display(),
            output.join("NAME.lods").display()
        )));
    }
    tempfile::tempfile_in(folder).map_err(Error::io(folder, "cannot create files here"))?;
    Ok(())
}

/// Refuses before any work what the disk surely has no room for: the temporary files, where the points
/// do not fit the memory, and a quarter of the raw points as the dataset.
pub(super) fn check_disk(opened: &[OpenedInput], job: &Job) -> Result<()> {
    let (mut raw, mut on_lattice) = (0u64, 0u64);
    for info in opened.iter().map(|input| &input.info) {
        let attributes = std::iter::once(&info.attributes[..]);
        let row = Schema::union(attributes, &job.config.drop_attributes).row_bytes as u64;
        let position = match info.coordinates {
            CoordinateKind::Scaled { .. } => 12,
            CoordinateKind::Float { .. } => 24,
        };
        let points = info.points.unwrap_or(0);
        raw = raw.saturating_add(points.saturating_mul(position + row));
        on_lattice = on_lattice.saturating_add(points.saturating_mul(12 + row));
    }
    let fits_memory = raw <= job.config.memory_bytes / 2;
    let temporary = if fits_memory { 0 } else { raw.saturating_add(on_lattice) };
    let needed = temporary.saturating_add(on_lattice / 4);
    // Where the system does not tell, the build finds out.
    let Ok(free) = fs4::available_space(job.folder) else { return Ok(()) };
    if free < needed {
        let memory = if fits_memory { "" } else { " or raise --memory" };
        return Err(Error::Setup(format!(
            "{}: the build needs about {} MiB of disk, {} MiB are free; choose another place for the \
             output{memory}",
            job.folder.display(),
            needed >> 20,
            free >> 20
        )));
    }
    Ok(())
}
