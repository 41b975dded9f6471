//! lodestream: client.

pub mod camera;
pub mod render;
pub mod source;
