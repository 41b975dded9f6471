//! A path as pictures: one after the other, each when it is complete.

use std::path::{Path, PathBuf};

use crate::{camera::Camera, path::CameraPath};

/// Most pictures.
pub const MOST_FRAMES: u32 = 100_000;

/// An export under way.
#[derive(Debug, Clone)]
pub struct Export {
    path: CameraPath,
    folder: PathBuf,
    times: Vec<f64>,
    next: usize,
}

impl Export {
    /// Of `frames` pictures, evenly spread, into a folder, which is made.
    ///
    /// # Errors
    /// What is wrong, for people.
    pub fn start(path: &CameraPath, folder: &Path, frames: u32) -> Result<Self, String> {
        if !(1..=MOST_FRAMES).contains(&frames) {
            return Err(format!("{frames} pictures: ask for 1 to {MOST_FRAMES}"));
        }
        std::fs::create_dir_all(folder)
            .map_err(|e| format!("{}: cannot make the folder: {e}", folder.display()))?;
        let times = path.times(frames).collect();
        Ok(Self { path: path.clone(), folder: folder.to_owned(), times, next: 0 })
    }

    /// Where the next picture is taken from, and its file; `None` when all are done.
    #[must_use]
    pub fn next(&self) -> Option<(Camera, PathBuf)> {
        let time = self.times.get(self.next)?;
        let digits = (self.times.len() - 1).to_string().len().max(4);
        let name = format!("frame_{:0digits$}.png", self.next);
        Some((self.path.at(*time), self.folder.join(name)))
    }

    /// The picture was written.
    pub fn done(&mut self) {
        self.next += 1;
    }

    /// Pictures written, and all.
    #[must_use]
    pub fn progress(&self) -> (usize, usize) {
        (self.next, self.times.len())
    }

    /// Where they go.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::path::{KeyFrame, Lens};

    #[test]
    fn an_export_goes_from_one_end_of_the_path_to_the_other() {
        let key = |time: f64| KeyFrame {
            time,
            position: DVec3::new(time, 0.0, 9.0),
            target: DVec3::ZERO,
            up: DVec3::Z,
            lens: Lens::FovYDegrees(50.0),
            jump: false,
        };
        let path = CameraPath::new(vec![key(0.0), key(4.0)], false).expect("a path");
        let folder = tempfile::tempdir().expect("temporary folder");
        let into = folder.path().join("a/b");
        let mut export = Export::start(&path, &into, 3).expect("possible");
        let mut seen = Vec::new();
        while let Some((camera, file)) = export.next() {
            seen.push((camera.eye.x, file.file_name().expect("a name").to_owned()));
            export.done();
        }
        assert_eq!(seen[0], (0.0, "frame_0000.png".into()));
        assert_eq!((seen[2].0, seen.len(), export.progress()), (4.0, 3, (3, 3)));
        assert!(into.is_dir());
        assert!(Export::start(&path, &into, 0).is_err());
        let file = folder.path().join("file");
        std::fs::write(&file, "").expect("written");
        assert!(Export::start(&path, &file.join("x"), 2).is_err_and(|e| e.contains("folder")));
    }
}
