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
mod boot;
mod column;
mod dataset;
mod error;
mod hierarchy;
mod key;
mod lattice;
mod manifest;
mod morton;
mod normal_cone;
mod wire;

pub use attribute::{Attribute, Domain, ScalarType, Storage};
pub use boot::{
    BOOT_SPECULATIVE_BYTES, Boot, HEADER_BYTES, Header, MAGIC, VERSION_MAJOR, VERSION_MINOR,
};
pub use column::{
    Column, DecodedGroup, Encoding, check_group, decode_group, decode_unchecked, encode_column,
    encode_positions,
};
pub use dataset::{Dataset, NodePoints, ReadAt};
pub use error::{Error, Result};
pub use hierarchy::{HierarchyPage, MAX_NODE_POINTS, Node, PageRef, PayloadRef};
pub use key::NodeKey;
pub use lattice::{Lattice, LatticeBox, MAX_SIDE_BITS};
pub use manifest::{GroupInfo, Manifest, Method, Primitive, Refinement, SourceInfo};
pub use morton::{MortonCode, morton_decode, morton_encode};
pub use normal_cone::NormalCone;
pub use wire::MAX_PAGE_BYTES;
