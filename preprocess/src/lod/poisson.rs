//! Poisson-disk subsampling into a nested octree (Radner 2018, 3.1.1 and 5.1, algorithms 1 and 4).
//!
//! Each inner node keeps a subset of the points inside it with a minimum distance of its side over
//! the grid resolution (eq. 5.1: the own grid cell and its 26 neighbours are searched); the distance
//! halves from level to level. The thesis inserts points from the root down; here levels are sampled
//! from the deepest up, each node choosing among what its children chose, so that a level's points
//! and all above them keep the level's distance *together*, and every point is looked at in about
//! 1.3 levels instead of all.
//!
//! Distances hold across node borders as well: one grid spans all nodes of a level. Between chunks
//! that are sampled independently, [`Skin`]s carry the accepted points near the border.
//!
//! Candidates come in Morton order, so the points of a cell are neighbours in memory, and so are
//! those of a *brick* of 4³ cells. The 27 bricks around are looked up once a brick. A brick keeps a
//! bit for each of its cells with accepted points, so the neighbour cells of a cell are found by
//! masking at most eight words, once a cell, and most candidates fall to a point of their own cell.
//!
//! All distances are integers: nothing is lost at any offset or scale.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use lodestream_protocol::{MortonCode, morton_decode, morton_encode};

use crate::tree::{Tree, TreeNode};

/// Bits of a brick's side in cells.
const BRICK_BITS: u8 = 2;
const BRICK_SIDE: u32 = 1 << BRICK_BITS;
const BRICK_CELLS: usize = 1 << (3 * BRICK_BITS);

/// 4³ cells, by their Morton code inside the brick.
#[derive(Clone)]
struct Brick {
    /// Cells with accepted points.
    occupied: u64,
    /// Per occupied cell: its first accepted point,
    start: [u32; BRICK_CELLS],
    /// and how many there are: at most 8, as they keep a cell's side from one another.
    count: [u8; BRICK_CELLS],
}

impl Brick {
    const EMPTY: Self = Self { occupied: 0, start: [0; BRICK_CELLS], count: [0; BRICK_CELLS] };
}

/// The cells around one cell: per touched brick (among the 27 around) the bits of its cells.
type Around = [(u8, u64); 8];
/// Accepted points near the border of a chunk, level by level: what its neighbours must respect.
#[derive(Debug, Clone, Default)]
pub struct Skin {
    /// `(level, positions)`: lattice units relative to the root cube.
    pub levels: Vec<(u8, Vec<[u32; 3]>)>,
}

impl Skin {
    /// The positions of one level.
    pub fn level(&self, level: u8) -> &[[u32; 3]] {
        self.levels.iter().find(|(l, _)| *l == level).map_or(&[], |(_, positions)| positions)
    }
}

/// The cube that is sampled: where it lies in the root cube, and the grid.
#[derive(Debug, Clone, Copy)]
pub struct Domain {
    /// Lowest corner, lattice units relative to the root cube.
    pub corner: [u32; 3],
    /// Side in bits.
    pub bits: u8,
    /// log2 of the grid cells per node side.
    pub grid_bits: u8,
}

/// What sampling decided.
#[derive(Debug)]
pub struct Sampled {
    /// Level that each sorted point ends in, if that is an inner node of the tree; `u8::MAX` where
    /// the point stays in its leaf.
    pub level_of: Vec<u8>,
    /// `kept[i]` are the sorted points chosen at level `root_level + i`: those that end there and
    /// those that went further up. `starts[i][n] .. starts[i][n + 1]` belong to node `n`.
    pub kept: Vec<Vec<u32>>,
    /// See [`kept`](Self::kept).
    pub starts: Vec<Vec<u32>>,
    /// Accepted points near the domain's border.
    pub skin: Skin,
}

impl Sampled {
    /// Sorted points that end in node `node` of level `root_level + depth`.
    pub fn points_of<'a>(
        &'a self,
        tree: &'a Tree,
        depth: usize,
        node: usize,
    ) -> Box<dyn Iterator<Item = u32> + 'a> {
        let here = &tree.levels[depth][node];
        if here.is_leaf() {
            return Box::new(
                (here.start..here.end).filter(|&p| self.level_of[p as usize] == u8::MAX),
            );
        }
        let level = here.key.level();
        let range = self.starts[depth][node] as usize..self.starts[depth][node + 1] as usize;
        let chosen = self.kept[depth][range].iter().copied();
        Box::new(chosen.filter(move |&p| self.level_of[p as usize] == level))
    }

    /// Sorted points that stand for the whole tree: the root's choice, or all where it is a leaf.
    pub fn root_candidates(&self, tree: &Tree) -> Vec<u32> {
        let root = &tree.levels[0][0];
        if root.is_leaf() { (root.start..root.end).collect() } else { self.kept[0].clone() }
    }
}

/// Samples all inner nodes of `tree`, from the deepest level up.
///
/// `codes` are the sorted points' Morton codes relative to the domain. `neighbours` are the skins of
/// touching domains that were sampled before; points closer than the distance to theirs are not
/// accepted.
pub fn sample<C: MortonCode>(
    tree: &Tree,
    codes: &[C],
    domain: Domain,
    neighbours: &[&Skin],
) -> Sampled {
    let depth = tree.levels.len();
    let mut sampled = Sampled {
        level_of: vec![u8::MAX; codes.len()],
        kept: vec![Vec::new(); depth],
        starts: vec![Vec::new(); depth],
        skin: Skin::default(),
    };
    for d in (0..depth).rev() {
        let nodes = &tree.levels[d];
        if nodes.iter().all(TreeNode::is_leaf) {
            sampled.starts[d] = vec![0; nodes.len() + 1];
            continue;
        }
        let level = tree.root_level + d as u8;
        let node_bits = domain.bits - d as u8;
        let mut grid = Grid::new(domain, node_bits.saturating_sub(domain.grid_bits));
        grid.import(neighbours.iter().flat_map(|skin| skin.level(level)));
        let mut kept = Vec::new();
        let mut starts = Vec::with_capacity(nodes.len() + 1);
        let mut border = Vec::new();
        for node in nodes {
            starts.push(kept.len() as u32);
            for child in node.child_range() {
                let child_node = &tree.levels[d + 1][child];
                let mut offer = |p: u32| {
                    if let Some(position) = grid.offer(codes[p as usize]) {
                        kept.push(p);
                        sampled.level_of[p as usize] = level;
                        if grid.near_border(position) {
                            border.push(position);
                        }
                    }
                };
                if child_node.is_leaf() {
                    (child_node.start..child_node.end).for_each(&mut offer);
                } else {
                    let below = &sampled.starts[d + 1];
                    let range = below[child] as usize..below[child + 1] as usize;
                    sampled.kept[d + 1][range].iter().copied().for_each(&mut offer);
                }
            }
        }
        starts.push(kept.len() as u32);
        sampled.kept[d] = kept;
        sampled.starts[d] = starts;
        sampled.skin.levels.push((level, border));
    }
    sampled
}

/// Multiplies, as brick coordinates are small integers and the map is not exposed to anyone's keys
/// but the cloud's own; quality beyond the high bits is not needed.
#[derive(Default)]
struct BrickHasher(u64);

impl Hasher for BrickHasher {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }
    fn write_u64(&mut self, value: u64) {
        let mixed = (self.0 ^ value).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ mixed >> 29;
    }
    fn write_u32(&mut self, value: u32) {
        self.write_u64(u64::from(value));
    }
}

type BrickMap = HashMap<(u64, u32), u32, BuildHasherDefault<BrickHasher>>;

const NO_BRICK: u32 = u32::MAX;

/// Accepted points of one level, findable by cell.
struct Grid<C> {
    domain: Domain,
    /// Bits of a cell's side.
    cell_bits: u8,
    /// Smallest allowed squared distance, lattice units.
    min_distance2: u64,
    /// Bricks by their coordinates, which are biased by one so that the bricks just outside the
    /// domain have coordinates too.
    map: BrickMap,
    bricks: Vec<Brick>,
    /// Accepted positions, lattice units relative to the root cube; those of a cell in a row.
    accepted: Vec<[u32; 3]>,
    /// The brick at hand and the bricks around it, as 3x3x3 with x fastest.
    around: [u32; 27],
    brick_code: Option<C>,
    /// The cell at hand, and the accepted points of the cells around it.
    cell_code: Option<C>,
    cell_in_brick: usize,
    cell_start: usize,
    nearby: Vec<[u32; 3]>,
    nearby_known: bool,
    neighbours: &'static [Around; BRICK_CELLS],
}

impl<C: MortonCode> Grid<C> {
    fn new(domain: Domain, cell_bits: u8) -> Self {
        Self {
            domain,
            cell_bits,
            min_distance2: 1 << (2 * cell_bits),
            map: BrickMap::default(),
            bricks: Vec::new(),
            accepted: Vec::new(),
            around: [NO_BRICK; 27],
            brick_code: None,
            cell_code: None,
            cell_in_brick: 0,
            cell_start: 0,
            nearby: Vec::new(),
            nearby_known: false,
            neighbours: cell_neighbours(),
        }
    }

    /// Enters points accepted elsewhere that touch the domain from outside.
    fn import<'a>(&mut self, positions: impl Iterator<Item = &'a [u32; 3]>) {
        let cell_side = 1u64 << self.cell_bits;
        let mut cells: Vec<([u64; 3], [u32; 3])> = positions
            .filter_map(|&position| {
                let mut cell = [0; 3];
                for a in 0..3 {
                    // Biased by a brick, as in `map`.
                    let bias = cell_side << BRICK_BITS;
                    let inside = u64::from(position[a]) + bias;
                    let inside = inside.checked_sub(u64::from(self.domain.corner[a]))?;
                    cell[a] = inside >> self.cell_bits;
                    let cells = (1u64 << self.domain.bits) >> self.cell_bits;
                    let (first, last) =
                        (u64::from(BRICK_SIDE) - 1, u64::from(BRICK_SIDE) + cells.max(1));
                    if !(first..=last).contains(&cell[a]) {
                        return None;
                    }
                }
                Some((cell, position))
            })
            .collect();
        cells.sort_unstable();
        for same_cell in cells.chunk_by(|a, b| a.0 == b.0) {
            let cell = same_cell[0].0;
            let brick = self.brick_at(cell.map(|c| c >> BRICK_BITS));
            let local = cell.map(|c| (c as u32) & (BRICK_SIDE - 1));
            let cell = morton_encode(local) as usize;
            let brick = &mut self.bricks[brick as usize];
            brick.occupied |= 1 << cell;
            brick.start[cell] = self.accepted.len() as u32;
            brick.count[cell] = same_cell.len() as u8;
            self.accepted.extend(same_cell.iter().map(|(_, position)| position));
        }
    }

    fn key([x, y, z]: [u64; 3]) -> (u64, u32) {
        (x | y << 32, z as u32)
    }

    fn brick_at(&mut self, coords: [u64; 3]) -> u32 {
        *self.map.entry(Self::key(coords)).or_insert_with(|| {
            self.bricks.push(Brick::EMPTY);
            (self.bricks.len() - 1) as u32
        })
    }

    /// Accepts the point unless an accepted one is too near; gives its position if accepted.
    /// Points must come in Morton order.
    fn offer(&mut self, code: C) -> Option<[u32; 3]> {
        let local = code.decode();
        let cell = code.up(self.cell_bits);
        if self.cell_code != Some(cell) {
            self.enter_cell(cell, local);
        }
        let corner = self.domain.corner;
        let position: [u32; 3] = std::array::from_fn(|a| corner[a].wrapping_add(local[a]));
        let min_distance2 = self.min_distance2;
        let too_near = |other: &[u32; 3]| distance2(*other, position) < min_distance2;
        if self.accepted[self.cell_start..].iter().any(too_near) {
            return None;
        }
        if !self.nearby_known {
            self.gather_nearby();
        }
        if self.nearby.iter().any(too_near) {
            return None;
        }
        self.accepted.push(position);
        let brick = &mut self.bricks[self.around[13] as usize];
        brick.occupied |= 1 << self.cell_in_brick;
        brick.start[self.cell_in_brick] = self.cell_start as u32;
        brick.count[self.cell_in_brick] += 1;
        Some(position)
    }

    fn enter_cell(&mut self, cell: C, local: [u32; 3]) {
        let brick_code = cell.up(BRICK_BITS);
        if self.brick_code != Some(brick_code) {
            self.brick_code = Some(brick_code);
            let coords = local.map(|c| u64::from(c) >> self.cell_bits >> BRICK_BITS);
            let own = self.brick_at(coords.map(|c| c + 1));
            for (i, slot) in self.around.iter_mut().enumerate() {
                let step = [i % 3, i / 3 % 3, i / 9].map(|s| s as u64);
                // Biased by one already: a step of 0, 1, 2 is -1, 0, +1.
                let at = std::array::from_fn(|a| coords[a] + step[a]);
                *slot = self.map.get(&Self::key(at)).copied().unwrap_or(NO_BRICK);
            }
            self.around[13] = own;
        }
        self.cell_code = Some(cell);
        self.cell_in_brick = cell.within(BRICK_BITS).low_u64(0) as usize;
        self.cell_start = self.accepted.len();
        self.nearby_known = false;
    }

    fn gather_nearby(&mut self) {
        self.nearby.clear();
        self.nearby_known = true;
        for &(step, cells) in &self.neighbours[self.cell_in_brick] {
            let brick = self.around[usize::from(step)];
            if cells == 0 {
                break;
            }
            if brick == NO_BRICK {
                continue;
            }
            let brick = &self.bricks[brick as usize];
            let mut cells = brick.occupied & cells;
            while cells != 0 {
                let cell = cells.trailing_zeros() as usize;
                cells &= cells - 1;
                let start = brick.start[cell] as usize;
                let end = start + usize::from(brick.count[cell]);
                self.nearby.extend_from_slice(&self.accepted[start..end]);
            }
        }
    }

    /// Whether a point beyond the domain's border could be nearer than the minimum distance.
    fn near_border(&self, position: [u32; 3]) -> bool {
        let reach = 1u64 << self.cell_bits;
        let side = 1u64 << self.domain.bits;
        (0..3).any(|a| {
            let inside = u64::from(position[a] - self.domain.corner[a]);
            inside < reach || inside + reach >= side
        })
    }
}

fn distance2(a: [u32; 3], b: [u32; 3]) -> u64 {
    // Both lie in the same or touching cells of at most 2^31: the sum of squares fits.
    (0..3)
        .map(|i| {
            let d = u64::from(a[i].abs_diff(b[i]));
            d * d
        })
        .sum()
}

/// For each cell of a brick its 26 neighbours, by the bricks that they lie in.
fn cell_neighbours() -> &'static [Around; BRICK_CELLS] {
    static TABLE: std::sync::OnceLock<Box<[Around; BRICK_CELLS]>> = std::sync::OnceLock::new();
    TABLE.get_or_init(|| {
        let mut table = Box::new([[(0, 0); 8]; BRICK_CELLS]);
        for (cell, around) in table.iter_mut().enumerate() {
            let at = morton_decode(cell as u64);
            let mut cells = [0u64; 27];
            for step in (0..27u32).filter(|&s| s != 13) {
                let step = [step % 3, step / 3 % 3, step / 9];
                // Biased by a brick side, less the step's own bias of one.
                let moved: [u32; 3] = std::array::from_fn(|a| at[a] + step[a] + BRICK_SIDE - 1);
                let brick = moved.map(|m| m >> BRICK_BITS);
                let inside = moved.map(|m| m & (BRICK_SIDE - 1));
                let brick = (brick[0] + 3 * brick[1] + 9 * brick[2]) as usize;
                cells[brick] |= 1 << morton_encode(inside);
            }
            let touched = cells.iter().enumerate().filter(|(_, cells)| **cells != 0);
            for (slot, (brick, &cells)) in around.iter_mut().zip(touched) {
                *slot = (brick as u8, cells);
            }
        }
        table
    })
}
