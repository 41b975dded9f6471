//! The one error type: what the bytes did wrong, and where.

/// Why bytes could not be read as (part of) a dataset. Variants follow what a caller does next.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Fewer bytes than the structure needs: fetch more, or the file is cut short.
    #[error("{what}: {needed} bytes needed, {available} there (the file is cut short)")]
    Truncated {
        /// The structure being read.
        what: &'static str,
        /// Bytes the structure needs.
        needed: u64,
        /// Bytes at hand.
        available: u64,
    },
    /// The bytes are not a dataset at all.
    #[error("not a lodestream dataset: the file does not start with the LODS signature")]
    NotADataset,
    /// Written by a newer, incompatible version.
    #[error(
        "dataset format version {major}.{minor} is newer than the {supported}.x this program reads; \
         update lodestream"
    )]
    NewerVersion {
        /// Major version in the file.
        major: u16,
        /// Minor version in the file.
        minor: u16,
        /// Newest major version understood.
        supported: u16,
    },
    /// The bytes contradict the format.
    #[error("corrupt {what}: {why}")]
    Corrupt {
        /// The structure being read.
        what: &'static str,
        /// The contradiction.
        why: String,
    },
    /// The bytes are well-formed but are not those that were written.
    #[error("checksum of {what} is {found:08x}, expected {expected:08x}: the bytes were altered")]
    Checksum {
        /// The structure being read.
        what: String,
        /// Checksum recorded in the file.
        expected: u32,
        /// Checksum of the bytes at hand.
        found: u32,
    },
    /// The bytes could not be had.
    #[error("reading {len} bytes at {offset}: {message}")]
    Read {
        /// File offset.
        offset: u64,
        /// Length asked for.
        len: u64,
        /// What the source said.
        message: String,
    },
}

/// [`std::result::Result`] with this crate's [`enum@Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

pub(crate) fn corrupt(what: &'static str, why: impl Into<String>) -> Error {
    Error::Corrupt { what, why: why.into() }
}
