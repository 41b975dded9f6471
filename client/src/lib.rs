//! The client: sources, the streaming engine, renderers, and the commands of `lodestream`.

pub mod camera;
pub mod commands;
pub mod doctor;
pub mod engine;
pub mod eval;
mod full_resolution;
mod interrupt;
pub mod load;
pub mod metrics;
pub mod path;
pub mod render;
pub mod report;
pub mod source;
pub mod stability;
pub mod viewer;
