//! A path as a command line names it.

use std::path::Path;

use super::{CameraPath, Extent, GENERATORS, PathError, PathSpec};

/// Where a path comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum PathSource {
    /// A file that has been read.
    File(CameraPath),
    /// A generator that waits for the extent of a cloud.
    Generator(PathSpec),
}

impl PathSource {
    /// Reads a path file, or a line that names a generator, such as `orbit?seconds=20`. A file that
    /// is called like a generator is named with its folder: `./orbit`.
    ///
    /// # Errors
    /// [`PathError`] where it is neither.
    pub fn open(text: &str) -> Result<Self, PathError> {
        let name = text.split_once('?').map_or(text, |(name, _)| name);
        if GENERATORS.contains(&name) {
            return PathSpec::parse(text).map(Self::Generator);
        }
        let path = Path::new(text);
        if !path.exists() {
            let names = GENERATORS.join(", ");
            let why = format!("no such file, and no such generator; there are {names}");
            return Err(PathError::File { path: path.to_owned(), why });
        }
        CameraPath::read(path).map(Self::File)
    }

    /// The path: the file's as it is, a generator's for `extent`.
    ///
    /// # Errors
    /// [`PathError`] where the generator cannot make one for such an extent.
    pub fn path(self, extent: &Extent) -> Result<CameraPath, PathError> {
        match self {
            Self::File(path) => Ok(path),
            Self::Generator(spec) => spec.path(extent),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_generators_are_told_apart() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let file = folder.path().join("orbit");
        let extent = Extent::new([0.0; 3], [1.0; 3]).expect("an extent");
        let orbit = PathSource::open("orbit?seconds=3").expect("a generator").path(&extent);
        let orbit = orbit.expect("a path");
        orbit.write(&file).expect("written");
        let read = PathSource::open(&file.display().to_string()).expect("a file");
        assert_eq!(read.path(&extent).expect("as it is"), orbit);
        for text in ["no-such.json", "orbitt?seconds=3"] {
            let said = PathSource::open(text).expect_err(text).to_string();
            assert!(said.contains(text) && said.contains("random-walk"), "{said}");
        }
        assert!(PathSource::open("orbit?second=3").is_err());
    }
}
