//! The body of a response: ranges of a file, read piece by piece as the client takes it.
//!
//! Pieces are read by position into recycled buffers. While the system has the bytes of a local disk in its
//! cache, that is done in place (`preadv2` with `RWF_NOWAIT`, which never waits for the disk); the rest
//! goes to the blocking pool. Whatever was read counts only if the file is unchanged afterwards, so
//! that a file which is cut short or written to is never sent as what it was. The obvious other way,
//! slices of a memory map, saves a copy, but
//!
//! - a file that is cut short under a map ends the process (`SIGBUS`) as soon as anything in the
//!   process touches the bytes; here it is one broken response;
//! - bytes that are not cached are page faults, which block a runtime thread each, step by step;
//! - a map counts as memory of the process; this server stays at 10 MB.
//!
//! Where a dataset is asked for much, plain ranges are sent without any copy: see
//! [`private_copy`](crate::private_copy). Cold, with 32 connections, ranges of 64 KiB at random places and
//! 3 GB just evicted from the cache, these reads bring 240-430 MB/s, slices of a map 31, nginx 1.22
//! 110-170 (`wrk`, loopback, two cores shared with other work).

use std::{
    future::poll_fn,
    io,
    ops::Range,
    pin::Pin,
    sync::Arc,
    task::{Context, Poll, ready},
    time::Duration,
};

use bytes::{Buf, Bytes};
use http_body::{Body, Frame, SizeHint};
use tokio::time::timeout;

use crate::{
    buffers::{Buffer, BufferPool, PIECE_BYTES},
    disk,
    file::DatasetFile,
    storage::Source,
};

/// A piece that takes longer to read never comes: the response is broken off. A piece of an object takes two
/// requests at most.
const READ_TIMEOUT: Duration = Duration::from_secs(60);

/// What a response is made of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Segment {
    /// Bytes of the server's own: the head of a part.
    Text(Bytes),
    /// A range of the file.
    File(Range<u64>),
}

impl Segment {
    pub(crate) fn len(&self) -> u64 {
        match self {
            Self::Text(text) => text.len() as u64,
            Self::File(range) => range.end - range.start,
        }
    }
}

/// Ranges of a file, with or without something in between.
pub(crate) struct FileBody {
    /// Bytes that are still to be sent.
    left: u64,
    pool: Arc<BufferPool>,
    state: State,
}

enum State {
    Ready(Rest),
    /// A piece is being read on the blocking pool.
    Reading(Reading),
    Ended,
}

/// A piece that is waited for, no longer than [`READ_TIMEOUT`], and what comes after it.
type Reading = Pin<Box<dyn Future<Output = io::Result<(Rest, io::Result<Buffer>)>> + Send>>;

/// What is still to be read.
#[derive(Debug)]
struct Rest {
    file: Arc<DatasetFile>,
    current: Segment,
    others: std::vec::IntoIter<Segment>,
}

impl FileBody {
    /// `range` lies within the file.
    pub(crate) fn new(file: Arc<DatasetFile>, range: Range<u64>, pool: Arc<BufferPool>) -> Self {
        Self::with_segments(file, Segment::File(range), Vec::new(), pool)
    }

    /// `segments`, one after the other. Ranges lie within the file.
    pub(crate) fn of(
        file: Arc<DatasetFile>,
        segments: Vec<Segment>,
        pool: Arc<BufferPool>,
    ) -> Self {
        Self::with_segments(file, Segment::Text(Bytes::new()), segments, pool)
    }

    fn with_segments(
        file: Arc<DatasetFile>,
        current: Segment,
        others: Vec<Segment>,
        pool: Arc<BufferPool>,
    ) -> Self {
        let left = current.len() + others.iter().map(Segment::len).sum::<u64>();
        let rest = Rest { file, current, others: others.into_iter() };
        Self { left, pool, state: State::Ready(rest) }
    }

    /// Bytes that are still to be sent.
    pub(crate) const fn left(&self) -> u64 {
        self.left
    }

    /// Reads a piece: in place if the system has all of it, else on the blocking pool.
    fn read_piece(&mut self, cx: &mut Context<'_>) -> Poll<io::Result<Buffer>> {
        loop {
            match std::mem::replace(&mut self.state, State::Ended) {
                State::Ready(mut rest) => {
                    let mut buffer = self.pool.take();
                    let wanted = usize::try_from(self.left).unwrap_or(usize::MAX).min(PIECE_BYTES);
                    // Nobody can change that one.
                    if rest.fill(&mut buffer, wanted, read_private_copy).is_ok() {
                        self.state = State::Ready(rest);
                        return Poll::Ready(Ok(buffer));
                    }
                    if rest.is_here() && rest.fill(&mut buffer, wanted, read_cached).is_ok() {
                        let checked = rest.check();
                        self.state = State::Ready(rest);
                        return Poll::Ready(checked.map(|()| buffer));
                    }
                    self.state = State::Reading(rest.read(buffer, wanted));
                }
                State::Reading(mut reading) => match reading.as_mut().poll(cx) {
                    Poll::Ready(Ok((rest, piece))) => {
                        self.state = State::Ready(rest);
                        return Poll::Ready(piece);
                    }
                    Poll::Ready(Err(e)) => return Poll::Ready(Err(e)),
                    Poll::Pending => {
                        self.state = State::Reading(reading);
                        return Poll::Pending;
                    }
                },
                State::Ended => return Poll::Ready(Err(io::Error::other("polled after its end"))),
            }
        }
    }

    fn path(&self) -> String {
        match &self.state {
            State::Ready(rest) => rest.file.path.display().to_string(),
            State::Reading(_) | State::Ended => "a dataset".to_owned(),
        }
    }
}

impl Rest {
    /// Whether the system can tell at once what it has of the file, and whether that is unchanged.
    fn is_here(&self) -> bool {
        self.file.is_local || matches!(self.file.source, Source::Object(_))
    }

    /// Reads a piece on the blocking pool.
    fn read(mut self, mut buffer: Buffer, wanted: usize) -> Reading {
        let (is_here, file) = (self.is_here(), Arc::clone(&self.file));
        let work = move || {
            let read = self.fill(&mut buffer, wanted, read_waiting);
            let read = read.and_then(|()| self.check());
            (self, read.map(|()| buffer))
        };
        Box::pin(async move {
            let read = async {
                if is_here { disk::on_pool(work).await } else { disk::elsewhere(work).await }
            };
            let read = timeout(READ_TIMEOUT, read).await;
            read.map_err(|_| {
                let seconds = READ_TIMEOUT.as_secs();
                let why = format!("{}: no bytes within {seconds} s", file.path.display());
                io::Error::new(io::ErrorKind::TimedOut, why)
            })
        })
    }

    /// Reads on until the buffer holds `wanted` bytes, which there are. An error leaves behind what was
    /// read before it, and goes on from there when it is called again.
    fn fill(
        &mut self,
        buffer: &mut Buffer,
        wanted: usize,
        read: impl Fn(&DatasetFile, &mut [u8], Range<u64>) -> io::Result<usize>,
    ) -> io::Result<()> {
        while buffer.filled < wanted {
            let room = &mut buffer.bytes[buffer.filled..wanted];
            match &mut self.current {
                Segment::Text(text) if text.has_remaining() => {
                    let count = text.len().min(room.len());
                    text.copy_to_slice(&mut room[..count]);
                    buffer.filled += count;
                }
                Segment::File(range) if !range.is_empty() => {
                    let left = usize::try_from(range.end - range.start).unwrap_or(usize::MAX);
                    let count = left.min(room.len());
                    let count = read(&self.file, &mut room[..count], range.clone())?;
                    range.start += count as u64;
                    buffer.filled += count;
                }
                _ => {
                    let next = self.others.next();
                    self.current = next.ok_or_else(|| io::Error::other("no more segments"))?;
                }
            }
        }
        Ok(())
    }

    /// Refuses what was read where the file was changed before: that may be blanks, or another's bytes.
    fn check(&self) -> io::Result<()> {
        match self.file.is_unchanged() {
            true => Ok(()),
            false => Err(io::Error::other("the file was changed while it was sent")),
        }
    }
}

impl FileBody {
    fn poll_piece(&mut self, cx: &mut Context<'_>) -> Poll<Option<io::Result<Buffer>>> {
        if self.left == 0 {
            return Poll::Ready(None);
        }
        let piece = ready!(self.read_piece(cx));
        match &piece {
            Ok(buffer) => self.left -= buffer.filled as u64,
            Err(e) => {
                tracing::warn!("{}: response broken off: {e}", self.path());
                self.left = 0;
            }
        }
        Poll::Ready(Some(piece))
    }

    /// The next piece.
    pub(crate) async fn next(&mut self) -> Option<io::Result<Buffer>> {
        poll_fn(|cx| self.poll_piece(cx)).await
    }
}

impl Body for FileBody {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<io::Result<Frame<Bytes>>>> {
        let piece = ready!(self.poll_piece(cx));
        let frame = |buffer| Frame::data(Bytes::from_owner(buffer));
        Poll::Ready(piece.map(|piece| piece.map(frame)))
    }

    fn is_end_stream(&self) -> bool {
        self.left == 0
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.left)
    }
}

/// Reads some bytes from the start of `rest` on, waiting for the disk; at least one.
fn read_waiting(file: &DatasetFile, buffer: &mut [u8], rest: Range<u64>) -> io::Result<usize> {
    match file.source.read(buffer, &rest)? {
        0 => {
            let message = format!("the file was cut short to {} bytes", rest.start);
            Err(io::Error::new(io::ErrorKind::UnexpectedEof, message))
        }
        count => Ok(count),
    }
}

/// Reads some bytes that can be had without waiting for the disk; at least one. Where the file system
/// cannot tell, there are none.
fn read_cached(file: &DatasetFile, buffer: &mut [u8], rest: Range<u64>) -> io::Result<usize> {
    at_least_one(file.source.read_cached(buffer, rest.start)?)
}

/// As [`read_cached`], of the file's private copy.
fn read_private_copy(file: &DatasetFile, buffer: &mut [u8], rest: Range<u64>) -> io::Result<usize> {
    let copy = file.private_copy.get();
    at_least_one(copy.map_or(Ok(0), |copy| copy.read_cached(buffer, rest.start))?)
}

fn at_least_one(count: usize) -> io::Result<usize> {
    if count == 0 { Err(io::ErrorKind::WouldBlock.into()) } else { Ok(count) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{File, OpenOptions};

    use lodestream_preprocess::FileSource;

    use crate::testing::header;

    /// A file of 64 KiB of ones behind a header.
    fn dataset(folder: &tempfile::TempDir) -> DatasetFile {
        let mut bytes = header(64 << 10).encode().to_vec();
        bytes.resize(64 << 10, 1);
        let path = folder.path().join("a.lods");
        std::fs::write(&path, bytes).expect("writable");
        DatasetFile::open(path).expect("a dataset").1
    }

    fn body(file: DatasetFile, segments: Vec<Segment>) -> FileBody {
        FileBody::of(Arc::new(file), segments, Arc::default())
    }

    #[tokio::test]
    async fn a_disk_that_fails_breaks_the_response_off() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut file = dataset(&folder);
        // A file that was opened for writing alone: every read fails, as of a disk that is broken.
        let unreadable = OpenOptions::new().write(true).open(&file.path).expect("writable");
        file.source = Source::File(FileSource::from(unreadable));
        let mut body = body(file, vec![Segment::File(0..100)]);
        assert!(body.next().await.expect("an end").is_err());
        assert!(body.next().await.is_none());
    }

    #[tokio::test(start_paused = true)]
    async fn a_read_that_never_ends_breaks_the_response_off() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let mut file = dataset(&folder);
        file.is_local = false;
        let mut body = body(file, vec![Segment::File(0..100)]);
        let hanging = disk::hang().await;
        let piece = timeout(2 * READ_TIMEOUT, body.next()).await.expect("it is given up");
        let error = piece.expect("an end").expect_err("it cannot be read");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!(body.next().await.is_none());
        drop(hanging);
    }

    #[tokio::test]
    async fn bytes_of_a_file_that_was_changed_are_not_sent() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = dataset(&folder);
        let path = file.path.clone();
        let mut body = body(file, vec![Segment::File(0..100)]);
        let cut = |length| {
            let file = OpenOptions::new().write(true).open(&path);
            file.and_then(|file: File| file.set_len(length)).expect("writable");
        };
        // As long as it was, but blank in between.
        cut(50);
        cut(64 << 10);
        assert!(body.next().await.expect("an end").is_err());
    }

    #[tokio::test]
    async fn segments_come_one_after_the_other_whatever_their_lengths() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = dataset(&folder);
        let text = |text: &'static str| Segment::Text(Bytes::from_static(text.as_bytes()));
        let mut segments = vec![text("begin"), Segment::File(64..64), text("")];
        segments.extend((0..10).map(|_| Segment::File(64..64 << 10)));
        segments.push(text("end"));
        let mut body = body(file, segments);
        let (announced, mut bytes, mut pieces) = (body.left(), Vec::new(), 0);
        while let Some(piece) = body.next().await {
            bytes.extend_from_slice(piece.expect("readable").as_ref());
            pieces += 1;
        }
        let ones = vec![1; 10 * ((64 << 10) - 64)];
        assert!(bytes == [&b"begin"[..], &ones, b"end"].concat());
        assert_eq!((announced, pieces), (bytes.len() as u64, 3));
    }
}
