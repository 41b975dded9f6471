//! What the end-to-end tests and the benches share.

mod measure;
mod program;

pub use measure::{Options, median};
pub use program::program;
