//! A local file, read at positions by blocking threads.
//!
//! Not memory-mapped: a file that is cut short under a map kills the process. After every read it is
//! looked whether the path still names the file that was opened, as it was: bytes of two versions are
//! never taken for one file's.

use std::{
    fs::{File, Metadata},
    path::{Path, PathBuf},
    sync::Arc,
    time::SystemTime,
};

use bytes::Bytes;

use super::SourceError;

/// A local dataset file. Clones share the open file.
#[derive(Debug, Clone)]
pub struct FileSource {
    inner: Arc<OpenFile>,
}

#[derive(Debug)]
struct OpenFile {
    path: PathBuf,
    file: File,
    len: u64,
    identity: Identity,
}

/// What tells one version of a file from another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Identity {
    len: u64,
    modified: Option<SystemTime>,
    /// Device and number, where the system has them.
    number: Option<(u64, u64)>,
}

impl FileSource {
    /// Opens the file.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where it cannot be opened or is no regular file.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, SourceError> {
        let path = path.into();
        let fail = |message: String| SourceError::permanent(path.display().to_string(), message);
        let file = File::open(&path).map_err(|e| fail(format!("cannot be opened: {e}")))?;
        let metadata = file.metadata().map_err(|e| fail(format!("cannot be read: {e}")))?;
        if !metadata.is_file() {
            return Err(fail("is no file; name a .lods dataset".into()));
        }
        let identity = Identity::of(&metadata);
        Ok(Self { inner: Arc::new(OpenFile { path, file, len: metadata.len(), identity }) })
    }

    /// Opens what lies at the path now.
    pub(super) fn renew(&self) -> Result<Self, SourceError> {
        Self::open(&self.inner.path)
    }

    /// The path.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.inner.path
    }

    /// Length in bytes when it was opened.
    #[must_use]
    pub fn len(&self) -> u64 {
        self.inner.len
    }

    /// Whether the file held nothing when it was opened.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.inner.len == 0
    }

    pub(super) fn describe(&self) -> String {
        self.inner.path.display().to_string()
    }

    pub(super) async fn stream_range(
        &self,
        offset: u64,
        len: u64,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        sink(self.read(offset, len).await?);
        Ok(())
    }

    /// Reads on this thread.
    pub(super) fn read_now(&self, offset: u64, len: u64) -> Result<Bytes, SourceError> {
        self.inner.read(offset, len)
    }

    async fn read(&self, offset: u64, len: u64) -> Result<Bytes, SourceError> {
        let inner = Arc::clone(&self.inner);
        tokio::task::spawn_blocking(move || inner.read(offset, len)).await.unwrap_or_else(|e| {
            Err(SourceError::transient(self.describe(), format!("reading was broken off: {e}")))
        })
    }
}

impl Identity {
    fn of(metadata: &Metadata) -> Self {
        Self { len: metadata.len(), modified: metadata.modified().ok(), number: number(metadata) }
    }
}

impl OpenFile {
    fn read(&self, offset: u64, len: u64) -> Result<Bytes, SourceError> {
        let bytes = self.read_open(offset, len);
        // A file that was deleted can still be read.
        let now = std::fs::metadata(&self.path).map(|metadata| Identity::of(&metadata));
        if now.is_ok_and(|now| now != self.identity) {
            return Err(SourceError::Replaced { place: self.path.display().to_string() });
        }
        bytes
    }

    fn read_open(&self, offset: u64, len: u64) -> Result<Bytes, SourceError> {
        let permanent =
            |message: String| SourceError::permanent(self.path.display().to_string(), message);
        // Against the length on opening, so that nothing is allocated for bytes that are not there.
        if offset.checked_add(len).is_none_or(|end| end > self.len) {
            return Err(permanent(format!(
                "{len} bytes at {offset} are beyond the end of the file ({} bytes): it is cut \
                 short; build or copy it again",
                self.len
            )));
        }
        let size = usize::try_from(len)
            .map_err(|_| permanent(format!("{len} bytes are too many for this machine")))?;
        let mut bytes = vec![0; size];
        match read_exact_at(&self.file, &mut bytes, offset) {
            Ok(()) => Ok(bytes.into()),
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => {
                Err(permanent("was cut short while it was being read; open it again".into()))
            }
            Err(e) => Err(SourceError::transient(
                self.path.display().to_string(),
                format!("reading {len} bytes at {offset}: {e}"),
            )),
        }
    }
}

#[cfg(unix)]
fn number(metadata: &Metadata) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    Some((metadata.dev(), metadata.ino()))
}

#[cfg(windows)]
fn number(_metadata: &Metadata) -> Option<(u64, u64)> {
    None
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> std::io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> std::io::Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, bytes, offset) {
            Ok(0) => return Err(std::io::ErrorKind::UnexpectedEof.into()),
            Ok(read) => {
                bytes = &mut bytes[read..];
                offset += read as u64;
            }
            Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}
