//! Encoded payloads waiting for their place in the file: in memory up to a limit, then on disk.

use std::{fs::File, path::PathBuf, sync::Mutex};

use crate::{
    error::{Error, Result},
    positioned::{read_exact_at, write_all_at},
};

/// The buffers of one part of the build.
#[derive(Debug)]
enum Blob {
    Memory(Vec<u8>),
    Disk { offset: u64 },
}

/// All parts' buffers, one per column group.
#[derive(Debug)]
pub struct Blobs {
    folder: PathBuf,
    limit_bytes: u64,
    inner: Mutex<Inner>,
}

#[derive(Debug)]
struct Inner {
    parts: Vec<Vec<Blob>>,
    memory_bytes: u64,
    file: Option<(File, u64)>,
}

impl Blobs {
    /// Room for `parts` parts; at most `limit_bytes` are kept in memory.
    pub fn new(parts: usize, limit_bytes: u64, folder: PathBuf) -> Self {
        let parts = std::iter::repeat_with(Vec::new).take(parts).collect();
        let inner = Mutex::new(Inner { parts, memory_bytes: 0, file: None });
        Self { folder, limit_bytes, inner }
    }

    /// Takes the buffers of a part, one per group.
    ///
    /// # Errors
    /// Where a temporary file cannot be written.
    pub fn put(&self, part: usize, buffers: Vec<Vec<u8>>) -> Result<()> {
        let mut inner = self.inner.lock().expect("no holder panics");
        let bytes: u64 = buffers.iter().map(|b| b.len() as u64).sum();
        if inner.memory_bytes + bytes <= self.limit_bytes {
            inner.memory_bytes += bytes;
            inner.parts[part] = buffers
                .into_iter()
                .map(|mut b| {
                    b.shrink_to_fit();
                    Blob::Memory(b)
                })
                .collect();
            return Ok(());
        }
        if inner.file.is_none() {
            let file = tempfile::tempfile_in(&self.folder)
                .map_err(Error::io(&self.folder, "cannot create a temporary file"))?;
            inner.file = Some((file, 0));
        }
        let (file, end) = inner.file.as_mut().expect("made above");
        let mut blobs = Vec::with_capacity(buffers.len());
        for buffer in buffers {
            write_all_at(file, &buffer, *end)
                .map_err(Error::io(&self.folder, "cannot write a temporary file"))?;
            blobs.push(Blob::Disk { offset: *end });
            *end += buffer.len() as u64;
        }
        inner.parts[part] = blobs;
        Ok(())
    }

    /// Ends writing.
    pub fn finish(self) -> FinishedBlobs {
        let inner = self.inner.into_inner().expect("no holder panics");
        FinishedBlobs { folder: self.folder, parts: inner.parts, file: inner.file.map(|f| f.0) }
    }
}

/// All parts' buffers, complete.
#[derive(Debug)]
pub struct FinishedBlobs {
    folder: PathBuf,
    parts: Vec<Vec<Blob>>,
    file: Option<File>,
}

impl FinishedBlobs {
    /// Calls `sink` with a stretch of one buffer.
    ///
    /// # Errors
    /// Where the temporary file cannot be read, or what `sink` returns.
    pub fn copy(
        &self,
        part: u32,
        group: usize,
        start: u64,
        bytes: u32,
        sink: &mut dyn FnMut(&[u8]) -> Result<()>,
    ) -> Result<()> {
        if bytes == 0 {
            return Ok(());
        }
        match &self.parts[part as usize][group] {
            Blob::Memory(buffer) => sink(&buffer[start as usize..][..bytes as usize]),
            Blob::Disk { offset } => {
                let mut buffer = vec![0; bytes as usize];
                let file = self.file.as_ref().expect("a part on disk has a file");
                read_exact_at(file, &mut buffer, offset + start)
                    .map_err(Error::io(&self.folder, "cannot read a temporary file"))?;
                sink(&buffer)
            }
        }
    }
}
