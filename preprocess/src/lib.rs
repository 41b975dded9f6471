//! lodestream: preprocess.
