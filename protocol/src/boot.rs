//! The boot block: the first bytes of the file, which hold all that a first picture needs.
//!
//! Header, manifest and root hierarchy page lie first; the payloads of the top nodes follow at
//! once. One speculative range request of [`BOOT_SPECULATIVE_BYTES`] usually brings them all.

use crate::{
    error::{Error, Result, corrupt},
    hierarchy::{HierarchyPage, Node},
    manifest::Manifest,
    wire::MAX_PAGE_BYTES,
};

/// The first eight bytes of every dataset. As in PNG, the line ends catch text-mode transfers.
pub const MAGIC: [u8; 8] = *b"LODS\r\n\x1a\n";
/// Readers refuse a larger major version.
pub const VERSION_MAJOR: u16 = 2;
/// Readers of the same major version can read any minor version.
pub const VERSION_MINOR: u16 = 0;
/// Size of the fixed header in bytes.
pub const HEADER_BYTES: usize = 64;
/// What a client asks for first, in bytes.
pub const BOOT_SPECULATIVE_BYTES: u64 = 256 << 10;

const MAX_MANIFEST_BYTES: u32 = 16 << 20;

/// The fixed header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Format version, major and minor.
    pub version: (u16, u16),
    /// Length of the manifest, which follows the header.
    pub manifest_bytes: u32,
    /// Length of the root hierarchy page, which follows the manifest.
    pub root_page_bytes: u32,
    /// Length of the boot block: the index and the payloads of the top nodes.
    pub boot_bytes: u64,
    /// Length of the whole file.
    pub file_bytes: u64,
    /// Identity of the content: XXH3-128 (big-endian bytes) of manifest and root page, which hold
    /// the checksums of all else.
    pub content_id: [u8; 16],
    /// CRC-32 of manifest and root page.
    pub index_crc: u32,
}

impl Header {
    /// Header, manifest and root page: bytes that [`Boot::parse`] needs.
    #[must_use]
    pub fn index_bytes(&self) -> u64 {
        HEADER_BYTES as u64 + u64::from(self.manifest_bytes) + u64::from(self.root_page_bytes)
    }

    /// The content identity in hexadecimal: 32 characters.
    #[must_use]
    pub fn content_id_hex(&self) -> String {
        self.content_id.iter().map(|b| format!("{b:02x}")).collect()
    }

    /// The header's bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = Vec::with_capacity(HEADER_BYTES);
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&self.version.0.to_le_bytes());
        bytes.extend_from_slice(&self.version.1.to_le_bytes());
        bytes.extend_from_slice(&(HEADER_BYTES as u32).to_le_bytes());
        bytes.extend_from_slice(&self.manifest_bytes.to_le_bytes());
        bytes.extend_from_slice(&self.root_page_bytes.to_le_bytes());
        bytes.extend_from_slice(&self.boot_bytes.to_le_bytes());
        bytes.extend_from_slice(&self.file_bytes.to_le_bytes());
        bytes.extend_from_slice(&self.content_id);
        bytes.extend_from_slice(&self.index_crc.to_le_bytes());
        let crc = crc32fast::hash(&bytes);
        bytes.extend_from_slice(&crc.to_le_bytes());
        bytes.try_into().expect("the fields above are 64 bytes")
    }

    /// Parses and checks the first [`HEADER_BYTES`] bytes of a file.
    ///
    /// # Errors
    /// [`Error::NotADataset`], [`Error::NewerVersion`], [`Error::Truncated`], or what is corrupt.
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        let known = bytes.len().min(MAGIC.len());
        if bytes[..known] != MAGIC[..known] {
            return Err(Error::NotADataset);
        }
        let Some(bytes) = bytes.get(..HEADER_BYTES) else {
            return Err(Error::Truncated {
                what: "header",
                needed: HEADER_BYTES as u64,
                available: bytes.len() as u64,
            });
        };
        let u16_at = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let u32_at = |at: usize| {
            u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        };
        let u64_at = |at: usize| u64::from(u32_at(at)) | u64::from(u32_at(at + 4)) << 32;
        let version = (u16_at(8), u16_at(10));
        if version.0 > VERSION_MAJOR {
            return Err(Error::NewerVersion {
                major: version.0,
                minor: version.1,
                supported: VERSION_MAJOR,
            });
        }
        let crc = crc32fast::hash(&bytes[..60]);
        if crc != u32_at(60) {
            return Err(Error::Checksum {
                what: "header".into(),
                expected: u32_at(60),
                found: crc,
            });
        }
        let mut content_id = [0; 16];
        content_id.copy_from_slice(&bytes[40..56]);
        let header = Self {
            version,
            manifest_bytes: u32_at(16),
            root_page_bytes: u32_at(20),
            boot_bytes: u64_at(24),
            file_bytes: u64_at(32),
            content_id,
            index_crc: u32_at(56),
        };
        let sizes_fit = u32_at(12) as usize == HEADER_BYTES
            && header.manifest_bytes <= MAX_MANIFEST_BYTES
            && header.root_page_bytes as usize <= MAX_PAGE_BYTES
            && header.index_bytes() <= header.boot_bytes
            && header.boot_bytes <= header.file_bytes;
        if !sizes_fit {
            return Err(corrupt("header", format!("sizes contradict one another: {header:?}")));
        }
        Ok(header)
    }
}

/// The parsed index of a dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct Boot {
    /// The fixed header.
    pub header: Header,
    /// What the dataset is.
    pub manifest: Manifest,
    /// The top of the tree.
    pub root_page: HierarchyPage,
}

impl Boot {
    /// Parses the first bytes of a file; `bytes` may hold more than is needed.
    ///
    /// # Errors
    /// [`Error::Truncated`] tells how many bytes are needed; others as for [`Header::parse`].
    pub fn parse(bytes: &[u8]) -> Result<Self> {
        let header = Header::parse(bytes)?;
        let needed = header.index_bytes();
        let index =
            usize::try_from(needed).ok().and_then(|needed| bytes.get(HEADER_BYTES..needed)).ok_or(
                Error::Truncated { what: "boot block", needed, available: bytes.len() as u64 },
            )?;
        let crc = crc32fast::hash(index);
        if crc != header.index_crc {
            return Err(Error::Checksum {
                what: "manifest and root page".into(),
                expected: header.index_crc,
                found: crc,
            });
        }
        let (manifest, page) = index.split_at(header.manifest_bytes as usize);
        let manifest = Manifest::parse(manifest)?;
        let root_page = HierarchyPage::parse_root(page, &manifest, needed)?;
        Ok(Self { header, manifest, root_page })
    }

    /// Parses the page that describes the children of `parent` (see [`Node::child_page`]).
    ///
    /// # Errors
    /// [`Error::Checksum`] or [`Error::Corrupt`] where the bytes are not that page.
    pub fn parse_child_page(&self, bytes: &[u8], parent: &Node) -> Result<HierarchyPage> {
        HierarchyPage::parse_children(bytes, parent, &self.manifest, self.header.index_bytes())
    }

    /// Encodes header, manifest and root page: the first [`Header::index_bytes`] bytes of a file
    /// whose payloads start right behind them.
    ///
    /// `top_payload_bytes` of payloads count as boot block; `tail_bytes` is all that follows the
    /// index.
    ///
    /// # Errors
    /// [`Error::Corrupt`] where the manifest or the page cannot be encoded.
    pub fn encode(
        manifest: &Manifest,
        page: &[u8],
        top_payload_bytes: u64,
        tail_bytes: u64,
    ) -> Result<Vec<u8>> {
        let manifest = manifest.to_json()?;
        let too_large = |_| corrupt("boot block", "more than 4 GiB of manifest or root page");
        let mut index = Vec::with_capacity(manifest.len() + page.len());
        index.extend_from_slice(&manifest);
        index.extend_from_slice(page);
        let index_bytes = (HEADER_BYTES + index.len()) as u64;
        let header = Header {
            version: (VERSION_MAJOR, VERSION_MINOR),
            manifest_bytes: u32::try_from(manifest.len()).map_err(too_large)?,
            root_page_bytes: u32::try_from(page.len()).map_err(too_large)?,
            boot_bytes: index_bytes + top_payload_bytes,
            file_bytes: index_bytes + tail_bytes,
            content_id: xxhash_rust::xxh3::xxh3_128(&index).to_be_bytes(),
            index_crc: crc32fast::hash(&index),
        };
        let mut bytes = header.encode().to_vec();
        bytes.extend_from_slice(&index);
        Ok(bytes)
    }
}
