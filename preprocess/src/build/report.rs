//! What was built.

use std::path::PathBuf;

use lodestream_protocol::Manifest;
use serde::Serialize;

use crate::encode::Ranges;

/// What was built. Also the `--report` of `lodestream build`.
#[derive(Debug, Clone, Serialize)]
pub struct BuildReport {
    /// The dataset file.
    pub output: PathBuf,
    /// Points in the inputs.
    pub points_read: u64,
    /// Points in the dataset.
    pub points_written: u64,
    /// Points left out, by reason.
    pub dropped: Vec<Dropped>,
    /// Largest distance on any axis between a source coordinate and its lattice point, world units.
    pub largest_coordinate_error: f64,
    /// World units per lattice unit.
    pub scale: f64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Levels in the tree.
    pub levels: u8,
    /// Chunks built in core.
    pub chunks: u64,
    /// Whether the points went through temporary files.
    pub spilled: bool,
    /// Seconds per phase, in order.
    pub seconds: Vec<PhaseSeconds>,
    /// Seconds in all.
    pub total_seconds: f64,
    /// Most memory the process has held, in bytes, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// Length of the dataset file.
    pub file_bytes: u64,
    /// Header, manifest and hierarchy.
    pub index_bytes: u64,
    /// Encoded bytes per column; constants take none.
    pub columns: Vec<ColumnBytes>,
    /// What a user should know of, one line each.
    pub warnings: Vec<String>,
}

/// Points left out of the dataset for one reason.
#[derive(Debug, Clone, Serialize)]
pub struct Dropped {
    /// Input and reason.
    pub reason: String,
    /// How many.
    pub points: u64,
}

/// Time spent in a phase.
#[derive(Debug, Clone, Serialize)]
pub struct PhaseSeconds {
    /// Phase.
    pub phase: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Size of a column.
#[derive(Debug, Clone, Serialize)]
pub struct ColumnBytes {
    /// Attribute, or `position`.
    pub name: String,
    /// Encoded bytes over all nodes.
    pub bytes: u64,
    /// Encoded bytes per point of the dataset.
    pub bytes_per_point: f64,
}

impl ColumnBytes {
    /// Of the positions, of every attribute, then of fine positions and colours.
    pub(super) fn of(manifest: &Manifest, ranges: &Ranges) -> Vec<Self> {
        let names = manifest.attributes.iter().map(|attribute| attribute.name.as_str());
        let columns = std::iter::once("position").chain(names).zip(&ranges.column_bytes);
        columns
            .chain(ranges.fine_columns(manifest.fine))
            .map(|(name, &bytes)| Self {
                name: name.into(),
                bytes,
                bytes_per_point: bytes as f64 / manifest.points.max(1) as f64,
            })
            .collect()
    }
}
