//! lodestream: shaders.
