//! The one place that knows bincode.
//!
//! bincode has ended its development: 2.0.1 is pinned, its use stays in this file, and golden bytes
//! in the tests hold its output still. The encoding is `bincode 2`, standard configuration:
//! little-endian, variable-length integers, sequences prefixed by their length.

use bincode::{
    Decode, Encode,
    config::{Configuration, Limit, LittleEndian, Varint, standard},
};

use crate::{
    batch::MAX_BATCH_REQUEST_BYTES,
    error::{Result, corrupt},
};

/// No page is larger than this, so a lying length cannot make a reader allocate more.
pub const MAX_PAGE_BYTES: usize = 64 << 20;

fn config() -> Configuration<LittleEndian, Varint, Limit<MAX_PAGE_BYTES>> {
    standard().with_limit::<MAX_PAGE_BYTES>()
}

/// A hierarchy page as it lies in the file: a structure of arrays over its nodes in breadth-first
/// order. `payload_bytes` and `payload_crcs` are node-major (all groups of node 0, of node 1, …).
#[derive(Debug, Clone, PartialEq, Default, Encode, Decode)]
pub struct WirePage {
    pub group_offsets: Vec<u64>,
    pub child_masks: Vec<u8>,
    pub points: Vec<u32>,
    pub bounds: Vec<[u8; 6]>,
    pub geometric_errors: Vec<f32>,
    pub spacings: Vec<f32>,
    pub normal_cones: Vec<[u8; 3]>,
    pub payload_bytes: Vec<u32>,
    pub payload_crcs: Vec<[u8; 4]>,
    pub child_pages: Vec<WirePageRef>,
}

/// Where the children of a page's node are described.
#[derive(Debug, Clone, Copy, PartialEq, Encode, Decode)]
pub struct WirePageRef {
    pub node: u32,
    pub offset: u64,
    pub bytes: u32,
    pub nodes: u32,
    pub crc: [u8; 4],
}

impl WirePage {
    /// The page's bytes.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let bytes = bincode::encode_to_vec(self, config())
            .map_err(|e| corrupt("hierarchy page", e.to_string()))?;
        if bytes.len() > MAX_PAGE_BYTES {
            return Err(corrupt("hierarchy page", format!("{} bytes are too many", bytes.len())));
        }
        Ok(bytes)
    }

    /// Undoes [`encode`](Self::encode); every byte must be used.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let (page, used) = bincode::decode_from_slice::<Self, _>(bytes, config())
            .map_err(|e| corrupt("hierarchy page", e.to_string()))?;
        if used != bytes.len() {
            return Err(corrupt(
                "hierarchy page",
                format!("{} of {} bytes used", used, bytes.len()),
            ));
        }
        Ok(page)
    }
}

/// Enough for what the longest request takes once it is decoded.
const MAX_DECODED_BATCH_BYTES: usize = 2 * MAX_BATCH_REQUEST_BYTES;

/// A batch request as it is sent: the dataset's identity, then offset and length of every part.
#[derive(Debug, Clone, PartialEq, Eq, Encode, Decode)]
pub struct WireBatch {
    pub content_id: [u8; 16],
    pub parts: Vec<(u64, u32)>,
}

impl WireBatch {
    /// The request's bytes.
    pub fn encode(&self) -> Result<Vec<u8>> {
        bincode::encode_to_vec(self, config()).map_err(|e| corrupt("batch request", e.to_string()))
    }

    /// Undoes [`encode`](Self::encode); every byte must be used.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        if bytes.len() > MAX_BATCH_REQUEST_BYTES {
            return Err(corrupt("batch request", format!("{} bytes are too many", bytes.len())));
        }
        let config = standard().with_limit::<MAX_DECODED_BATCH_BYTES>();
        let (batch, used) = bincode::decode_from_slice::<Self, _>(bytes, config)
            .map_err(|e| corrupt("batch request", e.to_string()))?;
        if used != bytes.len() {
            return Err(corrupt("batch request", format!("{used} of {} bytes used", bytes.len())));
        }
        Ok(batch)
    }
}
