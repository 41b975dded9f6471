//! A source for code that is not asynchronous: one read at a time, with retries.

use bytes::Bytes;
use lodestream_protocol::{Error, ReadAt, Result};

use super::{Backoff, Prefix, Source, SourceError};

/// Tries before a read is given up; with the default [`Backoff`] about three seconds.
const TRIES: u32 = 6;

/// Reads a [`Source`] synchronously, so that [`lodestream_protocol::Dataset`] runs over it.
///
/// Owns a runtime with one thread. Reads may come from several threads at once, but not from
/// inside another runtime, and it must not be dropped there.
#[derive(Debug)]
pub struct BlockingSource {
    source: Source,
    runtime: tokio::runtime::Runtime,
}

impl BlockingSource {
    /// Wraps `source`, which must not have been used in another runtime.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the system gives no thread.
    pub fn new(source: Source) -> std::result::Result<Self, SourceError> {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .thread_name("source")
            .enable_all()
            .build()
            .map_err(|e| SourceError::permanent(source.describe(), format!("no thread: {e}")))?;
        Ok(Self { source, runtime })
    }

    /// The source.
    #[must_use]
    pub const fn source(&self) -> &Source {
        &self.source
    }

    /// Exactly `len` bytes from `offset`.
    ///
    /// # Errors
    /// The last try's [`SourceError`].
    pub fn read_range(&self, offset: u64, len: u64) -> std::result::Result<Bytes, SourceError> {
        self.retry(async || self.source.read_range(offset, len).await)
    }

    /// The first `len` bytes, or all where the file is shorter.
    ///
    /// # Errors
    /// The last try's [`SourceError`].
    pub fn read_prefix(&self, len: u64) -> std::result::Result<Prefix, SourceError> {
        self.retry(async || self.source.read_prefix(len).await)
    }

    fn retry<T>(
        &self,
        read: impl AsyncFn() -> std::result::Result<T, SourceError>,
    ) -> std::result::Result<T, SourceError> {
        self.runtime.block_on(async {
            let mut failures = 0;
            loop {
                match read().await {
                    Err(error) if error.is_transient() && failures + 1 < TRIES => {
                        failures += 1;
                        tracing::debug!(%error, failures, "reading again");
                        tokio::time::sleep(Backoff::default().delay(failures)).await;
                    }
                    result => return result,
                }
            }
        })
    }
}

impl ReadAt for BlockingSource {
    fn read_at(&self, offset: u64, len: usize) -> Result<Vec<u8>> {
        let len = len as u64;
        self.read_range(offset, len).map(Vec::from).map_err(|e| Error::Read {
            offset,
            len,
            message: e.to_string(),
        })
    }

    fn size(&self) -> Result<u64> {
        self.retry(async || self.source.size().await).map_err(|e| Error::Read {
            offset: 0,
            len: 0,
            message: e.to_string(),
        })
    }
}
