//! What to build.

use std::{
    path::PathBuf,
    sync::{Arc, atomic::AtomicBool},
};

use crate::error::{Error, Result};

/// How levels of detail are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Poisson-disk subsampling into a nested octree (Radner 2018, 3.1.1 and 5.1).
    #[default]
    Poisson,
}

impl Method {
    /// The name on the command line and in the manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Poisson => "poisson",
        }
    }
}

/// What to build.
#[derive(Debug, Clone)]
pub struct BuildConfig {
    /// Files, folders, or simulated scans (`sim:courtyard?points=2M&seed=1`).
    pub inputs: Vec<String>,
    /// The dataset file.
    pub output: PathBuf,
    /// How levels of detail are made.
    pub method: Method,
    /// Grid cells per node side: a power of two, 4 to 1024.
    pub grid: u32,
    /// Memory the build may take, in bytes.
    pub memory_bytes: u64,
    /// Threads; `None`: as many as the machine has.
    pub threads: Option<usize>,
    /// Names of attributes to leave out.
    pub drop_attributes: Vec<String>,
    /// What the columns of text inputs are; `None`: detected.
    pub columns: Option<String>,
    /// Lattice step in world units; `None`: the inputs' own, or far below the point spacing.
    pub scale: Option<f64>,
    /// Positions are stored in two parts: cells of this part of a node's spacing, and where in its cell
    /// each point lies; and colours in their first bits and the rest. A power of two up to 256; 0: all in one part.
    pub cells_per_spacing: u32,
    /// Set to stop the build.
    pub cancel: Arc<AtomicBool>,
}

/// For [`BuildConfig::cells_per_spacing`]. On Autzen (960 x 540, a million points, 20 Mbit/s and 40 ms; positions
/// exact where cells would take up half a pixel), from a cold start:
///
/// | cells | bytes of cells a point | SSIM 0.95 in the medium view after | SSIM of the near view, bytes |
/// | --- | --- | --- | --- |
/// | 1 | 0.94 | 1.15 s, 2.58 MB | 0.840, 4.23 MB |
/// | 2 | 1.31 | 0.95 s, 2.05 MB | 0.839, 3.57 MB |
/// | 4 | 1.69 | 0.85 s, 1.79 MB | 0.858, 3.50 MB |
/// | 8 | 2.06 | 0.85 s, 1.85 MB | 0.871, 3.63 MB |
/// | whole | 3.29 | 1.20 s | 0.885, 5.05 MB |
pub const CELLS_PER_SPACING: u32 = 8;

impl BuildConfig {
    /// Refuses numbers that mean nothing.
    pub(super) fn check(&self) -> Result<()> {
        if !(4..=1024).contains(&self.grid) || !self.grid.is_power_of_two() {
            return Err(Error::Setup(format!(
                "--grid {}: must be a power of two from 4 to 1024",
                self.grid
            )));
        }
        let cells = self.cells_per_spacing;
        if cells > 256 || (cells > 0 && !cells.is_power_of_two()) {
            return Err(Error::Setup(format!(
                "--cells {cells}: must be 0 or a power of two up to 256"
            )));
        }
        if self.scale.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(Error::Setup("--scale must be a finite number above zero".into()));
        }
        Ok(())
    }
}
