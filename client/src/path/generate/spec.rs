//! The line that names a generator: `orbit?seconds=20&turns=2`.

use glam::DVec3;

use super::{
    Extent, flythrough::Flythrough, options::Options, orbit::Orbit, random::Random,
    random_walk::RandomWalk, teleport::Teleport, zoom::Zoom,
};
use crate::path::{CameraPath, KeyFrame, Lens, PathError};

/// Names of the generators.
pub const GENERATORS: [&str; 5] = ["orbit", "flythrough", "zoom", "teleport", "random-walk"];

/// A generator and its options.
#[derive(Debug, Clone, PartialEq)]
pub struct PathSpec {
    /// As it was written; the path's name.
    text: String,
    common: Common,
    generator: Generator,
}

/// Options that all generators have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Common {
    /// From the first key to the last.
    pub seconds: f64,
    pub seed: u64,
    pub fov_y_degrees: f64,
}

#[derive(Debug, Clone, PartialEq)]
enum Generator {
    Orbit(Orbit),
    Flythrough(Flythrough),
    Zoom(Zoom),
    Teleport(Teleport),
    RandomWalk(RandomWalk),
}

/// The keys of a path to be, and whether it is a loop.
pub(super) struct Keys {
    pub keys: Vec<KeyFrame>,
    pub is_loop: bool,
}

impl PathSpec {
    /// Reads a line such as `orbit?seconds=20&turns=2`; `PATHS.md` has the options.
    ///
    /// # Errors
    /// [`PathError::Spec`] says which part is wrong and what would be right.
    pub fn parse(text: &str) -> Result<Self, PathError> {
        let (name, query) = text.split_once('?').unwrap_or((text, ""));
        let mut options = Options::split(name, query)?;
        let common = Common {
            seconds: options.number("seconds", 10.0, 1.0..=1e6)?,
            seed: options.count("seed", 0, 0..=u64::MAX)?,
            fov_y_degrees: options.number("fov", 50.0, 1.0..=150.0)?,
        };
        let options_of = &mut options;
        let generator = match name {
            "orbit" => Generator::Orbit(Orbit::read(options_of)?),
            "flythrough" => Generator::Flythrough(Flythrough::read(options_of)?),
            "zoom" => Generator::Zoom(Zoom::read(options_of)?),
            "teleport" => Generator::Teleport(Teleport::read(options_of)?),
            "random-walk" => Generator::RandomWalk(RandomWalk::read(options_of)?),
            _ => {
                let names = GENERATORS.join(", ");
                return Err(PathError::Spec(format!(
                    "there is no generator {name:?}; there are {names}"
                )));
            }
        };
        options.finish()?;
        Ok(Self { text: text.to_owned(), common, generator })
    }

    /// The path for a cloud of this extent, with the line as its name.
    ///
    /// # Errors
    /// [`PathError`] where no path can be made for such an extent.
    pub fn path(&self, extent: &Extent) -> Result<CameraPath, PathError> {
        let common = &self.common;
        let Keys { keys, is_loop } = match &self.generator {
            Generator::Orbit(orbit) => orbit.keys(common, extent),
            Generator::Flythrough(flythrough) => flythrough.keys(common, extent),
            Generator::Zoom(zoom) => zoom.keys(common, extent),
            Generator::Teleport(teleport) => teleport.keys(common, extent),
            Generator::RandomWalk(walk) => walk.keys(common, extent),
        };
        Ok(CameraPath::new(keys, is_loop)?.with_name(&*self.text))
    }
}

impl Common {
    /// Vertical field of view in radians.
    pub fn fov_y(&self) -> f64 {
        self.fov_y_degrees.to_radians()
    }

    /// Random numbers for a path that seed 0 leaves as it is: none then.
    pub fn variation(&self) -> Option<Random> {
        (self.seed != 0).then(|| Random::new(self.seed))
    }

    /// Step `step` of `steps`, in seconds.
    pub fn time(&self, step: usize, steps: usize) -> f64 {
        self.seconds * (step as f64 / steps as f64)
    }

    /// A key with the common field of view and +z up.
    pub fn key(&self, time: f64, position: DVec3, target: DVec3) -> KeyFrame {
        let lens = Lens::FovYDegrees(self.fov_y_degrees);
        KeyFrame { time, position, target, up: DVec3::Z, lens, jump: false }
    }
}
