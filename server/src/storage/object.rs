//! One dataset of an object store, as it was when it was looked at.

use std::{io, ops::Range, sync::Arc, time::SystemTime};

use bytes::Bytes;
use lodestream_protocol::{Error as FormatError, Header, ReadAt, Result as FormatResult};
use object_store::{GetOptions, GetRange, ObjectMeta, path::Path};
use tokio::runtime::Handle;

use super::{Identity, Objects, Version, blocks::BLOCK_BYTES, objects::Failure};

/// A dataset of the store. Reads fail once the store has other bytes under its name.
#[derive(Debug, Clone)]
pub(crate) struct Object {
    objects: Arc<Objects>,
    state: Arc<ObjectState>,
}

/// What is known of an object.
#[derive(Debug)]
pub(super) struct ObjectState {
    /// Tells its blocks from those of all others, former ones of the same name too.
    pub(super) number: u64,
    pub(super) meta: ObjectMeta,
    pub(super) header: Header,
}

impl ObjectState {
    /// Asks for these very bytes, and no others that may have come to this name.
    pub(super) fn ask(&self, range: Range<u64>) -> GetOptions {
        ask_same(&self.meta, range)
    }
}

/// Asks for a range of the object that `meta` is about, and of no other.
pub(super) fn ask_same(meta: &ObjectMeta, range: Range<u64>) -> GetOptions {
    GetOptions {
        if_match: meta.e_tag.clone(),
        if_unmodified_since: meta.e_tag.is_none().then_some(meta.last_modified),
        range: Some(GetRange::Bounded(range)),
        ..GetOptions::default()
    }
}

impl Identity {
    pub(super) fn of_object(meta: &ObjectMeta) -> Self {
        // A list may tell times more finely than an answer does: a tag is enough.
        let written = || Version::Written(SystemTime::from(meta.last_modified));
        Self::Object(meta.size, meta.e_tag.clone().map_or_else(written, Version::Tag))
    }
}

impl Object {
    pub(super) const fn new(objects: Arc<Objects>, state: Arc<ObjectState>) -> Self {
        Self { objects, state }
    }

    pub(crate) fn header(&self) -> &Header {
        &self.state.header
    }

    pub(crate) fn name(&self) -> &str {
        self.state.meta.location.filename().unwrap_or_default()
    }

    pub(crate) fn modified(&self) -> SystemTime {
        SystemTime::from(self.state.meta.last_modified)
    }

    pub(crate) fn identity(&self) -> Identity {
        Identity::of_object(&self.state.meta)
    }

    /// Copies what is in memory; returns the bytes copied from the start of `buffer` on.
    pub(crate) fn read_cached(&self, buffer: &mut [u8], offset: u64) -> usize {
        let mut filled = 0;
        while filled < buffer.len() {
            let at = offset + filled as u64;
            let Some(block) = self.objects.cached(&self.state, at / BLOCK_BYTES) else { break };
            match copy(&block, at, &mut buffer[filled..]) {
                0 => break,
                copied => filled += copied,
            }
        }
        filled
    }

    /// Fills `buffer` from `offset` on, as far as the object reaches; returns the bytes read.
    /// `until` is where the response ends: what is fetched may reach that far.
    pub(crate) async fn read_into(
        &self,
        buffer: &mut [u8],
        offset: u64,
        until: u64,
    ) -> io::Result<usize> {
        let mut filled = 0;
        let length = self.state.meta.size;
        while filled < buffer.len() && offset + (filled as u64) < length {
            let at = offset + filled as u64;
            let until = until.max(offset + buffer.len() as u64).min(length);
            let block = self.objects.block(&self.state, at / BLOCK_BYTES, until).await?;
            match copy(&block, at, &mut buffer[filled..]) {
                0 => break,
                copied => filled += copied,
            }
        }
        Ok(filled)
    }
}

/// Copies from a block, which holds the byte at `at`, as much as there is or fits.
fn copy(block: &Bytes, at: u64, buffer: &mut [u8]) -> usize {
    let rest = block.get((at % BLOCK_BYTES) as usize..).unwrap_or_default();
    let copied = rest.len().min(buffer.len());
    buffer[..copied].copy_from_slice(&rest[..copied]);
    copied
}

/// Blocking, for the pool: not to be used on the runtime's own threads.
impl ReadAt for Object {
    fn read_at(&self, offset: u64, len: usize) -> FormatResult<Vec<u8>> {
        let size = self.state.meta.size;
        // Checked first, so that a length from a corrupt file is never allocated.
        if offset.checked_add(len as u64).is_none_or(|end| end > size) {
            let needed = offset.saturating_add(len as u64);
            return Err(FormatError::Truncated { what: "object", needed, available: size });
        }
        let mut bytes = vec![0; len];
        Handle::current().block_on(self.read_into(&mut bytes, offset, 0)).map_err(|e| {
            // The error goes to clients, in the list; what the store says is not for them.
            let message = if e.get_ref().is_some_and(|e| e.is::<Failure>()) {
                tracing::warn!("{:?}: {e}", self.name());
                "the object store does not give them".to_owned()
            } else {
                e.to_string()
            };
            FormatError::Read { offset, len: len as u64, message }
        })?;
        Ok(bytes)
    }

    fn size(&self) -> FormatResult<u64> {
        Ok(self.state.meta.size)
    }
}

/// The bytes of a range.
pub(super) async fn fetch(
    store: &dyn object_store::ObjectStore,
    location: &Path,
    options: GetOptions,
) -> object_store::Result<(ObjectMeta, Bytes)> {
    let result = store.get_opts(location, options).await?;
    let meta = result.meta.clone();
    Ok((meta, result.bytes().await?))
}
