//! Readers: one file per format, all of one shape.
//!
//! A reader is opened on an input, tells what it will deliver ([`InputInfo`]), then streams every
//! point in blocks. Coordinates come in the source's own numbers (integers where it has them), so
//! that nothing is rounded before the lattice is known. Adding a format means adding a file and a
//! line where inputs are opened (`inputs.rs`).

mod ahead;
mod color;
mod gather;
pub mod las;
mod names;
pub mod ply;
pub mod sim;
mod slot;
#[cfg(test)]
pub(crate) mod testing;
pub mod text;

use lodestream_protocol::ScalarType;

use crate::error::Result;

/// One attribute that a reader delivers with each point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputAttribute {
    /// Name, as in [`lodestream_protocol::Attribute::name`].
    pub name: String,
    /// Type of each component.
    pub scalar: ScalarType,
    /// Components per value.
    pub components: u8,
}

/// How a reader's coordinates are to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CoordinateKind {
    /// Integers: `world = integer * scale + offset` per axis (LAS).
    Scaled {
        /// World units per integer step.
        scale: [f64; 3],
        /// World coordinate of integer zero.
        offset: [f64; 3],
    },
    /// Floating point numbers.
    Float {
        /// Decimal places after the point that every coordinate is known to have at most (text
        /// formats, simulated scans), so that a decimal lattice holds them exactly.
        decimals: Option<u8>,
        /// Stored as binary32: digits beyond its precision carry nothing.
        single_precision: bool,
    },
}

/// What an opened input will deliver.
#[derive(Debug, Clone, PartialEq)]
pub struct InputInfo {
    /// The input, as the user named it.
    pub path: String,
    /// Points announced by the file; `None` where the format does not say.
    pub points: Option<u64>,
    /// How coordinates are to be understood. For text formats `decimals` is only known when
    /// reading has ended: [`ReadReport::decimals`] overrides it.
    pub coordinates: CoordinateKind,
    /// Attributes of each point, in the order of their bytes in [`Block::attributes`].
    pub attributes: Vec<InputAttribute>,
    /// Coordinate reference system (WKT), where the file tells.
    pub crs: Option<String>,
    /// What will not be kept, one line each (`extra bytes "foo": type 0 (undocumented)`).
    pub left_out: Vec<String>,
}

/// Coordinates of a block of points.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// For [`CoordinateKind::Scaled`].
    Scaled(Vec<[i32; 3]>),
    /// For [`CoordinateKind::Float`].
    Float(Vec<[f64; 3]>),
}

impl Positions {
    /// Points in the block.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Scaled(v) => v.len(),
            Self::Float(v) => v.len(),
        }
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// At most [`BLOCK_POINTS`] points.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// Coordinates. Points with NaN or infinite coordinates never get here: readers drop and count
    /// them.
    pub positions: Positions,
    /// One row per point: the attributes' values, little-endian, in order, without padding.
    pub attributes: Vec<u8>,
}

/// Most points in a [`Block`].
pub const BLOCK_POINTS: usize = 1 << 16;

/// What a reader did, once it has ended.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReadReport {
    /// Points in the file.
    pub points_read: u64,
    /// Points not delivered, by reason (`coordinate is NaN or infinite`).
    pub dropped: Vec<(String, u64)>,
    /// Decimal places that every coordinate is found to have at most, where that is known.
    pub decimals: Option<u8>,
    /// One line each for what a user should know of (`header says 10 points, 8 follow`).
    pub warnings: Vec<String>,
}

/// An opened input.
pub trait PointReader: Send {
    /// What the input will deliver.
    fn info(&self) -> &InputInfo;

    /// Streams every point in file order; stops at the first error of `sink`.
    ///
    /// Readers decode in parallel where the format allows (rayon's current pool), but call `sink`
    /// from the calling thread only, in order. Never holds more than a few blocks a thread.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) for a file that lies or breaks off; what `sink` returns.
    fn read(self: Box<Self>, sink: &mut dyn FnMut(Block) -> Result<()>) -> Result<ReadReport>;
}
