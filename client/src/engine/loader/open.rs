//! Opening a cloud: header, manifest and root page, with one request where possible.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use lodestream_protocol::{Boot, Error, HEADER_BYTES, Header};

use crate::source::{Backoff, Source, SourceError};

use super::super::shared::Shared;

/// An opened cloud.
#[derive(Debug)]
pub struct Opened {
    pub boot: Arc<Boot>,
    /// The first bytes of the file, in which the payloads of the top nodes may lie.
    pub prefix: Bytes,
}

/// Opens `source`, trying again for as long as that may help; asks for `speculative` bytes at first.
///
/// # Errors
/// What is wrong for good, with the source's name.
pub async fn open(
    shared: &Shared,
    cloud: usize,
    source: &Source,
    speculative: u64,
) -> Result<Opened, String> {
    let mut failures = 0;
    loop {
        match try_open(shared, source, speculative).await {
            Ok(opened) => {
                shared.board.post(|news| news.clouds[cloud].trouble = None);
                return Ok(opened);
            }
            Err(Failure::Source(error)) if error.is_transient() => {
                failures += 1;
                shared.counters.retries.add(1);
                shared.board.post(|news| news.clouds[cloud].trouble = Some(error.to_string()));
                tokio::time::sleep(Backoff::default().delay(failures)).await;
            }
            Err(Failure::Source(error)) => return Err(error.to_string()),
            Err(Failure::Format(error)) => return Err(format!("{}: {error}", source.describe())),
        }
    }
}

enum Failure {
    Source(SourceError),
    Format(Error),
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        Self::Source(error)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Format(error)
    }
}

async fn try_open(shared: &Shared, source: &Source, speculative: u64) -> Result<Opened, Failure> {
    shared.counters.requests.add(1);
    let first = source.read_prefix(speculative.max(HEADER_BYTES as u64)).await?;
    shared.counters.bytes.add(first.bytes.len() as u64);
    let header = Header::parse(&first.bytes)?;
    if let Some(total) = first.total
        && total < header.file_bytes
    {
        let (needed, available) = (header.file_bytes, total);
        return Err(Failure::Format(Error::Truncated { what: "dataset", needed, available }));
    }
    let mut prefix = first.bytes;
    let have = prefix.len() as u64;
    if header.index_bytes() > have {
        // The header's own check has bounded these sizes.
        shared.counters.requests.add(1);
        let rest = source.read_range(have, header.index_bytes() - have).await?;
        shared.counters.bytes.add(rest.len() as u64);
        let mut whole = BytesMut::from(prefix);
        whole.extend_from_slice(&rest);
        prefix = whole.freeze();
    }
    Ok(Opened { boot: Arc::new(Boot::parse(&prefix)?), prefix })
}
