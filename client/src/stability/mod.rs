//! Numerical stability: every algorithm on stiff and extreme cases, beside a reference.
//!
//! `lodestream stability` prints the table, and a test per algorithm runs the same cases. What is
//! tried are the product's own functions, never copies. An error is measured against integers of 128
//! bits or floats of 512 (`exact.rs`), and beside it stand a tolerance with its reason, and the
//! errors of the usual shortcuts on the same case (`naive.rs`), so that one sees what the care buys.
//!
//! - `row.rs`: a line of the table;
//! - `clouds.rs`: the clouds; cameras, matrices and pictures stand with their algorithms;
//! - `algorithms/`: a file per algorithm, each a function from nothing to its rows;
//! - `table.rs`, `page.rs`: the table as CSV, JSON and text, and as a page.
//!
//! The cases hold no time, no thread and no random number without a seed: the errors are the same on
//! each run, to the last digit.

mod algorithms;
mod clouds;
mod dataset;
mod exact;
mod naive;
mod page;
mod row;
mod table;

pub use algorithms::{ALGORITHMS, Algorithm};
pub use page::page;
pub use row::{Naive, Row};
pub use table::Table;

/// Why a case could not be tried at all.
#[derive(Debug, thiserror::Error)]
pub enum StabilityError {
    /// The name is that of no algorithm and of no case.
    #[error("no algorithm and no case is named {0:?}; the algorithms are: {1}")]
    Unknown(String, String),
    /// A dataset could not be built.
    #[error("a case's dataset: {0}")]
    Build(#[from] lodestream_preprocess::Error),
    /// A dataset could not be read.
    #[error("a case's dataset: {0}")]
    Format(#[from] lodestream_protocol::Error),
    /// A picture could not be drawn.
    #[error("a case's picture: {0}")]
    Render(#[from] crate::render::RenderError),
    /// A file could not be written or read.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: std::path::PathBuf,
        /// What the system said.
        why: String,
    },
}

/// Runs all algorithms, or those whose name, or whose cases' names, contain `only`.
///
/// # Errors
/// [`StabilityError`], where a case cannot be tried at all or none is so named. An error beyond its
/// tolerance is a row that has not passed.
pub fn run(only: Option<&str>) -> Result<Table, StabilityError> {
    let mut rows = Vec::new();
    for algorithm in &ALGORITHMS {
        let found = algorithm.rows()?;
        let wanted = |row: &Row| {
            only.is_none_or(|only| algorithm.name.contains(only) || row.case.contains(only))
        };
        rows.extend(found.into_iter().filter(wanted));
    }
    match only {
        Some(only) if rows.is_empty() => {
            let names: Vec<_> = ALGORITHMS.iter().map(|algorithm| algorithm.name).collect();
            Err(StabilityError::Unknown(only.into(), names.join(", ")))
        }
        _ => Ok(Table { rows }),
    }
}
