//! Scans in, one dataset file out.

mod error;
pub mod readers;

pub use error::{Error, Result};
