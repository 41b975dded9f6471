//! A whole dataset, read synchronously from anything that answers ranges.

use crate::{
    boot::{BOOT_SPECULATIVE_BYTES, Boot, Header},
    column::{Column, DecodedGroup, decode_group},
    error::{Error, Result, corrupt},
    hierarchy::Node,
    key::NodeKey,
    manifest::Manifest,
};

/// Something that answers byte ranges: a file, a host behind a blocking client.
pub trait ReadAt {
    /// Exactly `len` bytes from `offset`.
    ///
    /// # Errors
    /// [`Error::Read`] or [`Error::Truncated`] where they cannot be had.
    fn read_at(&self, offset: u64, len: usize) -> Result<Vec<u8>>;

    /// Length of the whole in bytes.
    ///
    /// # Errors
    /// [`Error::Read`] where it cannot be had.
    fn size(&self) -> Result<u64>;
}

/// The decoded elements of one node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodePoints {
    /// The node.
    pub key: NodeKey,
    /// Lattice units relative to the node's lowest corner, in Morton order. Where the manifest has
    /// [`Fine`](crate::Fine) positions and these were not read: the centres of their cells.
    pub positions: Vec<[u32; 3]>,
    /// log2 of the side of these cells in lattice units; 0 where the positions are whole.
    pub cell_bits: u8,
    /// Whether colours lack their last bits, which come with fine positions.
    pub has_coarse_colors: bool,
    /// Columns of the groups that were read, in the manifest's order.
    pub columns: Vec<Column>,
}

impl NodePoints {
    /// The column of attribute `index`, where its group was read.
    #[must_use]
    pub fn column(&self, index: usize) -> Option<&Column> {
        self.columns.iter().find(|c| c.attribute == index)
    }

    /// A node of which nothing was read yet.
    #[must_use]
    pub const fn new(key: NodeKey) -> Self {
        Self {
            key,
            positions: Vec::new(),
            cell_bits: 0,
            has_coarse_colors: false,
            columns: Vec::new(),
        }
    }

    /// Takes in a group; group 0 comes before fine positions.
    ///
    /// # Errors
    /// [`Error::Corrupt`] where there are fine positions or colours, but not of these points.
    pub fn add(&mut self, group: DecodedGroup) -> Result<()> {
        if !group.positions.is_empty() {
            (self.positions, self.cell_bits) = (group.positions, group.cell_bits);
            self.has_coarse_colors = group.has_coarse_colors;
        }
        if let Some(fine) = group.fine {
            fine.refine(&mut self.positions)?;
            self.cell_bits = 0;
        }
        if let Some(fine) = group.fine_colors {
            let coarse = self.columns.iter_mut().find(|c| c.attribute == fine.attribute);
            let coarse = coarse.filter(|_| self.has_coarse_colors);
            let coarse =
                coarse.ok_or_else(|| corrupt("column", "fine colours without coarse ones"))?;
            fine.refine(&mut coarse.bytes)?;
            self.has_coarse_colors = false;
        }
        self.columns.extend(group.columns);
        self.columns.sort_by_key(|column| column.attribute);
        Ok(())
    }
}

/// An opened dataset.
#[derive(Debug)]
pub struct Dataset<R> {
    source: R,
    boot: Boot,
}

impl<R: ReadAt> Dataset<R> {
    /// Reads header, manifest and root page.
    ///
    /// # Errors
    /// What the source says, or what is wrong with the bytes; [`Error::Truncated`] where the file
    /// is shorter than its header says.
    pub fn open(source: R) -> Result<Self> {
        let size = source.size()?;
        let first = source.read_at(0, size.min(BOOT_SPECULATIVE_BYTES) as usize)?;
        let header = Header::parse(&first)?;
        if size < header.file_bytes {
            return Err(Error::Truncated {
                what: "dataset",
                needed: header.file_bytes,
                available: size,
            });
        }
        let boot = match usize::try_from(header.index_bytes()) {
            Ok(index) if index > first.len() => Boot::parse(&source.read_at(0, index)?)?,
            _ => Boot::parse(&first)?,
        };
        Ok(Self { source, boot })
    }

    /// Header, manifest and root page.
    pub const fn boot(&self) -> &Boot {
        &self.boot
    }

    /// What the dataset is.
    pub const fn manifest(&self) -> &Manifest {
        &self.boot.manifest
    }

    /// What the bytes come from.
    pub const fn source(&self) -> &R {
        &self.source
    }

    /// All nodes of all pages: those of a page together, parents before children.
    ///
    /// # Errors
    /// As for [`Boot::parse`]; [`Error::Corrupt`] where the number of nodes is not the manifest's.
    pub fn hierarchy(&self) -> Result<Vec<Node>> {
        let mut nodes = self.boot.root_page.nodes.clone();
        let mut next = 0;
        while let Some(node) = nodes.get(next) {
            if let Some(page) = node.child_page {
                let bytes = self.source.read_at(page.offset, page.bytes as usize)?;
                let children = self.boot.parse_child_page(&bytes, node)?;
                nodes.extend(children.nodes);
            }
            next += 1;
            if nodes.len() as u64 > self.boot.manifest.nodes {
                break;
            }
        }
        if nodes.len() as u64 != self.boot.manifest.nodes {
            let why = format!("{} nodes, the manifest says {}", nodes.len(), self.manifest().nodes);
            return Err(corrupt("hierarchy", why));
        }
        Ok(nodes)
    }

    /// The node of a key, by way of the pages that lead to it; `None` where there is no such node.
    ///
    /// # Errors
    /// As for [`Boot::parse`].
    pub fn node(&self, key: NodeKey) -> Result<Option<Node>> {
        let mut nodes = self.boot.root_page.nodes.clone();
        for level in 0..=key.level() {
            let Some(ancestor) = key.ancestor(level) else { return Ok(None) };
            let Some(place) = nodes.iter().position(|node| node.key == ancestor) else {
                return Ok(None);
            };
            if level == key.level() {
                return Ok(Some(nodes.swap_remove(place)));
            }
            if let Some(page) = nodes[place].child_page {
                let bytes = self.source.read_at(page.offset, page.bytes as usize)?;
                nodes = self.boot.parse_child_page(&bytes, &nodes[place])?.nodes;
            }
        }
        Ok(None)
    }

    /// Reads and decodes a node to the last bit: positions always, and the given further groups.
    ///
    /// # Errors
    /// What the source says, or what is wrong with the bytes.
    pub fn read_node(&self, node: &Node, groups: &[usize]) -> Result<NodePoints> {
        let mut points = NodePoints::new(node.key);
        let fine = self.manifest().fine.map(|fine| fine.group);
        let further = groups.iter().copied().filter(|&g| g != 0 && Some(g) != fine);
        for group in std::iter::once(0).chain(fine).chain(further) {
            let payload =
                node.payloads.get(group).ok_or_else(|| corrupt("node", "no such group"))?;
            let bytes = self.source.read_at(payload.offset, payload.bytes as usize)?;
            points.add(decode_group(self.manifest(), group, node, &bytes)?)?;
        }
        if points.cell_bits > 0 || points.has_coarse_colors {
            return Err(corrupt("node", "the last bits of positions or colours are not there"));
        }
        Ok(points)
    }
}

impl ReadAt for Vec<u8> {
    fn read_at(&self, offset: u64, len: usize) -> Result<Vec<u8>> {
        let bytes = usize::try_from(offset).ok().and_then(|start| self.get(start..)?.get(..len));
        bytes.map(<[u8]>::to_vec).ok_or(Error::Truncated {
            what: "dataset",
            needed: offset.saturating_add(len as u64),
            available: self.len() as u64,
        })
    }

    fn size(&self) -> Result<u64> {
        Ok(self.len() as u64)
    }
}
