//! Camera paths: where a camera is at which time, as all tools share it.
//!
//! A path is key frames, read from and written to JSON (`PATHS.md` beside `FORMAT.md` specifies it)
//! or made for a cloud's extent by a generator that one line names, such as `orbit?seconds=20`.
//! Between the keys the camera moves smoothly, passes through each key at its time, and is at every
//! instant one that can be looked through ([`Camera::check`](crate::camera::Camera::check)).
//!
//! - `key.rs`: a key frame, and what makes it possible;
//! - `camera_path.rs`: the keys of a path, and the camera at a time;
//! - `spline.rs`: the curves between keys;
//! - `file.rs`: JSON;
//! - `generate/`: the generators, and the line that names one;
//! - `source.rs`: a file or a generator, as a command line names it.

mod camera_path;
mod error;
mod file;
mod generate;
mod key;
mod source;
mod spline;

#[cfg(test)]
mod tests;

#[cfg(test)]
pub(crate) use generate::Random;

pub use camera_path::{CameraPath, MAX_KEYS};
pub use error::PathError;
pub use file::{FORMAT, VERSION};
pub use generate::{Extent, GENERATORS, PathSpec};
pub use key::{KeyFrame, LARGEST_COORDINATE, LARGEST_TIME, Lens, SHORTEST_STEP};
pub use source::PathSource;
