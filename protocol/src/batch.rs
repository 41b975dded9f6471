//! Batches: many parts of a dataset by one request.
//!
//! A *part* is a range of bytes: a node's payload of one column group or a hierarchy page, named by
//! the place that the tree tells for it. So the server need not know the tree, and any of several
//! servers answers alike. The response is a head and, in the order of the request, a frame for every
//! part; `docs/PROTOCOL.md` specifies both.

use crate::{
    error::{Error, Result, corrupt},
    wire::WireBatch,
};

/// Media type of a request's body.
pub const BATCH_REQUEST_TYPE: &str = "application/vnd.lodestream.batch-request";
/// Media type of a response's body.
pub const BATCH_TYPE: &str = "application/vnd.lodestream.batch";
/// Most parts of a request.
pub const MAX_BATCH_PARTS: usize = 4096;
/// Most bytes of all parts of a request together.
pub const MAX_BATCH_BYTES: u64 = 64 << 20;
/// Most bytes of a request's body: as many parts as there may be, each as long as can be.
pub const MAX_BATCH_REQUEST_BYTES: usize = 64 << 10;
/// Length of a response's head.
pub const BATCH_HEAD_BYTES: usize = 24;
/// Length of the head of a frame.
pub const FRAME_HEAD_BYTES: usize = 8;

/// First bytes of a response; the last is the version.
const MAGIC: [u8; 8] = *b"LODB\r\n\x1a\x01";

/// A range of the dataset file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BatchPart {
    /// File offset in bytes.
    pub offset: u64,
    /// Length in bytes, not 0.
    pub bytes: u32,
}

/// What a client asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BatchRequest {
    /// The dataset that the client knows: it must not be sent parts of another.
    pub content_id: [u8; 16],
    /// In the order in which they are to come.
    pub parts: Vec<BatchPart>,
}

impl BatchRequest {
    /// The request's body.
    ///
    /// # Errors
    /// [`Error::Corrupt`] where a limit is broken.
    pub fn encode(&self) -> Result<Vec<u8>> {
        self.check()?;
        let parts = self.parts.iter().map(|part| (part.offset, part.bytes)).collect();
        WireBatch { content_id: self.content_id, parts }.encode()
    }

    /// Undoes [`encode`](Self::encode).
    ///
    /// # Errors
    /// [`Error::Corrupt`] where the bytes are no request or a limit is broken.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let WireBatch { content_id, parts } = WireBatch::decode(bytes)?;
        let part = |(offset, bytes)| BatchPart { offset, bytes };
        let request = Self { content_id, parts: parts.into_iter().map(part).collect() };
        request.check()?;
        Ok(request)
    }

    /// Length of the response's body.
    #[must_use]
    pub fn response_bytes(&self) -> u64 {
        let frame = |part: &BatchPart| FRAME_HEAD_BYTES as u64 + u64::from(part.bytes);
        BATCH_HEAD_BYTES as u64 + self.parts.iter().map(frame).sum::<u64>()
    }

    fn check(&self) -> Result<()> {
        let fail = |why: String| Err(corrupt("batch request", why));
        let count = self.parts.len();
        if count == 0 || count > MAX_BATCH_PARTS {
            return fail(format!("{count} parts; there may be 1 to {MAX_BATCH_PARTS}"));
        }
        if let Some(index) = self.parts.iter().position(|part| part.bytes == 0) {
            return fail(format!("part {index} is empty"));
        }
        let total: u64 = self.parts.iter().map(|part| u64::from(part.bytes)).sum();
        if total > MAX_BATCH_BYTES {
            return fail(format!("{total} bytes in all parts; there may be {MAX_BATCH_BYTES}"));
        }
        Ok(())
    }
}

/// The head of a response about the dataset of that content.
#[must_use]
pub fn batch_head(content_id: &[u8; 16]) -> [u8; BATCH_HEAD_BYTES] {
    let mut head = [0; BATCH_HEAD_BYTES];
    head[..8].copy_from_slice(&MAGIC);
    head[8..].copy_from_slice(content_id);
    head
}

/// The head of the frame that brings the part of that index in the request, of that length.
#[must_use]
pub fn frame_head(index: u32, bytes: u32) -> [u8; FRAME_HEAD_BYTES] {
    let mut head = [0; FRAME_HEAD_BYTES];
    head[..4].copy_from_slice(&index.to_le_bytes());
    head[4..].copy_from_slice(&bytes.to_le_bytes());
    head
}

/// Takes a response apart as it arrives. Copies no payload and keeps none.
#[derive(Debug, Clone)]
pub struct BatchDecoder {
    content_id: [u8; 16],
    parts: std::vec::IntoIter<BatchPart>,
    /// Index of the part that is coming or comes next.
    index: u32,
    /// Payload bytes of it that are still to come.
    left: u32,
    /// A head of which only the beginning has come.
    head: [u8; BATCH_HEAD_BYTES],
    head_filled: usize,
    is_begun: bool,
}

/// What the next bytes of a response are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BatchStep {
    /// How many bytes this is about.
    pub bytes: usize,
    /// Whether they belong to a part, the next in order; else they are (part of) a head.
    pub is_payload: bool,
}

impl BatchDecoder {
    /// For the response to `request`.
    #[must_use]
    pub fn new(request: BatchRequest) -> Self {
        Self {
            content_id: request.content_id,
            parts: request.parts.into_iter(),
            index: 0,
            left: 0,
            head: [0; BATCH_HEAD_BYTES],
            head_filled: 0,
            is_begun: false,
        }
    }

    /// Tells what the first bytes of `input` are, which follows upon what came before. Where there is
    /// input, it is about one byte at least.
    ///
    /// # Errors
    /// [`Error::Corrupt`] where that is no answer to the request.
    pub fn step(&mut self, input: &[u8]) -> Result<BatchStep> {
        if self.left > 0 {
            let bytes = input.len().min(self.left as usize);
            self.left -= bytes as u32;
            return Ok(BatchStep { bytes, is_payload: true });
        }
        let wanted = if self.is_begun { FRAME_HEAD_BYTES } else { BATCH_HEAD_BYTES };
        if self.is_complete() && !input.is_empty() {
            return Err(corrupt("batch", "bytes follow its last part"));
        }
        let bytes = input.len().min(wanted - self.head_filled);
        self.head[self.head_filled..self.head_filled + bytes].copy_from_slice(&input[..bytes]);
        self.head_filled += bytes;
        if self.head_filled == wanted {
            self.head_filled = 0;
            if self.is_begun { self.begin_frame()? } else { self.begin()? }
        }
        Ok(BatchStep { bytes, is_payload: false })
    }

    /// Whether every part has come.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.is_begun && self.left == 0 && self.head_filled == 0 && self.parts.len() == 0
    }

    fn begin(&mut self) -> Result<()> {
        if self.head[..4] != MAGIC[..4] {
            return Err(corrupt("batch", "it does not start with the LODB signature"));
        }
        if self.head[..8] != MAGIC {
            return Err(corrupt("batch", format!("version {} is not known", self.head[7])));
        }
        if self.head[8..] != self.content_id {
            return Err(corrupt("batch", "it is of another dataset"));
        }
        self.is_begun = true;
        Ok(())
    }

    fn begin_frame(&mut self) -> Result<()> {
        let [a, b, c, d, e, f, g, h, ..] = self.head;
        let (index, bytes) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
        let part =
            self.parts.next().ok_or_else(|| corrupt("batch", "more parts than asked for"))?;
        if (index, bytes) != (self.index, part.bytes) {
            let why = format!(
                "a frame brings part {index} with {bytes} bytes, not part {} with {}",
                self.index, part.bytes
            );
            return Err(Error::Corrupt { what: "batch", why });
        }
        self.index += 1;
        self.left = bytes;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn request(parts: &[(u64, u32)]) -> BatchRequest {
        let parts = parts.iter().map(|&(offset, bytes)| BatchPart { offset, bytes }).collect();
        BatchRequest { content_id: *b"0123456789abcdef", parts }
    }

    fn response(request: &BatchRequest) -> (Vec<u8>, Vec<u8>) {
        let mut response = batch_head(&request.content_id).to_vec();
        let mut payload = Vec::new();
        for (index, part) in request.parts.iter().enumerate() {
            response.extend(frame_head(index as u32, part.bytes));
            let bytes: Vec<_> =
                (0..part.bytes).map(|i| (part.offset + u64::from(i)) as u8).collect();
            response.extend(&bytes);
            payload.extend(&bytes);
        }
        (response, payload)
    }

    /// What the decoder takes for payload.
    fn decode(decoder: &mut BatchDecoder, mut input: &[u8]) -> Result<Vec<u8>> {
        let mut payload = Vec::new();
        while !input.is_empty() {
            let step = decoder.step(input)?;
            let (now, rest) = input.split_at(step.bytes);
            if step.is_payload {
                payload.extend(now);
            }
            input = rest;
        }
        Ok(payload)
    }

    #[test]
    fn limits_are_those_of_the_specification() {
        assert!(request(&[]).encode().is_err());
        assert!(request(&[(0, 0)]).encode().is_err());
        assert!(request(&vec![(u64::MAX, 1); MAX_BATCH_PARTS + 1]).encode().is_err());
        let half = (MAX_BATCH_BYTES / 2) as u32;
        assert!(request(&[(0, half), (0, half)]).encode().is_ok());
        assert!(request(&[(0, half), (0, half), (0, 1)]).encode().is_err());
        let longest = request(&vec![(u64::MAX, 1 << 14); MAX_BATCH_PARTS]).encode();
        assert!(longest.expect("within the limits").len() <= MAX_BATCH_REQUEST_BYTES);
    }

    #[test]
    fn the_example_of_the_specification_is_what_is_sent() {
        let text = include_str!("../../docs/PROTOCOL.md");
        let (_, example) = text.split_once("### Example").expect("the example");
        let is_hex = |word: &&str| word.len() == 2 && word.bytes().all(|b| b.is_ascii_hexdigit());
        let blocks: Vec<Vec<u8>> = example
            .split("\n\n")
            .filter(|block| block.starts_with("    "))
            .map(|block| {
                let words = block.split_whitespace().filter(is_hex);
                words.map(|word| u8::from_str_radix(word, 16).expect("hexadecimal")).collect()
            })
            .collect();
        let [body, response] = &blocks[..] else { panic!("{} blocks", blocks.len()) };
        let content_id = std::array::from_fn(|i| i as u8);
        let asked = BatchRequest { content_id, ..request(&[(1000, 3), (64, 2)]) };
        assert_eq!(asked.encode().as_ref(), Ok(body));
        assert_eq!(BatchRequest::decode(body).as_ref(), Ok(&asked));
        let mut decoder = BatchDecoder::new(asked);
        let payload = decode(&mut decoder, response).expect("a good answer");
        assert_eq!(payload, [0xAA, 0xBB, 0xCC, 0xDD, 0xEE]);
        assert!(decoder.is_complete());
        assert_eq!(response[..BATCH_HEAD_BYTES], batch_head(&content_id));
        assert_eq!(response[24..32], frame_head(0, 3));
    }

    #[test]
    fn another_answer_is_refused() {
        let asked = request(&[(0, 3), (100, 2)]);
        let (good, _) = response(&asked);
        let refused = |bytes: &[u8]| {
            decode(&mut BatchDecoder::new(asked.clone()), bytes).expect_err("no answer").to_string()
        };
        let with = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            bytes
        };
        assert!(refused(&with(0, b'X')).contains("signature"));
        assert!(refused(&with(7, 2)).contains("version 2"));
        assert!(refused(&with(8, b'X')).contains("another dataset"));
        assert!(refused(&with(24, 1)).contains("part 1 with 3 bytes, not part 0 with 3"));
        assert!(refused(&with(28, 4)).contains("part 0 with 4 bytes"));
        assert!(refused(&[&good[..], b"x"].concat()).contains("last part"));
        let mut decoder = BatchDecoder::new(asked.clone());
        decode(&mut decoder, &good[..good.len() - 1]).expect("so far good");
        assert!(!decoder.is_complete());
    }

    proptest! {
        #[test]
        fn requests_and_responses_come_back(
            parts in prop::collection::vec((any::<u64>(), 1u32..200), 1..30),
            cuts in prop::collection::vec(1usize..60, 1..200),
        ) {
            let asked = request(&parts);
            let body = asked.encode().expect("within the limits");
            prop_assert_eq!(&BatchRequest::decode(&body).expect("just encoded"), &asked);
            let (bytes, payload) = response(&asked);
            prop_assert_eq!(bytes.len() as u64, asked.response_bytes());
            let mut decoder = BatchDecoder::new(asked);
            let (mut rest, mut found) = (&bytes[..], Vec::new());
            for cut in cuts.into_iter().cycle() {
                if rest.is_empty() {
                    break;
                }
                prop_assert!(!decoder.is_complete());
                let (now, later) = rest.split_at(cut.min(rest.len()));
                found.extend(decode(&mut decoder, now).expect("a good answer"));
                rest = later;
            }
            prop_assert_eq!(found, payload);
            prop_assert!(decoder.is_complete());
        }
    }
}
