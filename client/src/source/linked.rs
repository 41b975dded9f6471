//! A local file behind a made-up link.

use std::sync::Arc;

use bytes::Bytes;

use super::{FileSource, Link, SourceError};

/// A local dataset file whose bytes come as slowly as a [`Link`] lets them.
///
/// Reads on the thread that asks: on a simulated clock nothing may happen elsewhere.
#[derive(Debug, Clone)]
pub struct LinkedSource {
    file: FileSource,
    link: Arc<Link>,
}

impl LinkedSource {
    pub(super) const fn new(file: FileSource, link: Arc<Link>) -> Self {
        Self { file, link }
    }

    /// The file that lies there now, behind the same link.
    pub(super) fn renew(&self) -> Result<Self, SourceError> {
        Ok(Self { file: self.file.renew()?, link: Arc::clone(&self.link) })
    }

    pub(super) fn describe(&self) -> String {
        format!("{} by {}", self.file.describe(), self.link.spec())
    }

    pub(super) fn len(&self) -> u64 {
        self.file.len()
    }

    pub(super) async fn stream_range(
        &self,
        offset: u64,
        len: u64,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        let mut bytes = self.file.read_now(offset, len)?;
        self.link
            .carry(offset, len, |arrived| {
                let arrived = usize::try_from(arrived).unwrap_or(usize::MAX).min(bytes.len());
                sink(bytes.split_to(arrived));
            })
            .await;
        Ok(())
    }
}
