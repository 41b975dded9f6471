//! Points to their chunks: as places in the store while that is in memory, else as records copied
//! into one temporary file in which every chunk has its own stretch.

use std::{fs::File, path::Path, sync::Mutex};

use rayon::prelude::*;

use crate::{
    chunk::Points,
    encode::Layout,
    error::{Error, Result},
    plan::{Counter, Plan},
    positioned::{read_exact_at, write_all_at},
    store::{Block, Store},
};

/// What one pass over all points finds besides the chunk plan.
#[derive(Debug, Clone, Default)]
pub struct Scan {
    /// The first point's row.
    pub first_row: Vec<u8>,
    /// Per byte of a row: whether all points agree on it.
    pub constant_bytes: Vec<bool>,
    /// Largest rounding of a coordinate, world units.
    pub rounding: f64,
    /// Tight bounds on the lattice.
    pub bounds: Option<lodestream_protocol::LatticeBox>,
}

impl Scan {
    fn look(&mut self, block: &Block, row_bytes: usize) {
        let bounds = self.bounds.get_or_insert(lodestream_protocol::LatticeBox::EMPTY);
        for &q in &block.positions {
            bounds.grow(q);
        }
        if row_bytes == 0 || block.rows.is_empty() {
            return;
        }
        if self.first_row.is_empty() {
            self.first_row = block.rows[..row_bytes].to_vec();
            self.constant_bytes = vec![true; row_bytes];
        }
        for at in 0..row_bytes {
            // Most bytes are known to vary after one block and cost nothing from then on.
            if self.constant_bytes[at] {
                let first = self.first_row[at];
                let column = block.rows[at..].iter().step_by(row_bytes);
                self.constant_bytes[at] = column.copied().all(|b| b == first);
            }
        }
    }

    fn merge(&mut self, other: Self) {
        if self.first_row.is_empty() {
            self.first_row = other.first_row;
            self.constant_bytes = other.constant_bytes;
        } else if !other.first_row.is_empty() {
            for at in 0..self.first_row.len() {
                self.constant_bytes[at] &=
                    other.constant_bytes[at] && self.first_row[at] == other.first_row[at];
            }
        }
        self.rounding = self.rounding.max(other.rounding);
        match (&mut self.bounds, other.bounds) {
            (Some(mine), Some(theirs)) => mine.merge(&theirs),
            (mine, theirs) => *mine = mine.or(theirs),
        }
    }
}

/// Counts all points into `plan` until it is final, and scans the attribute rows on the way.
///
/// # Errors
/// Where the spill file cannot be read, or `check` fails (it is called once a block).
pub fn count(
    store: &mut Store,
    plan: &mut Plan,
    capacity: u64,
    row_bytes: usize,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Scan> {
    let mut scan = Scan::default();
    let mut first_round = true;
    loop {
        let counter = match store {
            Store::Memory { blocks, rounding } => {
                let parts = split(blocks);
                let results: Vec<(Counter, Scan)> = parts
                    .into_par_iter()
                    .map(|blocks| {
                        let mut counter = plan.counter();
                        let mut scan = Scan::default();
                        for block in blocks {
                            block.positions.iter().for_each(|&q| plan.count(&mut counter, q));
                            if first_round {
                                scan.look(block, row_bytes);
                            }
                        }
                        (counter, scan)
                    })
                    .collect();
                check()?;
                let mut total = plan.counter();
                for (counter, part) in results {
                    total.merge(&counter);
                    scan.merge(part);
                }
                scan.rounding = scan.rounding.max(*rounding);
                total
            }
            Store::File(file) => {
                let mut counter = plan.counter();
                let rounding = file.stream(|block| {
                    block.positions.iter().for_each(|&q| plan.count(&mut counter, q));
                    if first_round {
                        scan.look(&block, row_bytes);
                    }
                    check()
                })?;
                scan.rounding = rounding;
                counter
            }
        };
        first_round = false;
        if plan.refine(counter, capacity) {
            return Ok(scan);
        }
    }
}

/// The blocks in as many contiguous parts as there are threads.
fn split(blocks: &[Block]) -> Vec<&[Block]> {
    blocks.chunks(blocks.len().div_ceil(rayon::current_num_threads()).max(1)).collect()
}

/// Every chunk's points.
#[derive(Debug)]
pub enum Distributed {
    /// The store's blocks, and per chunk the places `block << 16 | point` in parts, ascending, until
    /// they are asked for.
    InStore(Vec<Block>, Vec<Mutex<Vec<Vec<u32>>>>),
    /// Records (position, row) in a temporary file; per chunk its first record.
    Copied {
        /// The file.
        file: File,
        /// Per chunk: index of its first record.
        first: Vec<u64>,
        /// Bytes of an attribute row.
        row_bytes: usize,
    },
}

/// Distributes all points. `buffer_bytes` bounds the write buffers where they go to a file.
///
/// # Errors
/// Where a temporary file cannot be read or written, or `check` fails.
pub fn distribute(
    store: Store,
    plan: &Plan,
    layout: &Layout,
    folder: &Path,
    buffer_bytes: u64,
    check: &(dyn Fn() -> Result<()> + Sync),
) -> Result<Distributed> {
    match store {
        Store::Memory { mut blocks, .. } => {
            blocks.par_iter_mut().for_each(|b| b.rows = layout.cut(std::mem::take(&mut b.rows)));
            let part_len = blocks.len().div_ceil(rayon::current_num_threads()).max(1);
            let parts: Vec<Vec<Vec<u32>>> = split(&blocks)
                .into_par_iter()
                .enumerate()
                .map(|(part, slice)| {
                    let mut counts = vec![0usize; plan.chunks.len()];
                    let each = |visit: &mut dyn FnMut(usize, u32)| {
                        for (b, block) in slice.iter().enumerate() {
                            let base = ((part * part_len + b) as u32) << 16;
                            for (p, &q) in block.positions.iter().enumerate() {
                                visit(plan.chunk_of(q), base | p as u32);
                            }
                        }
                    };
                    each(&mut |chunk, _| counts[chunk] += 1);
                    let mut places: Vec<Vec<u32>> =
                        counts.into_iter().map(Vec::with_capacity).collect();
                    each(&mut |chunk, place| places[chunk].push(place));
                    places
                })
                .collect();
            check()?;
            let mut chunks: Vec<Vec<Vec<u32>>> = vec![Vec::new(); plan.chunks.len()];
            for part in parts {
                for (chunk, places) in chunks.iter_mut().zip(part) {
                    chunk.push(places);
                }
            }
            Ok(Distributed::InStore(blocks, chunks.into_iter().map(Mutex::new).collect()))
        }
        Store::File(mut spilled) => {
            let failed = |e| Error::io(folder, "cannot write a temporary file")(e);
            let file = tempfile::tempfile_in(folder)
                .map_err(Error::io(folder, "cannot create a temporary file"))?;
            let row_bytes = layout.row_bytes;
            let record_bytes = 12 + row_bytes;
            let mut total = 0;
            let first: Vec<u64> = plan
                .chunks
                .iter()
                .map(|chunk| {
                    let start = total;
                    total += chunk.points;
                    start
                })
                .collect();
            let buffer_bytes =
                (buffer_bytes / plan.chunks.len().max(1) as u64).clamp(4 << 10, 256 << 10) as usize;
            let mut cursors: Vec<u64> = first.iter().map(|f| f * record_bytes as u64).collect();
            let mut buffers: Vec<Vec<u8>> = vec![Vec::new(); plan.chunks.len()];
            spilled.stream(|block| {
                let rows = layout.cut(block.rows);
                for (p, &q) in block.positions.iter().enumerate() {
                    let chunk = plan.chunk_of(q);
                    let buffer = &mut buffers[chunk];
                    buffer.extend_from_slice(bytemuck::cast_slice(&q));
                    buffer.extend_from_slice(&rows[p * row_bytes..][..row_bytes]);
                    if buffer.len() + record_bytes > buffer_bytes {
                        write_all_at(&file, buffer, cursors[chunk]).map_err(failed)?;
                        cursors[chunk] += buffer.len() as u64;
                        buffer.clear();
                    }
                }
                check()
            })?;
            for (buffer, cursor) in buffers.iter().zip(cursors) {
                write_all_at(&file, buffer, cursor).map_err(failed)?;
            }
            Ok(Distributed::Copied { file, first, row_bytes })
        }
    }
}

impl Distributed {
    /// The points of one chunk; each chunk is asked for once.
    ///
    /// # Errors
    /// Where the temporary file cannot be read.
    pub fn points(&self, plan: &Plan, chunk: usize, folder: &Path) -> Result<Points<'_>> {
        match self {
            Self::InStore(blocks, chunks) => {
                let parts = std::mem::take(&mut *chunks[chunk].lock().expect("no holder panics"));
                Ok(Points::InStore(blocks, parts.concat()))
            }
            Self::Copied { file, first, row_bytes } => {
                let points = plan.chunks[chunk].points as usize;
                let record_bytes = 12 + row_bytes;
                let mut block = Block {
                    positions: Vec::with_capacity(points),
                    rows: Vec::with_capacity(points * row_bytes),
                };
                let mut offset = first[chunk] * record_bytes as u64;
                let mut left = points;
                let mut buffer = Vec::new();
                while left > 0 {
                    let batch = left.min((1 << 20) / record_bytes + 1);
                    buffer.resize(batch * record_bytes, 0);
                    read_exact_at(file, &mut buffer, offset)
                        .map_err(Error::io(folder, "cannot read a temporary file"))?;
                    for record in buffer.chunks_exact(record_bytes) {
                        let (position, row) = record.split_at(12);
                        block.positions.push(bytemuck::pod_read_unaligned(position));
                        block.rows.extend_from_slice(row);
                    }
                    offset += buffer.len() as u64;
                    left -= batch;
                }
                Ok(Points::Copied(block))
            }
        }
    }
}
