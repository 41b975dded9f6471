//! Generators: paths for any cloud's extent, each named by one line such as
//! `orbit?seconds=20&turns=2`.
//!
//! Each makes key frames, so that its path can be written to a file and looked at. The same line
//! and the same extent make the same numbers on every machine: all randomness comes from `seed`,
//! and sines and logarithms from `libm`. A cloud that is flat, thin as a needle or a single point
//! is walked around as if it had a twentieth of its size in the other directions, too.

mod extent;
mod flythrough;
mod options;
mod orbit;
mod random;
mod random_walk;
mod spec;
mod teleport;
mod zoom;

#[cfg(test)]
mod tests;

pub use extent::Extent;
pub use spec::{GENERATORS, PathSpec};
