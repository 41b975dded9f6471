//! From an answer to the socket.

use std::{
    io::{self, IoSlice},
    ops::Range,
    sync::Arc,
};

use lodestream_protocol::{BatchRequest, batch_head, frame_head};
use tokio::{io::Interest, net::TcpStream, time::timeout};

use super::answer::{Answer, Content};
use crate::{
    body::FileBody,
    connection::ConnectionLimits,
    private_copy::{self, PrivateCopy},
    routes::{Site, batch_segments},
};

/// From this length on, sending pages is less work than copying bytes.
const SENDFILE_BYTES: u64 = 32 << 10;

/// Sends head and content.
pub(super) async fn send(
    stream: &TcpStream,
    site: &Arc<Site>,
    answer: &Answer,
    head: &[u8],
    limits: ConnectionLimits,
) -> io::Result<()> {
    let socket = Socket { stream, limits };
    let (file, length) = (&answer.file, answer.len());
    if length >= SENDFILE_BYTES {
        match file.private_copy.get() {
            None => private_copy::count(file, length, &site.private_copies),
            Some(copy) => match &answer.content {
                Content::Range(range) if copy.is_cached(range) => {
                    socket.send_more(copy, head).await?;
                    return socket.send_pages(copy, range.clone()).await;
                }
                Content::Batch(batch)
                    if batch.parts.iter().all(|part| copy.is_begun(part.offset)) =>
                {
                    return socket.send_batch(copy, head, batch).await;
                }
                _ => {}
            },
        }
    }
    let (file, pool) = (Arc::clone(file), Arc::clone(&site.buffers));
    let body = match &answer.content {
        Content::Range(range) => FileBody::new(file, range.clone(), pool),
        Content::Batch(batch) => FileBody::of(file, batch_segments(batch), pool),
    };
    socket.send_body(head, body).await
}

/// The client's end, and its patience.
#[derive(Clone, Copy)]
struct Socket<'a> {
    stream: &'a TcpStream,
    limits: ConnectionLimits,
}

impl Socket<'_> {
    /// Bytes that were read, together with the head.
    async fn send_body(self, mut head: &[u8], mut body: FileBody) -> io::Result<()> {
        while let Some(piece) = body.next().await {
            let piece = piece?;
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
            }
        }
        Ok(())
    }

    /// Frames, whose payloads the system sends.
    async fn send_batch(
        self,
        copy: &PrivateCopy,
        head: &[u8],
        batch: &BatchRequest,
    ) -> io::Result<()> {
        // Packets are filled up, whatever the lengths of parts.
        copy.hold_back(self.stream, true)?;
        self.send_more(copy, head).await?;
        self.send_more(copy, &batch_head(&batch.content_id)).await?;
        for (index, part) in (0..).zip(&batch.parts) {
            self.send_more(copy, &frame_head(index, part.bytes)).await?;
            self.send_pages(copy, part.offset..part.offset + u64::from(part.bytes)).await?;
        }
        copy.hold_back(self.stream, false)
    }

    /// Bytes that wait for what follows, so that they share a packet with it.
    async fn send_more(self, copy: &PrivateCopy, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            let send = || copy.send_more(self.stream, bytes);
            bytes = &bytes[self.wait(self.stream.try_io(Interest::WRITABLE, send)).await?..];
        }
        Ok(())
    }

    /// Pages of a file that nobody else can change.
    async fn send_pages(self, copy: &PrivateCopy, mut range: Range<u64>) -> io::Result<()> {
        while !range.is_empty() {
            let send = || copy.send_pages(self.stream, &range);
            let sent = self.wait(self.stream.try_io(Interest::WRITABLE, send)).await?;
            range.start += sent as u64;
        }
        Ok(())
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
