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

/// Answers from this length on leave as pages of the file, rather than as bytes that were read of it.
///
/// What a copy costs hangs on the machine. On one, bytes of 64 KiB brought a quarter more requests than pages, and took 1.2
/// times the server's time at 1 MiB; on another, a tenth fewer, and 2.5 times. Pages, sent as here, were level with nginx or better on both.
/// Of 4 KiB, bytes brought a sixth more on the one and as many on the other.
const PAGES: u64 = 8 << 10;

/// What a packet holds of an answer beside its head where packets are largest, within the machine: 64 KiB for both.
const FIRST_PACKET: u64 = 60 << 10;

/// Answers whose heads do not wait.
const HEAD_ALONE: Range<u64> = 80 << 10..240 << 10;

/// How many of the first bytes of an answer of so many its head waits for, so that they share a packet.
///
/// A head alone costs one packet more. What is worse, the client's system takes the moment between
/// it and the next packet for the time that the way takes, and offers little room: 0.2 to 0.5 MB (1 MiB over
/// 16 connections; 2 to 5 where a head waits for all), of which there was none left 97 % of the time. But where two to four packets make an answer, a client
/// that has the head already is the sooner done. Requests a second beside nginx, whose heads go alone, over 16 and 256 connections
/// (`wrk` on a processor of its own, BBR, medians of 5 turns):
///
/// | KiB | head alone | with the first packet | with all |
/// | --- | --- | --- | --- |
/// | 32 | 1.06, 0.95 | 1.25, 1.11 | |
/// | 64 | 1.02, 1.00 | 1.15, 1.09 | 0.89, 1.15 |
/// | 96 | 1.00, 0.97 | 0.90, 0.93 | 0.98, 0.97 |
/// | 128 | 1.01, 0.96 | 0.78, 1.03 | 0.88, 0.87 |
/// | 192 | 0.99, 0.97 | 0.82, 0.93 | 0.87, 1.10 |
/// | 256 | 0.96, 1.00 | 1.07, 1.37 | 1.09, 1.33 |
/// | 512 | 1.02, 1.08 | 1.20, 1.27 | 1.79, 1.61 |
/// | 1024 | 1.01, 0.93 | 1.20, 1.37 | 1.68, 1.03 |
///
/// Waiting for all brings most where clients ask as fast as they are answered, and makes those wait who do not: 0.30 ms for
/// 256 KiB, not 0.20 (medians at 4,900 requests a second over 256 connections; nginx 0.20).
fn beside_head(length: u64) -> u64 {
    if HEAD_ALONE.contains(&length) { 0 } else { length.min(FIRST_PACKET) }
}

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
        match file.private_copy.get() {
            None => private_copy::count(file, length, &site.private_copies),
            Some(copy) if length >= PAGES && copy.is_cached(range) => {
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
        let first = range.start..range.start + beside_head(range.end - range.start);
        if first.is_empty() {
            self.send_all(head).await?;
        } else {
            while !head.is_empty() {
                let send = || private_copy::send_before_pages(self.stream, head);
                head = &head[self.try_send(send).await?..];
            }
        }
        while !range.is_empty() {
            let end = if first.contains(&range.start) { first.end } else { range.end };
            let part = range.start..end;
            range.start += self.try_send(|| copy.send_pages(self.stream, &part)).await? as u64;
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
