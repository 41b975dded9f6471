//! Inputs of the targets `boot` and `hierarchy`.

use lodestream_protocol::{
    Boot, HEADER_BYTES, Header, HierarchyPage, Manifest, Node, PageRef, Result,
};

use crate::{join_counted, manifest, split_counted};

/// Input of `boot`: a manifest and a root page, to be put behind a sound header.
///
/// Bytes: length of the manifest (u16), manifest, page.
#[derive(Debug)]
pub struct BootInput<'a> {
    /// The manifest's JSON.
    pub manifest: &'a [u8],
    /// The root hierarchy page.
    pub page: &'a [u8],
}

impl<'a> BootInput<'a> {
    /// Takes the fuzzer's bytes apart.
    #[must_use]
    pub fn parse(data: &'a [u8]) -> Option<Self> {
        split_counted(data).map(|(manifest, page)| Self { manifest, page })
    }

    /// Undoes [`parse`](Self::parse).
    #[must_use]
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        join_counted(self.manifest, self.page)
    }

    /// The first bytes of a file with this manifest and page, and with right lengths and checksums.
    #[must_use]
    pub fn seal(&self) -> Option<Vec<u8>> {
        let index = [self.manifest, self.page].concat();
        let index_bytes = (HEADER_BYTES + index.len()) as u64;
        let header = Header {
            version: (1, 0),
            manifest_bytes: u32::try_from(self.manifest.len()).ok()?,
            root_page_bytes: u32::try_from(self.page.len()).ok()?,
            boot_bytes: index_bytes,
            file_bytes: index_bytes,
            content_id: [0; 16],
            index_crc: crc32fast::hash(&index),
        };
        Some([&header.encode()[..], &index].concat())
    }
}

/// Input of `hierarchy`: a root page and the page of children that each node with one is given.
///
/// Bytes: groups - 1 (its low two bits), levels, length of the root page (u16), root page, child page.
#[derive(Debug)]
pub struct HierarchyInput<'a> {
    /// Column groups, 1 to 4.
    pub groups: u8,
    /// Levels in the tree.
    pub levels: u8,
    /// The root page.
    pub root: &'a [u8],
    /// The page that stands in for every child page.
    pub child: &'a [u8],
}

impl<'a> HierarchyInput<'a> {
    /// Takes the fuzzer's bytes apart.
    #[must_use]
    pub fn parse(data: &'a [u8]) -> Option<Self> {
        let (&[groups, levels], rest) = data.split_first_chunk::<2>()?;
        let (root, child) = split_counted(rest)?;
        Some(Self { groups: (groups & 3) + 1, levels, root, child })
    }

    /// Undoes [`parse`](Self::parse).
    #[must_use]
    pub fn to_bytes(&self) -> Option<Vec<u8>> {
        let pages = join_counted(self.root, self.child)?;
        Some([&[self.groups - 1, self.levels], &pages[..]].concat())
    }

    /// The manifest that the pages are read with.
    #[must_use]
    pub fn manifest(&self) -> Manifest {
        manifest(32, self.levels, usize::from(self.groups), Vec::new())
    }

    /// The first bytes of a file with the root page, whatever it holds.
    #[must_use]
    pub fn seal(&self) -> Option<Vec<u8>> {
        Boot::encode(&self.manifest(), self.root, 0, u64::MAX >> 1).ok()
    }

    /// Reads the child page as that of `node`; `None` where the node names none.
    #[must_use]
    pub fn child_page_of(&self, boot: &Boot, node: &Node) -> Option<Result<HierarchyPage>> {
        let page = PageRef { crc: crc32fast::hash(self.child), ..node.child_page? };
        let node = Node { child_page: Some(page), ..node.clone() };
        Some(boot.parse_child_page(self.child, &node))
    }
}
