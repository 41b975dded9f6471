//! lodestream.
fn main() {}
