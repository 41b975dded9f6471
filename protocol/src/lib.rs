//! What the two sides of lodestream agree on: the dataset file.
//!
//! A dataset is one immutable file that any host answering byte ranges can serve. `FORMAT.md`
//! specifies every byte; this crate is its one implementation. It knows no async runtime, no GPU
//! and no file system: readers hand it bytes, writers take bytes from it.
//!
//! The way through the crate: [`Boot`] (first bytes: header, [`Manifest`], root page) →
//! [`HierarchyPage`] (the tree, page by page, as [`Node`]s) → [`decode_group`] (one node's
//! columns). [`Dataset`] walks that way synchronously over any [`ReadAt`].

mod attribute;
mod batch;
mod boot;
mod color;
mod column;
mod dataset;
mod error;
mod hierarchy;
mod key;
mod lattice;
mod manifest;
mod morton;
mod normal_cone;
mod position;
mod wire;

pub use attribute::{Attribute, Domain, ScalarType, Storage};
pub use batch::{
    BATCH_HEAD_BYTES, BATCH_REQUEST_TYPE, BATCH_TYPE, BatchDecoder, BatchPart, BatchRequest,
    BatchStep, FRAME_HEAD_BYTES, MAX_BATCH_BYTES, MAX_BATCH_PARTS, MAX_BATCH_REQUEST_BYTES,
    batch_head, frame_head,
};
pub use boot::{
    BOOT_SPECULATIVE_BYTES, Boot, HEADER_BYTES, Header, MAGIC, VERSION_MAJOR, VERSION_MINOR,
};
pub use color::{COARSE_COLOR_BITS, FineColors, encode_colors, is_color, is_partable_color};
pub use column::{
    Column, DecodedGroup, Encoding, check_group, decode_group, decode_unchecked, encode_column,
};
pub use dataset::{Dataset, NodePoints, ReadAt};
pub use error::{Error, Result};
pub use hierarchy::{HierarchyPage, MAX_NODE_POINTS, Node, PageRef, PayloadRef};
pub use key::NodeKey;
pub use lattice::{Lattice, LatticeBox, MAX_SIDE_BITS};
pub use manifest::{Fine, GroupInfo, Manifest, Method, Primitive, Refinement, SourceInfo};
pub use morton::{MortonCode, morton_decode, morton_encode};
pub use normal_cone::NormalCone;
pub use position::{FinePositions, encode_cells, encode_fine_positions, encode_positions};
pub use wire::MAX_PAGE_BYTES;
