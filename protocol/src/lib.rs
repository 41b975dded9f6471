//! lodestream: protocol.
