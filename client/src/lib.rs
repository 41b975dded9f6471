//! lodestream: client.

pub mod camera;
pub mod source;
