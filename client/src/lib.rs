//! lodestream: client.
