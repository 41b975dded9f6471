//! lodestream: server.
