//! lodestream: end-to-end tests.
