//! From an answer to the socket.
//!
//! Batches are copied: sent as pages, a part of 16 KiB with the head of its frame makes two calls and a
//! packet of its own, and came to 21 µs of the server's time; copied into pieces with its neighbours, to 7.

use std::{
    io::{self, IoSlice},
    ops::Range,
    sync::Arc,
};

use tokio::{io::Interest, net::TcpStream, time::timeout};

use super::answer::{Answer, Content};
use crate::{
    body::FileBody,
    connection::ConnectionLimits,
    private_copy::{self, PrivateCopy},
    routes::{Site, batch_segments},
};

/// Answers of these lengths leave as pages of the file, in one packet with their head, rather than as bytes that were read.
///
/// Thousands of requests a second at random places, 16 connections, pages and bytes: 88 and 102 of 4 KiB, 93 and 79 (of the file itself) of
/// 16, 85 and 87 of 32, 48 and 60 of 64. Waits are shorter by pages, likely as the system takes fresh memory for bytes. With the head
/// in a packet of its own, 76 of 16 KiB.
const SHORT_PAGES: Range<u64> = 8 << 10..40 << 10;

/// So do all answers from this length on, behind their head: 34 and 25 of 128 KiB. Of longer ones bytes are no slower (19 and 20 of
/// 256), but cost the server up to a fifth more of its time. Heads that wait for the first pages take up to a quarter of the requests away, for
/// a reason that was not found. (But not of 1 MiB over few connections, where BBR controls congestion: 4.4, not 2.2; likely as it takes
/// the way of a head alone for the shortest there is, and lets less be on it at a time. Over 256 connections 0.94 of it.)
const LONG_PAGES: u64 = 128 << 10;

/// Why an answer was not sent whole.
#[derive(Debug)]
pub(super) enum Broken {
    /// It went away, or takes nothing.
    ByClient(io::Error),
    /// Its file or store failed, which the body has told the log.
    ByFile,
}

impl From<io::Error> for Broken {
    fn from(error: io::Error) -> Self {
        Self::ByClient(error)
    }
}

/// Sends head and content.
pub(super) async fn send(
    stream: &TcpStream,
    site: &Arc<Site>,
    answer: &Answer,
    head: &[u8],
    limits: ConnectionLimits,
) -> Result<(), Broken> {
    let socket = Socket { stream, limits };
    let (file, length) = (&answer.file, answer.len());
    if let Content::Range(range) = &answer.content {
        let is_for_pages = SHORT_PAGES.contains(&length) || length >= LONG_PAGES;
        match file.private_copy.get() {
            None => private_copy::count(file, length, &site.private_copies),
            Some(copy) if is_for_pages && copy.is_cached(range) => {
                return Ok(socket.send_pages(copy, head, range.clone()).await?);
            }
            Some(_) => {}
        }
    }
    let (file, pool) = (Arc::clone(file), Arc::clone(&site.buffers));
    let body = match &answer.content {
        Content::Range(range) => FileBody::new(file, range.clone(), pool),
        Content::Batch(batch) => FileBody::of(file, batch_segments(batch), pool),
    };
    socket.send_body(head, body).await
}

/// Sends what is there.
pub(super) async fn send_bytes(
    stream: &TcpStream,
    bytes: &[u8],
    limits: ConnectionLimits,
) -> Result<(), Broken> {
    Ok(Socket { stream, limits }.send_all(bytes).await?)
}

/// The client's end, and its patience.
#[derive(Clone, Copy)]
struct Socket<'a> {
    stream: &'a TcpStream,
    limits: ConnectionLimits,
}

impl Socket<'_> {
    /// Bytes that were read, together with the head.
    async fn send_body(self, mut head: &[u8], mut body: FileBody) -> Result<(), Broken> {
        while let Some(piece) = body.next().await {
            let piece = piece.map_err(|_| Broken::ByFile)?;
            let mut piece = piece.as_ref();
            while !piece.is_empty() {
                let sent = if head.is_empty() {
                    self.stream.try_write(piece)
                } else {
                    self.stream.try_write_vectored(&[IoSlice::new(head), IoSlice::new(piece)])
                };
                let sent = self.wait(sent).await?;
                let of_head = sent.min(head.len());
                head = &head[of_head..];
                piece = &piece[sent - of_head..];
                // A client that takes all at once must not keep others waiting.
                tokio::task::coop::consume_budget().await;
            }
        }
        Ok(())
    }

    async fn send_all(self, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            bytes = &bytes[self.wait(self.stream.try_write(bytes)).await?..];
        }
        Ok(())
    }

    /// The head and pages of a file that nobody else can change.
    async fn send_pages(
        self,
        copy: &PrivateCopy,
        mut head: &[u8],
        mut range: Range<u64>,
    ) -> io::Result<()> {
        if range.end - range.start >= LONG_PAGES {
            self.send_all(head).await?;
        } else {
            while !head.is_empty() {
                let send = || private_copy::send_before_pages(self.stream, head);
                head = &head[self.try_send(send).await?..];
            }
        }
        while !range.is_empty() {
            range.start += self.try_send(|| copy.send_pages(self.stream, &range)).await? as u64;
            tokio::task::coop::consume_budget().await;
        }
        Ok(())
    }

    /// The bytes that a call of the system has sent; none, after a while, where there was no room.
    async fn try_send(self, send: impl FnOnce() -> io::Result<usize>) -> io::Result<usize> {
        self.wait(self.stream.try_io(Interest::WRITABLE, send)).await
    }

    /// The bytes that were sent; none, after a while, where there was no room.
    async fn wait(self, sent: io::Result<usize>) -> io::Result<usize> {
        match sent {
            Ok(0) => Err(io::ErrorKind::WriteZero.into()),
            Err(e) if e.kind() == io::ErrorKind::WouldBlock => {
                let room = timeout(self.limits.write_timeout, self.stream.writable());
                room.await.map_err(|_| io::Error::from(io::ErrorKind::TimedOut))??;
                Ok(0)
            }
            other => other,
        }
    }
}
