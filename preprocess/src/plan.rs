//! The chunk plan: disjoint cubes of the octree that hold few enough points to be built in core.
//!
//! Points are counted on a grid; cells with too many points are counted again on a grid of their
//! own, and so on, so that one far outlier does not put the whole scan into one cell. Then cells are
//! merged upward as long as a cube's points fit. The plan depends on the points and the capacity
//! alone: not on threads, not on memory.

use lodestream_protocol::{MortonCode, NodeKey};

/// Levels that the first grid resolves: 128³ cells of four bytes are 8 MiB.
const FIRST_BITS: u8 = 7;
/// Levels that each further grid resolves.
const FURTHER_BITS: u8 = 5;

/// One chunk: a cube and the number of points in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chunk {
    /// The cube.
    pub key: NodeKey,
    /// Points inside.
    pub points: u64,
}

/// A grid over one cube.
#[derive(Debug)]
struct Table {
    key: NodeKey,
    /// Levels resolved below the cube.
    bits: u8,
    /// Per cell (x fastest): while counting a number of points, then a chunk's index, or
    /// `TABLE + ` the index of a finer table.
    cells: Vec<u32>,
}

const TABLE: u32 = 1 << 31;
const EMPTY: u32 = TABLE - 1;

/// Where every point belongs.
#[derive(Debug)]
pub struct Plan {
    side_bits: u8,
    tables: Vec<Table>,
    /// Tables whose counts have been taken: the first ones.
    settled: usize,
    /// Disjoint, in Morton order, none empty.
    pub chunks: Vec<Chunk>,
}

/// Counts points on the tables of one round.
#[derive(Debug, Clone)]
pub struct Counter {
    first_table: usize,
    counts: Vec<Vec<u32>>,
}

impl Counter {
    /// Adds another thread's counts.
    pub fn merge(&mut self, other: &Self) {
        for (mine, theirs) in self.counts.iter_mut().zip(&other.counts) {
            for (a, b) in mine.iter_mut().zip(theirs) {
                *a = a.saturating_add(*b);
            }
        }
    }
}

impl Plan {
    /// A plan that has counted nothing yet; call [`counter`](Self::counter), count all points,
    /// [`refine`](Self::refine), until that says that it is done.
    pub fn new(side_bits: u8) -> Self {
        let mut plan = Self { side_bits, tables: Vec::new(), settled: 0, chunks: Vec::new() };
        plan.add_table(NodeKey::ROOT, FIRST_BITS);
        plan
    }

    fn add_table(&mut self, key: NodeKey, bits: u8) {
        let bits = bits.min(self.side_bits - key.level());
        self.tables.push(Table { key, bits, cells: vec![0; 1 << (3 * bits)] });
    }

    fn cell(&self, table: &Table, q: [u32; 3]) -> usize {
        // Side bits of a cell of this table.
        let cell_bits = u32::from(self.side_bits - table.key.level() - table.bits);
        let mask = (1u32 << table.bits) - 1;
        let [x, y, z] = q.map(|c| (u64::from(c).checked_shr(cell_bits).unwrap_or(0) as u32) & mask);
        ((z << (2 * table.bits)) | (y << table.bits) | x) as usize
    }

    /// A counter for the newest tables.
    pub fn counter(&self) -> Counter {
        let counts = self.tables[self.settled..].iter().map(|t| vec![0; t.cells.len()]).collect();
        Counter { first_table: self.settled, counts }
    }

    /// Counts one point, if it lies in one of the newest tables.
    #[inline]
    pub fn count(&self, counter: &mut Counter, q: [u32; 3]) {
        let mut table = 0;
        loop {
            let cell = self.cell(&self.tables[table], q);
            if table >= counter.first_table {
                let count = &mut counter.counts[table - counter.first_table][cell];
                *count = count.saturating_add(1);
                return;
            }
            match self.tables[table].cells[cell] {
                finer if finer >= TABLE => table = (finer - TABLE) as usize,
                _ => return,
            }
        }
    }

    /// Takes the counts. Cells of more than `capacity` points get tables of their own: then another
    /// round of counting is needed, and this says `false`. Otherwise the chunks are final.
    pub fn refine(&mut self, counter: Counter, capacity: u64) -> bool {
        let first = counter.first_table;
        for (table, counts) in self.tables[first..].iter_mut().zip(counter.counts) {
            table.cells = counts;
        }
        self.settled = self.tables.len();
        let mut finer = Vec::new();
        for index in first..self.settled {
            self.settle(index, capacity, &mut finer);
        }
        let done = finer.is_empty();
        for (table, cell, key) in finer {
            self.tables[table].cells[cell] = TABLE + self.tables.len() as u32;
            self.add_table(key, FURTHER_BITS);
        }
        if done {
            self.sort_chunks();
        }
        done
    }

    /// Turns a table's counts into chunks: the largest cubes that fit.
    fn settle(&mut self, index: usize, capacity: u64, finer: &mut Vec<(usize, usize, NodeKey)>) {
        let (key, bits) = (self.tables[index].key, self.tables[index].bits);
        // sums[d]: points per cube d levels below the table's cube, Morton order.
        let mut sums: Vec<Vec<u64>> = vec![Vec::new(); usize::from(bits) + 1];
        let cell_of = |morton: usize| {
            let [x, y, z] = (morton as u64).decode();
            ((z << (2 * bits)) | (y << bits) | x) as usize
        };
        let cells = &self.tables[index].cells;
        sums[usize::from(bits)] = (0..cells.len()).map(|m| u64::from(cells[cell_of(m)])).collect();
        for d in (0..usize::from(bits)).rev() {
            sums[d] = sums[d + 1].chunks_exact(8).map(|c| c.iter().sum()).collect();
        }
        let mut assigned = vec![EMPTY; cells.len()];
        let mut stack = vec![(0u8, 0usize, key)];
        while let Some((d, morton, key)) = stack.pop() {
            let points = sums[usize::from(d)][morton];
            let unsplittable = key.level() == self.side_bits;
            if points == 0 {
                continue;
            }
            // A table's own cube was too full already: never take it whole again.
            if (points <= capacity && (d > 0 || key == NodeKey::ROOT)) || unsplittable {
                let chunk = self.chunks.len() as u32;
                self.chunks.push(Chunk { key, points });
                let span = 1usize << (3 * (bits - d));
                for m in morton * span..(morton + 1) * span {
                    assigned[cell_of(m)] = chunk;
                }
            } else if d == bits {
                finer.push((index, cell_of(morton), key));
            } else {
                for octant in 0..8u8 {
                    let child = key.child(octant).expect("above the finest level");
                    stack.push((d + 1, morton * 8 + usize::from(octant), child));
                }
            }
        }
        self.tables[index].cells = assigned;
    }

    fn sort_chunks(&mut self) {
        let side_bits = self.side_bits;
        let mut order: Vec<u32> = (0..self.chunks.len() as u32).collect();
        let code = |i: &u32| {
            let key = self.chunks[*i as usize].key;
            let up = u32::from(side_bits - key.level());
            u128::encode(key.coords().map(|c| (u64::from(c) << up) as u32))
        };
        order.sort_by_key(code);
        let mut rank = vec![0u32; order.len()];
        for (new, &old) in order.iter().enumerate() {
            rank[old as usize] = new as u32;
        }
        for cell in self.tables.iter_mut().flat_map(|t| &mut t.cells) {
            if *cell < EMPTY {
                *cell = rank[*cell as usize];
            }
        }
        self.chunks = order.iter().map(|&old| self.chunks[old as usize]).collect();
    }

    /// The chunk that a counted point belongs to.
    #[inline]
    pub fn chunk_of(&self, q: [u32; 3]) -> usize {
        let mut table = &self.tables[0];
        loop {
            match table.cells[self.cell(table, q)] {
                finer if finer >= TABLE => table = &self.tables[(finer - TABLE) as usize],
                chunk => return chunk as usize,
            }
        }
    }

    /// For each chunk the chunks whose cubes touch its cube.
    pub fn neighbours(&self) -> Vec<Vec<usize>> {
        let cube = |chunk: &Chunk| {
            let bits = u32::from(self.side_bits - chunk.key.level());
            let low = chunk.key.coords().map(|c| u64::from(c) << bits);
            (low, low.map(|c| c + (1u64 << bits)))
        };
        let cubes: Vec<_> = self.chunks.iter().map(cube).collect();
        let mut by_x: Vec<usize> = (0..cubes.len()).collect();
        by_x.sort_by_key(|&i| cubes[i].0[0]);
        let mut neighbours = vec![Vec::new(); cubes.len()];
        for (n, &i) in by_x.iter().enumerate() {
            for &j in &by_x[n + 1..] {
                if cubes[j].0[0] > cubes[i].1[0] {
                    break;
                }
                let touch = (0..3)
                    .all(|a| cubes[i].0[a] <= cubes[j].1[a] && cubes[j].0[a] <= cubes[i].1[a]);
                if touch {
                    neighbours[i].push(j);
                    neighbours[j].push(i);
                }
            }
        }
        for list in &mut neighbours {
            list.sort_unstable();
        }
        neighbours
    }
}
