//! A small file that lies beside a dataset.

use std::{io::Read, path::Path};

use bytes::Bytes;
use lodestream_preprocess::preview::MAX_PREVIEW_BYTES;

use crate::file::{OpenError, open_regular};

/// All of a file of a few megabytes at most.
#[derive(Debug, Clone)]
pub(crate) struct SmallFile {
    pub(crate) bytes: Bytes,
}

impl SmallFile {
    /// Reads a local file (blocking).
    pub(super) fn read(path: &Path) -> Result<Self, OpenError> {
        let (file, _) = open_regular(path)?;
        let mut bytes = Vec::new();
        let limit = MAX_PREVIEW_BYTES as u64 + 1;
        file.take(limit).read_to_end(&mut bytes).map_err(|_| OpenError::Missing)?;
        if bytes.len() > MAX_PREVIEW_BYTES {
            return Err(OpenError::Missing);
        }
        Ok(Self { bytes: bytes.into() })
    }
}
