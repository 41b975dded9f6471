//! lodestream: client.

pub mod camera;
pub mod engine;
pub mod render;
pub mod source;
