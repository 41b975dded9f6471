//! Where datasets come from: sources of byte ranges.
//!
//! A [`Source`] is a local file or a URL on any host that answers range requests. Sources are
//! asynchronous and do not retry: whoever reads decides what a failure costs, helped by
//! [`SourceError::is_transient`] and [`Backoff`]. [`BlockingSource`] is the plain way for tools that
//! read a dataset from front to back. Adding a kind of source means adding a file and an arm here;
//! `tests/source_conformance.rs` holds all kinds to one behaviour.

mod backoff;
mod blocking;
mod connector;
mod error;
mod fault;
mod file;
mod http;
mod link;
mod linked;
mod listing;
mod locator;
mod meter;
mod token;
mod wire;

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use lodestream_protocol::BatchPart;

pub use backoff::Backoff;
pub use blocking::BlockingSource;
pub(crate) use connector::Connections;
pub use connector::{Timeouts, is_local};
pub use error::SourceError;
pub use fault::Fault;
pub use file::FileSource;
pub use http::HttpSource;
pub(crate) use http::without_secrets;
pub use link::{Link, LinkSpec};
pub use linked::{ForeignSizes, LinkedSource};
pub use listing::{datasets_of_folder, is_server, list_datasets};
pub use meter::{Counted, Meter, Traffic};
pub use token::use_token;
pub use wire::Wire;

/// Most bytes that are reserved before any of them has arrived.
const RESERVE_BYTES: u64 = 4 << 20;

/// A source of byte ranges. Clones share connections and open files.
///
/// An HTTP source keeps connections alive on the runtime that it is first used in; use it (and its
/// clones) in one runtime only.
#[derive(Debug, Clone)]
pub enum Source {
    /// A URL.
    Http(HttpSource),
    /// A local file.
    File(FileSource),
    /// A local file behind a made-up link.
    Linked(LinkedSource),
}

/// The first bytes of a dataset file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Prefix {
    /// As many bytes as were asked for, or the whole file where it is shorter.
    pub bytes: Bytes,
    /// Length of the whole file in bytes, where the host tells.
    pub total: Option<u64>,
}

/// What an answer says before its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Announced {
    /// Bytes that come.
    pub len: u64,
    /// Length of the whole file in bytes, where the host tells.
    pub total: Option<u64>,
}

/// What a host that takes requests for many parts takes at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BatchLimits {
    /// Most parts.
    pub parts: usize,
    /// Most bytes of all parts together.
    pub bytes: u64,
}

impl Source {
    /// Opens what a user names: a file, `http(s)://host/…/NAME.lods`, or a server's address with a
    /// dataset's name (`http://host:8080/courtyard`, `127.0.0.1:8080/courtyard`).
    ///
    /// Files are opened at once; URLs are first asked when they are read.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the text names nothing that could be read.
    pub fn parse(text: &str) -> Result<Self, SourceError> {
        locator::parse(text)
    }

    /// A host's file whose requests go through `wire`, for measuring what they come to.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the text names no URL.
    pub fn by_wire(text: &str, wire: Wire) -> Result<Self, SourceError> {
        let url = Self::parse_url(text)?;
        Ok(Self::Http(HttpSource::by_wire(url, Timeouts::default(), wire)))
    }

    /// The URL of a dataset that a user names, as [`parse`](Self::parse) takes it.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the text names no URL.
    pub fn parse_url(text: &str) -> Result<reqwest::Url, SourceError> {
        locator::url(text)?.ok_or_else(|| {
            let message = "is a file: name the address of a host, as in 127.0.0.1:8080/NAME; \
                           `lodestream serve FOLDER` is one";
            SourceError::permanent(text, message)
        })
    }

    /// Whether a user means an address, and not a file: then [`parse_url`](Self::parse_url) takes it, or
    /// says what is wrong with it.
    #[must_use]
    pub fn names_url(text: &str) -> bool {
        text.contains("://") || locator::url(text).is_ok_and(|url| url.is_some())
    }

    /// The file behind a made-up link, for measuring what links do.
    #[must_use]
    pub const fn linked(file: FileSource, link: Arc<Link>) -> Self {
        Self::Linked(LinkedSource::new(file, link, None))
    }

    /// The same, where the link carries what the file's ranges would weigh in another encoding.
    #[must_use]
    pub const fn linked_as(file: FileSource, link: Arc<Link>, foreign: Arc<ForeignSizes>) -> Self {
        Self::Linked(LinkedSource::new(file, link, Some(foreign)))
    }

    /// The source for people: a path, or a URL without credentials and query.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Http(source) => source.describe(),
            Self::File(source) => source.describe(),
            Self::Linked(source) => source.describe(),
        }
    }

    /// The source, sharing connections with all others that are used in the same runtime.
    pub(crate) fn sharing(self, connections: &Connections) -> Self {
        match self {
            Self::Http(source) => Self::Http(source.sharing(connections)),
            Self::File(_) | Self::Linked(_) => self,
        }
    }

    /// The host that is asked; `None` for files.
    pub(crate) fn host(&self) -> Option<&str> {
        match self {
            Self::Http(source) => Some(source.url().authority()),
            Self::File(_) | Self::Linked(_) => None,
        }
    }

    /// A source of whatever lies at the same place now, after [`SourceError::Replaced`].
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where there is nothing any more.
    pub fn renew(&self) -> Result<Self, SourceError> {
        Ok(match self {
            Self::Http(source) => Self::Http(source.renew()),
            Self::File(source) => Self::File(source.renew()?),
            Self::Linked(source) => Self::Linked(source.renew()?),
        })
    }

    /// Hands exactly `len` bytes from `offset` to `sink`, piece by piece as they arrive.
    ///
    /// Pieces that were handed out before an error are good.
    ///
    /// # Errors
    /// [`SourceError`]: why the bytes could not be had, and whether trying again may help.
    pub async fn stream_range(
        &self,
        offset: u64,
        len: u64,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        match self {
            _ if len == 0 => Ok(()),
            Self::Http(source) => source.stream_range(offset, len, sink).await,
            Self::File(source) => source.stream_range(offset, len, sink).await,
            Self::Linked(source) => source.stream_range(offset, len, sink).await,
        }
    }

    /// What may be asked for by one request, where the host has offered to take many parts.
    #[must_use]
    pub fn batch_limits(&self) -> Option<BatchLimits> {
        match self {
            Self::Http(source) => source.batch_limits(),
            Self::File(_) | Self::Linked(_) => None,
        }
    }

    /// Hands the bytes of `parts`, one after the other, to `sink` as they arrive: by one request where
    /// the host [takes such](Self::batch_limits), else by one for each.
    ///
    /// # Errors
    /// As for [`stream_range`](Self::stream_range).
    pub async fn stream_parts(
        &self,
        parts: &[BatchPart],
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        if let Self::Http(source) = self {
            return source.stream_parts(parts, sink).await;
        }
        for part in parts {
            self.stream_range(part.offset, u64::from(part.bytes), sink).await?;
        }
        Ok(())
    }

    /// Exactly `len` bytes from `offset`.
    ///
    /// # Errors
    /// As for [`stream_range`](Self::stream_range).
    pub async fn read_range(&self, offset: u64, len: u64) -> Result<Bytes, SourceError> {
        let mut joiner = Joiner::default();
        self.stream_range(offset, len, &mut |piece| joiner.push(piece, len)).await?;
        Ok(joiner.finish())
    }

    /// The first `len` bytes, or all where the file is shorter.
    ///
    /// # Errors
    /// As for [`stream_range`](Self::stream_range).
    pub async fn read_prefix(&self, len: u64) -> Result<Prefix, SourceError> {
        let (mut joiner, mut total) = (Joiner::default(), None);
        let mut join = |piece, announced: Announced| {
            total = announced.total;
            joiner.push(piece, announced.len);
        };
        self.stream_prefix(len, &mut join).await?;
        Ok(Prefix { bytes: joiner.finish(), total })
    }

    /// Hands the first `len` bytes, or all where the file is shorter, to `sink` as they arrive; each
    /// piece with what the host has announced.
    ///
    /// # Errors
    /// As for [`stream_range`](Self::stream_range).
    pub async fn stream_prefix(
        &self,
        len: u64,
        sink: &mut (dyn FnMut(Bytes, Announced) + Send),
    ) -> Result<(), SourceError> {
        // Of a file the length is known.
        let announced = |total: u64| Announced { len: len.min(total), total: Some(total) };
        match self {
            Self::Http(source) => source.stream_prefix(len, sink).await,
            Self::File(source) => {
                let announced = announced(source.len());
                source.stream_range(0, announced.len, &mut |piece| sink(piece, announced)).await
            }
            Self::Linked(source) => {
                let announced = announced(source.len());
                source.stream_range(0, announced.len, &mut |piece| sink(piece, announced)).await
            }
        }
    }

    /// Length of the whole file in bytes; asks the host where no earlier answer has told.
    ///
    /// # Errors
    /// As for [`stream_range`](Self::stream_range), and where the host does not tell.
    pub async fn size(&self) -> Result<u64, SourceError> {
        match self {
            Self::Http(source) => source.size().await,
            Self::File(source) => Ok(source.len()),
            Self::Linked(source) => Ok(source.len()),
        }
    }
}

/// Joins pieces. A single one is passed on as it is.
#[derive(Debug, Default)]
struct Joiner {
    first: Bytes,
    joined: BytesMut,
}

impl Joiner {
    /// Adds a piece of what is expected to become `len` bytes.
    fn push(&mut self, piece: Bytes, len: u64) {
        if self.first.is_empty() && self.joined.is_empty() {
            self.first = piece;
            return;
        }
        if self.joined.is_empty() {
            // The length is the caller's wish: trust it for a few megabytes only.
            self.joined.reserve(usize::try_from(len.min(RESERVE_BYTES)).unwrap_or(0));
            self.joined.extend_from_slice(&std::mem::take(&mut self.first));
        }
        self.joined.extend_from_slice(&piece);
    }

    fn finish(self) -> Bytes {
        if self.joined.is_empty() { self.first } else { self.joined.freeze() }
    }
}
