//! Inputs of the target `signature`.

use crate::{join_counted, split_counted};

/// A right to be signed, and what becomes of its address on the way.
#[derive(Debug, Clone, Copy)]
pub struct LinkInput<'a> {
    /// Datasets, as a rule names them.
    pub datasets: &'a str,
    /// In seconds since 1970.
    pub expires: u64,
    /// Three bytes each: where, what is done (replaced, put in, taken out), with which byte.
    pub edits: &'a [u8],
    /// What is put behind it.
    pub suffix: &'a [u8],
}

impl<'a> LinkInput<'a> {
    /// Reads what the fuzzer made; `None` where it names no datasets.
    #[must_use]
    pub fn parse(data: &'a [u8]) -> Option<Self> {
        let (datasets, rest) = split_counted(data)?;
        let (expires, rest) = rest.split_first_chunk()?;
        let (edits, suffix) = split_counted(rest)?;
        let datasets = std::str::from_utf8(datasets).ok()?;
        Some(Self { datasets, expires: u64::from_le_bytes(*expires), edits, suffix })
    }

    /// Undoes [`Self::parse`]; `None` where something is too long for it.
    #[must_use]
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        let rest = join_counted(self.edits, self.suffix)?;
        join_counted(self.datasets.as_bytes(), &[&self.expires.to_le_bytes(), &rest[..]].concat())
    }

    /// The query of the signed address, altered.
    #[must_use]
    pub fn alter(&self, query: &str) -> String {
        let mut bytes = query.as_bytes().to_vec();
        for edit in self.edits.as_chunks().0 {
            let &[place, what, byte] = edit;
            let place = usize::from(place) % bytes.len().max(1);
            match what % 3 {
                0 if !bytes.is_empty() => bytes[place] = byte,
                1 if !bytes.is_empty() => _ = bytes.remove(place),
                _ => bytes.insert(place, byte),
            }
        }
        bytes.extend_from_slice(self.suffix);
        String::from_utf8_lossy(&bytes).into_owned()
    }
}
