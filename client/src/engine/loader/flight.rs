//! A request in flight.

use std::sync::{
    Arc,
    atomic::{AtomicU64, Ordering},
};

use bytes::Bytes;
use tokio::{sync::mpsc::UnboundedSender, task::AbortHandle};

use crate::source::{Source, SourceError};

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
    received: Arc<AtomicU64>,
    task: AbortHandle,
}

impl Flight {
    /// Sends a request for `pieces`, which lie in order and do not overlap, on the current runtime.
    /// What arrives goes to `messages`; the last message is always [`Message::Finished`].
    pub fn start(
        id: FlightId,
        source: Source,
        pieces: Vec<Piece>,
        shared: Arc<Shared>,
        messages: UnboundedSender<Message>,
    ) -> Self {
        let cloud = pieces.first().map_or(0, |piece| piece.id.node.cloud);
        let start = pieces.first().map_or(0, |piece| piece.offset);
        let len = pieces.last().map_or(start, Piece::end) - start;
        let received = Arc::new(AtomicU64::new(0));
        let mut cutter = Cutter::new(pieces.iter().map(|piece| (piece.offset, piece.len)));
        let counter = Arc::clone(&received);
        let task = tokio::spawn(async move {
            let mut end = End { id, messages, result: None };
            shared.counters.requests.add(1);
            let result = source
                .stream_range(start, len, &mut |bytes: Bytes| {
                    let count = bytes.len() as u64;
                    shared.counters.bytes.add(count);
                    counter.fetch_add(count, Ordering::Relaxed);
                    cutter.push(bytes, |index, bytes| {
                        // The loader outlives its requests, save when it shuts down.
                        let _ = end.messages.send(Message::Arrived { flight: id, index, bytes });
                    });
                })
                .await;
            end.result = Some(result);
        });
        Self { cloud, pieces, len, received, task: task.abort_handle() }
    }

    /// Whether so little is missing that breaking off would cost more than it saves: a connection
    /// that is broken off cannot be used again.
    pub fn is_nearly_done(&self) -> bool {
        let received = self.received.load(Ordering::Relaxed);
        received.saturating_mul(4) >= self.len.saturating_mul(3)
    }

    /// Breaks the request off.
    pub fn abort(&self) {
        self.task.abort();
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
            Err(SourceError::Transient { place: "request".into(), message: "broken off".into() })
        });
        let _ = self.messages.send(Message::Finished { flight: self.id, result });
    }
}
