//! From bytes to nodes.

use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    time::Instant,
};

use bytes::Bytes;
use lodestream_protocol::{Boot, Error, HierarchyPage, Manifest, check_group, decode_group};

use super::super::{
    config::Payloads,
    event::Content,
    piece::{Part, Piece},
};

/// A decoded piece.
#[derive(Debug)]
pub enum Decoded {
    Page(HierarchyPage),
    Group(Content),
}

/// Decodes, and says how many nanoseconds that took.
pub fn decode(
    piece: &Piece,
    boot: &Boot,
    bytes: &Bytes,
    payloads: Payloads,
) -> (Result<Decoded, Error>, u64) {
    let begin = Instant::now();
    // A panic in a codec on damaged bytes would end the process from inside the pool.
    let result = catch_unwind(AssertUnwindSafe(|| match piece.id.part {
        Part::Page => boot.parse_child_page(bytes, &piece.node).map(Decoded::Page),
        Part::Group(group) => {
            let content = match payloads {
                Payloads::Decode => {
                    decode_group(&boot.manifest, group, &piece.node, bytes).map(Content::Decoded)
                }
                Payloads::Count => check_group(&piece.node, group, bytes)
                    .map(|()| Content::Counted(kept_bytes(piece, &boot.manifest))),
            };
            content.map(Decoded::Group)
        }
    }));
    let result = result.unwrap_or_else(|_| {
        Err(Error::Corrupt { what: "node", why: "the decoder gave up on these bytes".into() })
    });
    (result, u64::try_from(begin.elapsed().as_nanos()).unwrap_or(u64::MAX))
}

/// An estimate of the bytes that a piece takes once it is decoded, and until it is taken in.
pub fn decoded_bytes(piece: &Piece, manifest: &Manifest) -> u64 {
    let fine = manifest.fine.filter(|fine| piece.id.part == Part::Group(fine.group));
    let fine_bytes = fine.map_or(0, |fine| {
        size_of::<[u32; 3]>() + if fine.color { size_of::<[u16; 3]>() } else { 0 }
    });
    kept_bytes(piece, manifest) + u64::from(piece.node.points) * fine_bytes as u64
}

/// An estimate of the bytes by which a piece makes its node larger.
fn kept_bytes(piece: &Piece, manifest: &Manifest) -> u64 {
    match piece.id.part {
        Part::Page => piece.len.saturating_mul(4),
        Part::Group(group) => {
            let position = if group == 0 { size_of::<[u32; 3]>() } else { 0 };
            let columns: usize = manifest.columns_of(group).map(|a| a.value_bytes()).sum();
            u64::from(piece.node.points) * (position + columns) as u64
        }
    }
}
