//! What the end-to-end tests and the benches share.

mod interpreter;
mod measure;
mod program;

pub use interpreter::python_environment;
pub use measure::{Options, median};
pub use program::program;
