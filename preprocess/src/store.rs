//! The point store: what the readers delivered, in input order, in memory or in a spill file.
//!
//! Points are read once. Blocks stay in memory while they fit the build's share; past it they go to
//! one temporary file beside the output, which is then streamed instead.

use std::{
    fs::File,
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use lodestream_protocol::Lattice;

use crate::{
    error::{Error, Result},
    grid::{NativeBounds, NativeSteps, Placement},
    readers::{BLOCK_POINTS, Positions},
    schema::Schema,
};

/// A block as it was read.
#[derive(Debug)]
pub struct RawBlock {
    /// Index of the input it came from.
    pub input: u32,
    /// Native coordinates.
    pub positions: Positions,
    /// Rows of the union schema.
    pub rows: Vec<u8>,
}

impl RawBlock {
    fn size_bytes(&self) -> u64 {
        let width = match self.positions {
            Positions::Scaled(_) => 12,
            Positions::Float(_) => 24,
        };
        (self.positions.len() * width + self.rows.len()) as u64
    }
}

/// A block on the lattice.
#[derive(Debug, Default)]
pub struct Block {
    /// Lattice units relative to the root cube.
    pub positions: Vec<[u32; 3]>,
    /// Rows of the union schema.
    pub rows: Vec<u8>,
}

/// Collects blocks while reading.
#[derive(Debug)]
pub struct StoreWriter {
    blocks: Vec<RawBlock>,
    memory_bytes: u64,
    limit_bytes: u64,
    spill: Option<Spill>,
    folder: PathBuf,
    /// Native bounds per input.
    pub bounds: Vec<NativeBounds>,
    /// Where the integer coordinates of each input lie.
    pub steps: Vec<NativeSteps>,
    /// Points per input.
    pub points: Vec<u64>,
}

#[derive(Debug)]
struct Spill {
    file: std::io::BufWriter<File>,
    path: PathBuf,
    blocks: u64,
}

/// All points, read.
#[derive(Debug)]
pub enum RawStore {
    /// In memory.
    Memory(Vec<RawBlock>),
    /// In a temporary file of that many blocks.
    File(File, PathBuf, u64),
}

impl StoreWriter {
    /// A store for `inputs` inputs that keeps at most `limit_bytes` in memory and spills to an
    /// anonymous temporary file in `folder`.
    pub fn new(inputs: usize, limit_bytes: u64, folder: &Path) -> Self {
        Self {
            blocks: Vec::new(),
            memory_bytes: 0,
            limit_bytes,
            spill: None,
            folder: folder.to_path_buf(),
            bounds: vec![NativeBounds::EMPTY; inputs],
            steps: vec![NativeSteps::default(); inputs],
            points: vec![0; inputs],
        }
    }

    /// Takes a block.
    ///
    /// # Errors
    /// Where the spill file cannot be written.
    pub fn push(&mut self, block: RawBlock) -> Result<()> {
        let input = block.input as usize;
        self.points[input] += block.positions.len() as u64;
        self.bounds[input].merge(&native_bounds(&block.positions));
        if let Positions::Scaled(positions) = &block.positions {
            self.steps[input].look(positions);
        }
        if self.spill.is_none() && self.memory_bytes + block.size_bytes() > self.limit_bytes {
            let file = tempfile::tempfile_in(&self.folder)
                .map_err(Error::io(&self.folder, "cannot create a temporary file"))?;
            let mut spill = Spill {
                file: std::io::BufWriter::with_capacity(1 << 20, file),
                path: self.folder.clone(),
                blocks: 0,
            };
            for block in self.blocks.drain(..) {
                spill.push(&block)?;
            }
            self.blocks.shrink_to_fit();
            self.spill = Some(spill);
        }
        match &mut self.spill {
            Some(spill) => spill.push(&block),
            None => {
                self.memory_bytes += block.size_bytes();
                self.blocks.push(block);
                Ok(())
            }
        }
    }

    /// Ends reading.
    ///
    /// # Errors
    /// Where the spill file cannot be written.
    pub fn finish(self) -> Result<RawStore> {
        let Some(spill) = self.spill else { return Ok(RawStore::Memory(self.blocks)) };
        let path = spill.path;
        let file = spill.file.into_inner().map_err(|e| e.into_error());
        let file = file.map_err(Error::io(&path, "cannot write a temporary file"))?;
        Ok(RawStore::File(file, path, spill.blocks))
    }
}

fn native_bounds(positions: &Positions) -> NativeBounds {
    let mut bounds = NativeBounds::EMPTY;
    match positions {
        Positions::Scaled(positions) => {
            let (mut min, mut max) = ([i32::MAX; 3], [i32::MIN; 3]);
            for p in positions {
                min = std::array::from_fn(|a| min[a].min(p[a]));
                max = std::array::from_fn(|a| max[a].max(p[a]));
            }
            if !positions.is_empty() {
                bounds.grow(min.map(f64::from));
                bounds.grow(max.map(f64::from));
            }
        }
        Positions::Float(positions) => positions.iter().for_each(|&p| bounds.grow(p)),
    }
    bounds
}

impl Spill {
    /// Block: input u32, points u32, kind u8, then coordinates and rows, native-endian: the file
    /// does not outlive the process.
    fn push(&mut self, block: &RawBlock) -> Result<()> {
        let points = block.positions.len() as u32;
        let mut write = |bytes: &[u8]| {
            self.file
                .write_all(bytes)
                .map_err(Error::io(&self.path, "cannot write a temporary file"))
        };
        write(&block.input.to_ne_bytes())?;
        write(&points.to_ne_bytes())?;
        match &block.positions {
            Positions::Scaled(positions) => {
                write(&[0])?;
                write(bytemuck::cast_slice(positions))?;
            }
            Positions::Float(positions) => {
                write(&[1])?;
                write(bytemuck::cast_slice(positions))?;
            }
        }
        write(&block.rows)?;
        self.blocks += 1;
        Ok(())
    }
}

impl RawStore {
    /// Puts every block on the lattice. In memory, blocks are converted in place by all threads; a
    /// file is left as it is and converted block by block whenever it is streamed.
    pub fn place(self, placements: Vec<Placement>, lattice: Lattice, schema: &Schema) -> Store {
        match self {
            Self::Memory(blocks) => {
                use rayon::prelude::*;
                let (blocks, rounding): (Vec<Block>, Vec<f64>) =
                    blocks.into_par_iter().map(|raw| place(raw, &placements, &lattice)).unzip();
                let rounding = rounding.into_iter().fold(0.0, f64::max);
                Store::Memory { blocks: coalesce(blocks), rounding }
            }
            Self::File(file, path, blocks) => Store::File(SpilledStore {
                file,
                path,
                blocks,
                placements,
                lattice,
                row_bytes: schema.row_bytes,
            }),
        }
    }
}

/// Small neighbours joined: thousands of small inputs must not use up the numbers of blocks.
fn coalesce(blocks: Vec<Block>) -> Vec<Block> {
    let mut joined: Vec<Block> = Vec::with_capacity(blocks.len());
    for mut block in blocks {
        match joined.last_mut() {
            Some(last) if last.positions.len() + block.positions.len() <= BLOCK_POINTS => {
                last.positions.append(&mut block.positions);
                last.rows.append(&mut block.rows);
            }
            _ => joined.push(block),
        }
    }
    joined
}

fn place(raw: RawBlock, placements: &[Placement], lattice: &Lattice) -> (Block, f64) {
    let (positions, rounding) = placements[raw.input as usize].place(lattice, raw.positions);
    (Block { positions, rows: raw.rows }, rounding)
}

/// All points, on the lattice.
#[derive(Debug)]
pub enum Store {
    /// In memory.
    Memory {
        /// The blocks, in input order.
        blocks: Vec<Block>,
        /// Largest rounding of a coordinate, world units.
        rounding: f64,
    },
    /// In a temporary file.
    File(SpilledStore),
}

/// Points in a temporary file, in input order, in native coordinates.
#[derive(Debug)]
pub struct SpilledStore {
    file: File,
    path: PathBuf,
    blocks: u64,
    placements: Vec<Placement>,
    lattice: Lattice,
    row_bytes: usize,
}

impl SpilledStore {
    /// Streams all blocks, in order, and gives the largest rounding of a coordinate in world units.
    ///
    /// # Errors
    /// Where the file cannot be read, or what `sink` returns.
    pub fn stream(&mut self, mut sink: impl FnMut(Block) -> Result<()>) -> Result<f64> {
        let path = self.path.clone();
        let failed = |e| Error::io(&path, "cannot read a temporary file")(e);
        self.file.seek(SeekFrom::Start(0)).map_err(failed)?;
        let mut file = std::io::BufReader::with_capacity(1 << 20, &mut self.file);
        let mut rounding: f64 = 0.0;
        for _ in 0..self.blocks {
            let mut head = [0; 9];
            file.read_exact(&mut head).map_err(failed)?;
            let word = |at: usize| {
                u32::from_ne_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]])
            };
            let points = (word(4) as usize).min(BLOCK_POINTS);
            let positions = if head[8] == 0 {
                let mut native = vec![[0i32; 3]; points];
                file.read_exact(bytemuck::cast_slice_mut(&mut native)).map_err(failed)?;
                Positions::Scaled(native)
            } else {
                let mut native = vec![[0f64; 3]; points];
                file.read_exact(bytemuck::cast_slice_mut(&mut native)).map_err(failed)?;
                Positions::Float(native)
            };
            let mut rows = vec![0; points * self.row_bytes];
            file.read_exact(&mut rows).map_err(failed)?;
            let raw = RawBlock { input: word(0), positions, rows };
            let (block, r) = place(raw, &self.placements, &self.lattice);
            rounding = rounding.max(r);
            sink(block)?;
        }
        Ok(rounding)
    }
}
