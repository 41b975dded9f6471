//! The file being written: under a name of its own until it is complete.

use std::{
    fs::File,
    io::{self, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use tempfile::TempPath;

use crate::error::{Error, Result};

/// A file beside its final place, under a name that no server takes for a dataset; removed when it is
/// dropped before [`Target::finish`], which is when an error or an interrupt ends the writing.
#[derive(Debug)]
pub struct Target {
    file: BufWriter<File>,
    place: TempPath,
    path: PathBuf,
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

impl Target {
    /// Creates the file in the folder of `path`.
    pub fn create(path: &Path) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        builder.prefix(".lodestream-").suffix(".part");
        // Temporary files are private by default; this one becomes the user's.
        #[cfg(unix)]
        let builder = builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file =
            builder.tempfile_in(folder_of(path)).map_err(Error::io(path, "cannot create"))?;
        // Apart, as errors of the pair would name the temporary file.
        let (file, place) = file.into_parts();
        let file = BufWriter::with_capacity(1 << 20, file);
        Ok(Self { file, place, path: path.to_owned() })
    }

    /// Replaces what lies at `path`, when everything is on the disk.
    pub fn finish(self) -> Result<()> {
        let Self { file, place, path } = self;
        let failed = |e| Error::io(&path, "cannot write")(e);
        let file = file.into_inner().map_err(|e| failed(e.into_error()))?;
        file.sync_all().map_err(failed)?;
        place.persist(&path).map_err(|e| failed(e.error))?;
        // The rename itself must survive a power cut; not every system lets folders be opened.
        if let Ok(folder) = File::open(folder_of(&path)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Write for Target {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Target {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_shows_when_it_is_complete_and_is_as_readable_as_any_new_one() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("whole");
        let names = || std::fs::read_dir(folder.path()).expect("listed").count();
        drop(Target::create(&path).expect("created"));
        assert_eq!(names(), 0, "what is given up is removed");
        let mut target = Target::create(&path).expect("created");
        target.write_all(b"all of it").expect("written");
        assert!(!path.exists());
        target.finish().expect("renamed");
        assert_eq!((names(), std::fs::read(&path).expect("there")), (1, b"all of it".to_vec()));
        let any = folder.path().join("any");
        std::fs::write(&any, b"").expect("written");
        let permissions = |path: &Path| std::fs::metadata(path).expect("there").permissions();
        assert_eq!(permissions(&path), permissions(&any));
    }
}
