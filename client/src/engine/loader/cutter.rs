//! Cuts a stream of bytes into the parts that are wanted, as soon as each is complete.
//!
//! So the first nodes of a long answer are drawn before its last have come, and what had arrived
//! before an answer broke off is kept.

use std::collections::VecDeque;

use bytes::{Buf, Bytes, BytesMut};

/// Most bytes that are reserved for a part before they have arrived.
const RESERVE_BYTES: u64 = 4 << 20;

/// Cuts a stream. Parts are given as (offset, length) by offset, without overlap.
#[derive(Debug)]
pub struct Cutter {
    /// Offset of the next byte of the stream.
    position: u64,
    parts: VecDeque<(u64, u64)>,
    /// The beginning of a part that has arrived in pieces.
    begun: BytesMut,
    done: usize,
}

impl Cutter {
    /// The stream starts with the first part.
    pub fn new(parts: impl Iterator<Item = (u64, u64)>) -> Self {
        let parts: VecDeque<_> = parts.collect();
        let position = parts.front().map_or(0, |&(offset, _)| offset);
        Self { position, parts, begun: BytesMut::new(), done: 0 }
    }

    /// Takes the next bytes; hands each completed part, by its index, to `emit`.
    pub fn push(&mut self, mut bytes: Bytes, mut emit: impl FnMut(usize, Bytes)) {
        while let Some(&(offset, len)) = self.parts.front() {
            let gap = offset.saturating_sub(self.position).min(bytes.len() as u64);
            self.advance(&mut bytes, gap);
            if bytes.is_empty() {
                return;
            }
            let missing = len - self.begun.len() as u64;
            let taken = missing.min(bytes.len() as u64);
            let complete = taken == missing;
            let part = if complete && self.begun.is_empty() {
                // Whole in one piece: no copy.
                Some(bytes.slice(..usize::try_from(taken).unwrap_or(bytes.len())))
            } else {
                if self.begun.is_empty() {
                    self.begun.reserve(usize::try_from(len.min(RESERVE_BYTES)).unwrap_or(0));
                }
                let size = usize::try_from(taken).unwrap_or(bytes.len());
                self.begun.extend_from_slice(&bytes[..size]);
                complete.then(|| self.begun.split().freeze())
            };
            self.advance(&mut bytes, taken);
            if let Some(part) = part {
                emit(self.done, part);
                self.done += 1;
                self.parts.pop_front();
            }
        }
    }

    fn advance(&mut self, bytes: &mut Bytes, count: u64) {
        // `count` is at most the length of `bytes`.
        bytes.advance(usize::try_from(count).unwrap_or(bytes.len()));
        self.position += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parts_come_out_whole_however_the_stream_is_cut(
            lens in prop::collection::vec((0u64..20, 1u64..50), 1..20),
            cuts in prop::collection::vec(1usize..70, 1..200),
        ) {
            let stream: Vec<u8> = (0..2000u32).map(|i| (i % 251) as u8).collect();
            let mut parts = Vec::new();
            let mut at = 0;
            for (gap, len) in lens {
                parts.push((at + gap, len));
                at += gap + len;
            }
            let start = parts[0].0 as usize;
            let mut rest = Bytes::from(stream[start..at as usize].to_vec());
            let mut cutter = Cutter::new(parts.iter().copied());
            let mut found = Vec::new();
            for cut in cuts.iter().cycle() {
                if rest.is_empty() {
                    break;
                }
                let piece = rest.split_to((*cut).min(rest.len()));
                cutter.push(piece, |index, bytes| found.push((index, bytes.to_vec())));
            }
            let expected: Vec<_> = parts
                .iter()
                .enumerate()
                .map(|(i, &(o, l))| (i, stream[o as usize..(o + l) as usize].to_vec()))
                .collect();
            prop_assert_eq!(found, expected);
        }
    }
}
