//! Writers: points of a dataset into files that other programs read.
//!
//! All of one shape: a writer is created with what it will be given ([`ExportInfo`]), takes blocks
//! of points, and shows its file under the asked name only when it is finished. Coordinates come as
//! lattice integers, so that a format of integers (LAS) holds exactly the dataset's.

mod las;
mod ply;
mod source;

use std::path::Path;

use lodestream_protocol::{Attribute, Column, Lattice, LatticeBox};

use crate::error::{Error, Result};

/// What a writer will be given.
#[derive(Debug, Clone, PartialEq)]
pub struct ExportInfo {
    /// The lattice of all positions.
    pub lattice: Lattice,
    /// A box that holds all positions; they may fill less of it.
    pub bounds: LatticeBox,
    /// Most points that will come; there may be fewer.
    pub points: u64,
    /// Attributes: those of the manifest. Their `min` and `max`, where they are given, decide which
    /// fields of the format can hold them.
    pub attributes: Vec<Attribute>,
    /// Coordinate reference system (WKT), where it is known.
    pub crs: Option<String>,
}

/// Points to be written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ExportBlock {
    /// Lattice coordinates relative to the root cube's lowest corner.
    pub positions: Vec<[u32; 3]>,
    /// The values of [`ExportInfo::attributes`], by their index there; constant attributes need no
    /// column.
    pub columns: Vec<Column>,
}

/// A file being written.
pub trait PointWriter: Send {
    /// What a user should know of how the points are written, one line each.
    fn notes(&self) -> &[String];

    /// Appends points.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written; [`Error::Setup`] where a block contradicts
    /// the [`ExportInfo`].
    fn write(&mut self, block: &ExportBlock) -> Result<()>;

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// [`Error::Io`] where the file cannot be written; nothing is left behind then.
    fn finish(self: Box<Self>) -> Result<()>;
}

/// Creates a file whose format its ending tells: `.las`, `.laz` or `.ply`.
///
/// # Errors
/// [`Error::Setup`] for another ending or for points that the format cannot hold; [`Error::Io`]
/// where the file cannot be created.
pub fn create(path: &Path, info: ExportInfo) -> Result<Box<dyn PointWriter>> {
    let ending = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
    match ending.as_str() {
        "las" => las::create(path, info, false),
        "laz" => las::create(path, info, true),
        "ply" => ply::create(path, info),
        _ => Err(Error::Setup(format!(
            "{}: cannot tell the format to write; name a file that ends in .las, .laz or .ply",
            path.display()
        ))),
    }
}

#[cfg(test)]
mod tests;
