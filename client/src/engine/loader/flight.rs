//! A request in flight.

use std::{
    sync::{
        Arc, OnceLock,
        atomic::{AtomicU64, Ordering},
    },
    time::Duration,
};

use bytes::Bytes;
use lodestream_protocol::BatchPart;
use tokio::{sync::mpsc::UnboundedSender, task::AbortHandle, time::Instant};

use crate::source::{Fault, Source, SourceError};

use super::{
    super::{piece::Piece, shared::Shared},
    Message,
    cutter::Cutter,
};

/// Identifies a request.
pub type FlightId = u64;

/// The loader's view of a request.
#[derive(Debug)]
pub struct Flight {
    pub cloud: usize,
    /// By offset.
    pub pieces: Vec<Piece>,
    len: u64,
    sent: Instant,
    progress: Arc<Progress>,
    task: AbortHandle,
}

/// What a host has delivered for all requests.
#[derive(Debug, Default)]
pub struct Delivered {
    pub bytes: AtomicU64,
    /// So many bytes are to be told.
    pub waited_for: AtomicU64,
}

/// What has come of a request.
#[derive(Debug, Default)]
struct Progress {
    bytes: AtomicU64,
    /// When the first byte came, and how many the host had delivered by then.
    first: OnceLock<(Instant, u64)>,
}

impl Flight {
    /// Sends a request for `pieces` on the current runtime: a batch, or the range from the first to the
    /// last, which then lie in order and do not overlap.
    /// What arrives goes to `messages`; the last message is always [`Message::Finished`]. What the host
    /// delivers counts in `delivered`; when that reaches what was waited for, it is told too.
    pub fn start(
        id: FlightId,
        source: Source,
        pieces: Vec<Piece>,
        is_batch: bool,
        shared: Arc<Shared>,
        messages: UnboundedSender<Message>,
        delivered: Arc<Delivered>,
    ) -> Self {
        let cloud = pieces.first().map_or(0, |piece| piece.id.node.cloud);
        let ask = if is_batch { Ask::parts(&pieces) } else { Ask::range(&pieces) };
        let len = ask.len();
        let progress = Arc::new(Progress::default());
        let mut cutter = ask.cutter(&pieces);
        let counted = Arc::clone(&progress);
        let task = tokio::spawn(async move {
            let mut end = End { id, messages, result: None };
            shared.counters.requests.add(1);
            let result = ask
                .stream(&source, &mut |bytes: Bytes| {
                    let count = bytes.len() as u64;
                    shared.counters.bytes.add(count);
                    counted.bytes.fetch_add(count, Ordering::Relaxed);
                    let before = delivered.bytes.fetch_add(count, Ordering::Relaxed);
                    counted.first.get_or_init(|| (Instant::now(), before));
                    let due = delivered.waited_for.load(Ordering::Relaxed);
                    if before < due && before + count >= due {
                        // The loader outlives its requests, save when it shuts down.
                        let _ = end.messages.send(Message::Nearing);
                    }
                    cutter.push(bytes, |index, bytes| {
                        // The loader outlives its requests, save when it shuts down.
                        let _ = end.messages.send(Message::Arrived { flight: id, index, bytes });
                    });
                })
                .await;
            end.result = Some(result);
        });
        let sent = Instant::now();
        Self { cloud, pieces, len, sent, progress, task: task.abort_handle() }
    }

    /// Whether so little is missing that breaking off would cost more than it saves: a connection
    /// that is broken off cannot be used again.
    pub fn is_nearly_done(&self) -> bool {
        let received = self.progress.bytes.load(Ordering::Relaxed);
        received.saturating_mul(4) >= self.len.saturating_mul(3)
    }

    /// When it was sent.
    pub const fn sent(&self) -> Instant {
        self.sent
    }

    /// Bytes that are still to come.
    pub fn left_bytes(&self) -> u64 {
        self.len.saturating_sub(self.progress.bytes.load(Ordering::Relaxed))
    }

    /// Bytes between its pieces.
    pub fn gap_bytes(&self) -> u64 {
        self.len.saturating_sub(self.pieces.iter().map(|piece| piece.len).sum())
    }

    /// How long the first byte took; and since then, what the host delivered for all requests, of
    /// `delivered` ever, in what time. `None` where nothing has come.
    pub fn measured(&self, delivered: u64) -> Option<(Duration, u64, Duration)> {
        let &(first, before) = self.progress.first.get()?;
        Some((first - self.sent, delivered.saturating_sub(before), first.elapsed()))
    }

    /// Breaks the request off.
    pub fn abort(&self) {
        self.task.abort();
    }
}

/// Whoever no longer holds a request does not want it.
impl Drop for Flight {
    fn drop(&mut self) {
        self.abort();
    }
}

/// What a request asks for.
#[derive(Debug)]
enum Ask {
    Range { start: u64, len: u64 },
    Parts(Vec<BatchPart>),
}

impl Ask {
    fn range(pieces: &[Piece]) -> Self {
        let start = pieces.first().map_or(0, |piece| piece.offset);
        Self::Range { start, len: pieces.last().map_or(start, Piece::end) - start }
    }

    fn parts(pieces: &[Piece]) -> Self {
        // Lengths are 32-bit numbers in the tree.
        let bytes = |piece: &Piece| u32::try_from(piece.len).unwrap_or(u32::MAX);
        let part = |piece: &Piece| BatchPart { offset: piece.offset, bytes: bytes(piece) };
        Self::Parts(pieces.iter().map(part).collect())
    }

    fn len(&self) -> u64 {
        match self {
            Self::Range { len, .. } => *len,
            Self::Parts(parts) => parts.iter().map(|part| u64::from(part.bytes)).sum(),
        }
    }

    /// Cuts what comes into the pieces.
    fn cutter(&self, pieces: &[Piece]) -> Cutter {
        let mut end = 0;
        Cutter::new(pieces.iter().map(|piece| match self {
            Self::Range { .. } => (piece.offset, piece.len),
            // They come back to back.
            Self::Parts(_) => {
                end += piece.len;
                (end - piece.len, piece.len)
            }
        }))
    }

    async fn stream(
        &self,
        source: &Source,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        match self {
            Self::Range { start, len } => source.stream_range(*start, *len, sink).await,
            Self::Parts(parts) => source.stream_parts(parts, sink).await,
        }
    }
}

/// Says that the request has ended, by whatever way: a slot must never be lost.
struct End {
    id: FlightId,
    messages: UnboundedSender<Message>,
    result: Option<Result<(), SourceError>>,
}

impl Drop for End {
    fn drop(&mut self) {
        let result = self.result.take().unwrap_or_else(|| {
            let (place, message) = ("request".into(), "broken off".into());
            Err(SourceError::Transient { place, message, fault: Fault::BrokenOff })
        });
        let _ = self.messages.send(Message::Finished { flight: self.id, result });
    }
}
