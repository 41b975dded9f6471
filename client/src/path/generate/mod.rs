//! Generators: paths for any cloud's extent, each named by one line such as
//! `orbit?seconds=20&turns=2`.
//!
//! Each makes key frames, so that its path can be written to a file and looked at. The same line
//! and the same extent make the same numbers on every machine: all randomness comes from `seed`,
//! and sines and logarithms from `libm`. Flat clouds, needles and single points have paths, too.

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

#[cfg(test)]
pub(crate) use random::Random;

pub use extent::Extent;
pub use spec::{GENERATORS, PathSpec};
