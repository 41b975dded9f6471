//! Packed nodes on the GPU: pages of one storage buffer each, filled by nodes, the least recently
//! drawn making room.
//!
//! Few large buffers, so that one draw call covers many nodes. A node may lie in several pieces and
//! several pages (a chunk tells where it starts), so that no node is too large. Nodes of the frame
//! that is being drawn are never evicted: for them the pool grows beyond its budget, and shrinks
//! back in later frames.

use std::sync::Arc;

use lodestream_protocol::{Manifest, NodeKey, NodePoints};
use lodestream_shaders::CHUNK_POINTS;
use lru::LruCache;

use super::{
    config::GpuConfig,
    device::Device,
    pack::{RecordFields, RecordLayout, pack},
    ranges::FreeRanges,
};
use crate::render::{DrawNode, color::NodeColor, surface::NodeSurface};

/// A page.
struct Page {
    buffer: wgpu::Buffer,
    free: FreeRanges,
    bind_group: wgpu::BindGroup,
}

/// Consecutive chunks of a node in one page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// The page.
    pub page: usize,
    /// First word in the page.
    pub first_word: u32,
    words: u32,
    /// Points in the piece.
    pub points: u32,
}

/// How exactly points are placed, and whether their colours lack their last bits.
const fn precision(points: &NodePoints) -> (u8, bool) {
    (points.cell_bits, points.has_coarse_colors)
}

/// A node on the GPU.
pub struct Resident {
    pub layout: RecordLayout,
    pub pieces: Vec<Piece>,
    /// Of its points: see [`precision`].
    precision: (u8, bool),
    frame: u64,
    /// Keeps the address that stands for the cloud in the key from being used again.
    _cloud: Arc<Manifest>,
}

/// What nodes are told apart by.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    /// Address of the manifest: what a cloud is known by as long as anything of it is here.
    cloud: usize,
    node: NodeKey,
    /// Which of the node's points.
    part: u64,
    fields: RecordFields,
}

/// A node that can be drawn.
pub struct Found<'a> {
    /// Where it is.
    pub resident: &'a Resident,
    /// Whether its points are placed less exactly, or more, than was asked for: what was asked for must
    /// wait for another frame.
    pub is_waiting: bool,
}

/// Nodes on the GPU.
pub struct Pool {
    pages: Vec<Option<Page>>,
    nodes: LruCache<Key, Resident>,
    bind_group_layout: wgpu::BindGroupLayout,
    page_words: u32,
    budget_bytes: u64,
    upload_bytes_per_frame: u64,
    frame: u64,
    resident_bytes: u64,
    uploaded_bytes: u64,
}

impl Pool {
    /// A pool whose pages take at most `resident_bytes`, or one page where that is more.
    pub fn new(
        device: &Device,
        bind_group_layout: wgpu::BindGroupLayout,
        config: &GpuConfig,
    ) -> Self {
        // Word numbers fit u32: a page is 32 MiB at most.
        let page_words = u32::try_from(device.page_bytes / 4).unwrap_or(u32::MAX);
        Self {
            pages: Vec::new(),
            nodes: LruCache::unbounded(),
            bind_group_layout,
            page_words,
            budget_bytes: config.resident_bytes,
            upload_bytes_per_frame: config.upload_bytes_per_frame,
            frame: 0,
            resident_bytes: 0,
            uploaded_bytes: 0,
        }
    }

    /// Begins a frame: from now on, what is asked for stays until the next one.
    pub fn begin_frame(&mut self) {
        self.frame += 1;
        self.uploaded_bytes = 0;
    }

    /// Shrinks to the budget, as far as the nodes of this frame allow.
    pub fn end_frame(&mut self) {
        while self.page_count() > 1 && self.bytes_of_pages(self.page_count()) > self.budget_bytes {
            let unused = |page: &Option<Page>| page.as_ref().is_some_and(|p| p.free.is_unused());
            match self.pages.iter().position(unused) {
                Some(index) => self.pages[index] = None,
                None if self.evict_one() => {}
                None => break,
            }
        }
    }

    /// Bytes of nodes on the GPU; bytes sent there in this frame.
    pub const fn bytes(&self) -> (u64, u64) {
        (self.resident_bytes, self.uploaded_bytes)
    }

    /// The bind group of a page that a piece of this frame lies in.
    pub fn bind_group(&self, page: usize) -> Option<&wgpu::BindGroup> {
        self.pages.get(page)?.as_ref().map(|page| &page.bind_group)
    }

    /// A node of `cloud` with records of `fields`, uploaded if it is not there yet; `None` where
    /// that must wait for another frame. Until a node that is more exact can be uploaded,
    /// the one that it replaces is there still: what was seen does not go away.
    pub fn node(
        &mut self,
        device: &Device,
        cloud: &Arc<Manifest>,
        node: &DrawNode,
        fields: RecordFields,
        colors: &NodeColor,
        surface: &NodeSurface,
    ) -> Option<Found<'_>> {
        let points = node.points.as_ref();
        let precision = precision(points);
        let key =
            Key { cloud: Arc::as_ptr(cloud).addr(), node: points.key, part: node.part, fields };
        // One that this frame draws already stays as it is.
        let replaced = self.nodes.peek(&key).filter(|old| old.precision != precision);
        let replaced = replaced.map(|old| old.frame != self.frame);
        let is_wanted = replaced.unwrap_or_else(|| !self.nodes.contains(&key));
        let is_new = is_wanted && self.enter(device, key, cloud, points, colors, surface);
        let is_waiting = replaced.is_some() && !is_new;
        let frame = self.frame;
        let resident = self.nodes.get_mut(&key)?;
        resident.frame = frame;
        Some(Found { resident, is_waiting })
    }

    /// Uploads a node in place of what is there; `false` where that must wait for another frame.
    fn enter(
        &mut self,
        device: &Device,
        key: Key,
        cloud: &Arc<Manifest>,
        points: &NodePoints,
        colors: &NodeColor,
        surface: &NodeSurface,
    ) -> bool {
        if self.uploaded_bytes >= self.upload_bytes_per_frame {
            return false;
        }
        let layout = RecordLayout::of(points, key.fields, surface);
        let words = pack(points, &layout, colors, surface);
        let bytes = words.len() as u64 * 4;
        // One node at least, however large.
        if self.uploaded_bytes > 0
            && self.uploaded_bytes.saturating_add(bytes) > self.upload_bytes_per_frame
        {
            return false;
        }
        if let Some(old) = self.nodes.pop(&key) {
            self.release(old);
        }
        let pieces = self.upload(device, points.positions.len(), &layout, &words);
        let precision = precision(points);
        let resident = Resident { layout, pieces, precision, frame: 0, _cloud: Arc::clone(cloud) };
        self.nodes.put(key, resident);
        true
    }

    fn upload(
        &mut self,
        device: &Device,
        points: usize,
        layout: &RecordLayout,
        words: &[u32],
    ) -> Vec<Piece> {
        let chunk_words = layout.chunk_words();
        // A quarter of a page at most, so that pieces fill pages well.
        let piece_chunks = (self.page_words as usize / 4 / chunk_words).max(1);
        let mut left = points;
        let mut pieces = Vec::new();
        for piece in words.chunks(piece_chunks * chunk_words) {
            let points = left.min(piece_chunks * CHUNK_POINTS);
            left -= points;
            // A piece is at most a page, and a page is counted in u32.
            let words = piece.len() as u32;
            let (page, first_word) = self.place(device, words);
            if let Some(page) = &self.pages[page] {
                let bytes = bytemuck::cast_slice(piece);
                device.queue.write_buffer(&page.buffer, u64::from(first_word) * 4, bytes);
            }
            pieces.push(Piece { page, first_word, words, points: points as u32 });
        }
        let bytes = words.len() as u64 * 4;
        self.resident_bytes += bytes;
        self.uploaded_bytes += bytes;
        pieces
    }

    /// Room for `words`: in a page; in a new one within the budget; in what older nodes leave; in a
    /// new one beyond the budget.
    fn place(&mut self, device: &Device, words: u32) -> (usize, u32) {
        loop {
            let pages = self.pages.iter_mut().enumerate();
            let found = pages
                .filter_map(|(i, page)| Some((i, page.as_mut()?)))
                .find_map(|(i, page)| Some((i, page.free.take(words)?)));
            if let Some(place) = found {
                return place;
            }
            let grown = self.bytes_of_pages(self.page_count() + 1);
            if grown <= self.budget_bytes || !self.evict_one() {
                self.add_page(device);
            }
        }
    }

    fn page_count(&self) -> usize {
        self.pages.iter().flatten().count()
    }

    fn bytes_of_pages(&self, pages: usize) -> u64 {
        pages as u64 * u64::from(self.page_words) * 4
    }

    fn add_page(&mut self, device: &Device) {
        let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("page of nodes"),
            size: u64::from(self.page_words) * 4,
            usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let bind_group = device.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("page of nodes"),
            layout: &self.bind_group_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: buffer.as_entire_binding() }],
        });
        let page = Page { buffer, free: FreeRanges::new(self.page_words), bind_group };
        match self.pages.iter().position(Option::is_none) {
            Some(index) => self.pages[index] = Some(page),
            None => self.pages.push(Some(page)),
        }
    }

    /// Evicts the node that was not drawn for the longest time; false where all that is left
    /// belongs to this frame.
    fn evict_one(&mut self) -> bool {
        if self.nodes.peek_lru().is_none_or(|(_, oldest)| oldest.frame == self.frame) {
            return false;
        }
        let Some((_, oldest)) = self.nodes.pop_lru() else { return false };
        self.release(oldest);
        true
    }

    /// Gives back the room of a node that is no longer drawn.
    fn release(&mut self, node: Resident) {
        for piece in node.pieces {
            if let Some(page) = &mut self.pages[piece.page] {
                page.free.give(piece.first_word, piece.words);
            }
            self.resident_bytes -= u64::from(piece.words) * 4;
        }
    }
}
