//! Line-aligned chunks of a text file, so that lines can be parsed in parallel.

use std::io::Read;

/// Bytes of text in a chunk, about: some 50,000 points.
pub(in crate::readers) const CHUNK_BYTES: usize = 2 << 20;

/// A line longer than this is not one of a point cloud.
const MAX_LINE_BYTES: usize = 16 << 20;

/// Whole lines.
#[derive(Debug, PartialEq, Eq)]
pub(in crate::readers) struct Chunk {
    /// Number of the first line, counted from 1 at the start of the file.
    pub first_line: u64,
    /// The lines, with their terminators (the file's last line may lack it).
    pub bytes: Vec<u8>,
}

/// Cuts a text into chunks of whole lines.
pub(in crate::readers) struct LineChunks<R> {
    source: R,
    terminator: u8,
    next_line: u64,
    chunk_bytes: usize,
    /// Start of a line whose end has not been read yet.
    carry: Vec<u8>,
    ended: bool,
}

/// Why there is no next chunk.
#[derive(Debug)]
pub(in crate::readers) enum ChunkError {
    /// Reading failed.
    Io(std::io::Error),
    /// The line of that number does not end within 16 MiB.
    EndlessLine(u64),
}

impl<R: Read> LineChunks<R> {
    /// Cuts what `source` gives from here on; its first line has the number `first_line`.
    pub fn new(source: R, terminator: u8, first_line: u64) -> Self {
        Self {
            source,
            terminator,
            next_line: first_line,
            chunk_bytes: CHUNK_BYTES,
            carry: Vec::new(),
            ended: false,
        }
    }

    /// The next chunk, `None` at the end. Never empty.
    ///
    /// # Errors
    /// See [`ChunkError`].
    pub fn next_chunk(&mut self) -> Result<Option<Chunk>, ChunkError> {
        let mut bytes = std::mem::take(&mut self.carry);
        let mut wanted = self.chunk_bytes;
        loop {
            if !self.ended && bytes.len() < wanted {
                let missing = wanted - bytes.len();
                bytes.reserve_exact(missing);
                let limit = u64::try_from(missing).unwrap_or(u64::MAX);
                let read = (&mut self.source).take(limit).read_to_end(&mut bytes);
                self.ended = read.map_err(ChunkError::Io)? < missing;
            }
            if self.ended {
                break;
            }
            if let Some(last) = memchr::memrchr(self.terminator, &bytes) {
                self.carry = bytes.split_off(last + 1);
                break;
            }
            if bytes.len() >= MAX_LINE_BYTES {
                return Err(ChunkError::EndlessLine(self.next_line));
            }
            wanted = 2 * bytes.len();
        }
        if bytes.is_empty() {
            return Ok(None);
        }
        let first_line = self.next_line;
        let terminators = memchr::memchr_iter(self.terminator, &bytes).count();
        self.next_line += u64::try_from(terminators).unwrap_or(u64::MAX);
        Ok(Some(Chunk { first_line, bytes }))
    }
}

/// The lines of a chunk, without terminators.
pub(in crate::readers) fn lines(bytes: &[u8], terminator: u8) -> impl Iterator<Item = &[u8]> {
    let mut rest = bytes;
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let end = memchr::memchr(terminator, rest).unwrap_or(rest.len());
        let line = &rest[..end];
        rest = rest.get(end + 1..).unwrap_or_default();
        Some(line)
    })
}

/// Whether a line holds nothing but blanks.
pub(in crate::readers) fn is_blank(line: &[u8]) -> bool {
    line.iter().all(|&byte| is_blank_byte(byte))
}

/// Blanks between fields; a carriage return before a line feed is one.
pub(in crate::readers) const fn is_blank_byte(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\n' | 0x0b | 0x0c)
}

/// The byte that ends lines, told from the first line end in `text`: a line feed (with or without
/// a carriage return before it), or a lone carriage return as old Macintoshes wrote it.
pub(in crate::readers) fn terminator_of(text: &[u8]) -> u8 {
    match memchr::memchr2(b'\n', b'\r', text) {
        Some(at) if text[at] == b'\r' && text.get(at + 1) != Some(&b'\n') => b'\r',
        _ => b'\n',
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn chunks(text: &[u8], chunk_bytes: usize) -> Vec<Chunk> {
        let mut source = LineChunks::new(text, b'\n', 1);
        source.chunk_bytes = chunk_bytes;
        std::iter::from_fn(|| source.next_chunk().expect("memory can be read")).collect()
    }

    #[test]
    fn tells_the_line_terminator_from_the_first_line_end() {
        assert_eq!(terminator_of(b"ply\nformat\r"), b'\n');
        assert_eq!(terminator_of(b"ply\r\nformat"), b'\n');
        assert_eq!(terminator_of(b"ply\rformat\n"), b'\r');
        assert_eq!(terminator_of(b"1 2 3"), b'\n');
    }

    #[test]
    fn an_endless_line_is_refused_by_its_number() {
        let mut text = b"1 2 3\n".to_vec();
        text.resize(MAX_LINE_BYTES + CHUNK_BYTES, b'7');
        let mut source = LineChunks::new(&text[..], b'\n', 10);
        assert_eq!(source.next_chunk().expect("a chunk").expect("a line").bytes, b"1 2 3\n");
        assert!(matches!(source.next_chunk(), Err(ChunkError::EndlessLine(11))));
    }

    proptest! {
        #[test]
        fn chunks_hold_every_line_once_and_number_it_rightly(
            lines_in in proptest::collection::vec("[a-c]{0,12}", 0..40),
            last_terminated: bool,
            chunk_bytes in 1_usize..64,
        ) {
            let mut text = lines_in.join("\n");
            if last_terminated {
                text.push('\n');
            }
            let chunks = chunks(text.as_bytes(), chunk_bytes);
            let joined: Vec<u8> = chunks.iter().flat_map(|c| c.bytes.clone()).collect();
            prop_assert_eq!(&joined, text.as_bytes());
            let mut line = 1;
            for (i, chunk) in chunks.iter().enumerate() {
                prop_assert_eq!(chunk.first_line, line);
                prop_assert!(i + 1 == chunks.len() || chunk.bytes.ends_with(b"\n"));
                line += lines(&chunk.bytes, b'\n').count() as u64;
            }
            let expected: Vec<&str> = text.lines().collect();
            let found: Vec<&[u8]> = lines(text.as_bytes(), b'\n').collect();
            prop_assert_eq!(found, expected.iter().map(|l| l.as_bytes()).collect::<Vec<_>>());
        }
    }
}
