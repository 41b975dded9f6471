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
    /// Set to stop the build.
    pub cancel: Arc<AtomicBool>,
}

impl BuildConfig {
    /// Refuses numbers that mean nothing.
    pub(super) fn check(&self) -> Result<()> {
        if !(4..=1024).contains(&self.grid) || !self.grid.is_power_of_two() {
            return Err(Error::Setup(format!(
                "--grid {}: must be a power of two from 4 to 1024",
                self.grid
            )));
        }
        if self.scale.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
            return Err(Error::Setup("--scale must be a finite number above zero".into()));
        }
        Ok(())
    }
}
