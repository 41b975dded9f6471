//! A dataset in a local file, read by position.
//!
//! Positioned reads need no cursor, so one open file serves any number of threads. A map of the
//! file would spare a copy, but a file that is cut short under a map ends the process.

use std::{fs::File, io, path::Path};

use lodestream_protocol::{Error as FormatError, ReadAt, Result as FormatResult};

use crate::error::{Error, Result};

/// A local file that answers byte ranges.
#[derive(Debug)]
pub struct FileSource {
    file: File,
}

impl FileSource {
    /// Opens a regular file.
    ///
    /// # Errors
    /// [`Error::Io`] where it cannot be opened, [`Error::Input`] where it is a folder or a device.
    pub fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::io(path, "cannot open"))?;
        let metadata = file.metadata().map_err(Error::io(path, "cannot look at"))?;
        if !metadata.is_file() {
            return Err(Error::input(path.display().to_string(), "not a file; name a .lods file"));
        }
        Ok(Self { file })
    }

    /// The file itself.
    #[must_use]
    pub const fn file(&self) -> &File {
        &self.file
    }

    /// Fills `buffer` from `offset` on, as far as the file reaches; returns the bytes read.
    ///
    /// # Errors
    /// What the system says.
    pub fn read_into(&self, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
        let mut filled = 0;
        while filled < buffer.len() {
            match read_some(&self.file, &mut buffer[filled..], offset + filled as u64) {
                Ok(0) => break,
                Ok(read) => filled += read,
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        Ok(filled)
    }
}

impl From<File> for FileSource {
    fn from(file: File) -> Self {
        Self { file }
    }
}

impl ReadAt for FileSource {
    fn read_at(&self, offset: u64, len: usize) -> FormatResult<Vec<u8>> {
        // Checked first, so that a length from a corrupt file is never allocated.
        let truncated = |available| FormatError::Truncated {
            what: "file",
            needed: offset.saturating_add(len as u64),
            available,
        };
        let size = self.size()?;
        if offset.checked_add(len as u64).is_none_or(|end| end > size) {
            return Err(truncated(size));
        }
        let mut bytes = vec![0; len];
        let read = self.read_into(&mut bytes, offset).map_err(|e| FormatError::Read {
            offset,
            len: len as u64,
            message: e.to_string(),
        })?;
        if read < len { Err(truncated(offset + read as u64)) } else { Ok(bytes) }
    }

    fn size(&self) -> FormatResult<u64> {
        let failed = |e: io::Error| FormatError::Read { offset: 0, len: 0, message: e.to_string() };
        Ok(self.file.metadata().map_err(failed)?.len())
    }
}

#[cfg(unix)]
fn read_some(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::unix::fs::FileExt::read_at(file, buffer, offset)
}

#[cfg(windows)]
fn read_some(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
    std::os::windows::fs::FileExt::seek_read(file, buffer, offset)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn source(bytes: &[u8]) -> FileSource {
        let mut file = tempfile::tempfile().expect("a temporary file");
        file.write_all(bytes).expect("writable");
        FileSource::from(file)
    }

    #[test]
    fn reads_exactly_the_bytes_asked_for() {
        let source = source(b"0123456789");
        assert_eq!(source.size(), Ok(10));
        assert_eq!(source.read_at(3, 4).as_deref(), Ok(&b"3456"[..]));
        assert_eq!(source.read_at(10, 0).as_deref(), Ok(&b""[..]));
    }

    #[test]
    fn a_range_beyond_the_end_is_truncated_and_never_allocated() {
        let source = source(b"0123456789");
        let truncated = |r: FormatResult<Vec<u8>>| matches!(r, Err(FormatError::Truncated { .. }));
        assert!(truncated(source.read_at(8, 3)));
        assert!(truncated(source.read_at(0, usize::MAX)));
        assert!(truncated(source.read_at(u64::MAX, 1)));
    }

    #[test]
    fn a_folder_is_not_a_dataset_file() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let message = FileSource::open(folder.path()).expect_err("a folder").to_string();
        assert!(message.contains("not a file"), "{message}");
    }
}
