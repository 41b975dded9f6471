//! Scans in, one dataset file out.
//!
//! [`build()`] reads every input once, puts its points on one integer lattice, and writes a nested
//! octree with levels of detail; [`verify()`] proves that a dataset is what it should be.

mod assemble;
mod blobs;
mod build;
mod chunk;
mod cones;
mod distribute;
mod encode;
mod error;
mod file;
mod grid;
mod inputs;
mod lod;
mod memory;
mod numbers;
pub mod numerics;
mod plan;
mod positioned;
pub mod preview;
pub mod readers;
mod repack;
mod schedule;
mod schema;
pub mod sim;
mod sort;
mod store;
mod target;
mod tree;
mod verify;
pub mod writers;

pub use build::{
    BuildConfig, BuildReport, CELLS_PER_SPACING, ColumnBytes, Dropped, Method, PhaseSeconds,
    Progress, build,
};
pub use error::{Error, Result};
pub use file::FileSource;
pub use repack::{with_foreign_payloads, with_whole_positions};
pub use verify::{Comparison, MAX_FINDINGS, VerifyConfig, VerifyReport, verify};
