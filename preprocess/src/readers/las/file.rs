//! The input file, read at a place by several threads at once.
//!
//! Not a memory map: its pages would count as this program's memory, and a file that shrinks under
//! a map kills the process where a positioned read returns an error.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
};

use crate::{
    error::{Error, Result},
    positioned::read_exact_at,
};

/// A file open for positioned reads.
#[derive(Debug)]
pub(super) struct PositionedFile {
    file: File,
    path: PathBuf,
    size_bytes: u64,
}

impl PositionedFile {
    /// Opens a regular file.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(Error::io(path, "cannot open"))?;
        let metadata = file.metadata().map_err(Error::io(path, "cannot read"))?;
        if !metadata.is_file() {
            return Err(Error::input(path.display().to_string(), "is not a regular file"));
        }
        Ok(Self { file, path: path.to_owned(), size_bytes: metadata.len() })
    }

    /// Size when the file was opened.
    pub(super) const fn size_bytes(&self) -> u64 {
        self.size_bytes
    }

    /// The path, as the user named it.
    pub(super) fn name(&self) -> String {
        self.path.display().to_string()
    }

    /// An [`Error::Input`] about this file.
    pub(super) fn error(&self, message: impl Into<String>) -> Error {
        Error::input(self.name(), message)
    }

    /// Fills `bytes` from `offset`.
    pub(super) fn read_exact_at(&self, bytes: &mut [u8], offset: u64) -> Result<()> {
        read_exact_at(&self.file, bytes, offset).map_err(Error::io(&self.path, "cannot read"))
    }

    /// `len` bytes from `offset`; the caller has checked that the file holds them.
    pub(super) fn read_vec_at(&self, len: usize, offset: u64) -> Result<Vec<u8>> {
        let mut bytes = vec![0; len];
        self.read_exact_at(&mut bytes, offset)?;
        Ok(bytes)
    }
}

/// Bytes of a [`PositionedFile`] as a stream.
#[derive(Debug)]
pub(super) struct Span<'a> {
    file: &'a PositionedFile,
    at: u64,
    end: u64,
}

impl<'a> Span<'a> {
    /// The bytes from `start` up to `end` or the end of the file.
    pub(super) fn new(file: &'a PositionedFile, start: u64, end: u64) -> Self {
        Self { file, at: start, end: end.min(file.size_bytes()) }
    }
}

impl io::Read for Span<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.end.saturating_sub(self.at)).unwrap_or(usize::MAX);
        let len = left.min(bytes.len());
        read_exact_at(&self.file.file, &mut bytes[..len], self.at)?;
        self.at += len as u64;
        Ok(len)
    }
}
