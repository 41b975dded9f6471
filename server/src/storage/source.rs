//! What the bytes of a dataset come from.

use std::{fs::File, io, ops::Range};

use lodestream_preprocess::FileSource;
use lodestream_protocol::{ReadAt, Result as FormatResult};
use tokio::runtime::Handle;

use super::Object;

/// An open dataset.
#[derive(Debug)]
pub(crate) enum Source {
    /// A local file.
    File(FileSource),
    /// An object of a store.
    Object(Object),
}

impl Source {
    /// Reads some bytes that can be had without waiting; returns how many.
    pub(crate) fn read_cached(&self, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
        match self {
            Self::File(file) => read_cached(file.file(), buffer, offset),
            Self::Object(object) => Ok(object.read_cached(buffer, offset)),
        }
    }

    /// Reads some bytes from the start of `rest` on; returns how many, which is none at the end. What
    /// is fetched meanwhile may reach to the end of `rest`. Blocking: for the pool.
    pub(crate) fn read(&self, buffer: &mut [u8], rest: &Range<u64>) -> io::Result<usize> {
        match self {
            Self::File(file) => file.read_into(buffer, rest.start),
            Self::Object(object) => {
                Handle::current().block_on(object.read_into(buffer, rest.start, rest.end))
            }
        }
    }
}

/// Reads what the system has in its cache; nothing where it cannot tell.
#[cfg(target_os = "linux")]
pub(crate) fn read_cached(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<usize> {
    use rustix::io::{ReadWriteFlags, preadv2};
    let rest = &mut [io::IoSliceMut::new(buffer)];
    Ok(preadv2(file, rest, offset, ReadWriteFlags::NOWAIT)?)
}

#[cfg(not(target_os = "linux"))]
pub(crate) fn read_cached(_: &File, _: &mut [u8], _: u64) -> io::Result<usize> {
    Ok(0)
}

impl ReadAt for Source {
    fn read_at(&self, offset: u64, len: usize) -> FormatResult<Vec<u8>> {
        match self {
            Self::File(file) => file.read_at(offset, len),
            Self::Object(object) => object.read_at(offset, len),
        }
    }

    fn size(&self) -> FormatResult<u64> {
        match self {
            Self::File(file) => file.size(),
            Self::Object(object) => object.size(),
        }
    }
}
