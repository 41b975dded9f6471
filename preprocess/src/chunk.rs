//! One chunk in core: sort, split, sample, encode.
//!
//! All of a chunk but its root node is final once the chunk is sampled. What stands for the chunk at
//! its root's level goes on to the top of the tree, where ancestors choose among it.

use lodestream_protocol::{LatticeBox, Manifest, MortonCode, NodeKey};

use crate::{
    cones::{self, Normals},
    encode::{Layout, NodeEncoder, OutNode, Ranges},
    error::{Error, Result},
    lod::poisson::{self, Domain, Sampled, Skin},
    sort::sort_by_code,
    store::Block,
    tree::{Tree, TreeNode},
};

/// What every chunk is built with.
#[derive(Debug)]
pub struct Context<'a> {
    /// Lattice and method are read from here.
    pub manifest: &'a Manifest,
    /// The columns.
    pub layout: &'a Layout,
    /// log2 of the grid cells per node side.
    pub grid_bits: u8,
}

/// The points of one chunk.
#[derive(Debug)]
pub enum Points<'a> {
    /// Places `block << 16 | point` in the store's blocks, ascending.
    InStore(&'a [Block], Vec<u32>),
    /// Copied out of the spill file.
    Copied(Block),
}

impl Points<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::InStore(_, places) => places.len(),
            Self::Copied(block) => block.positions.len(),
        }
    }

    fn position(&self, point: u32) -> [u32; 3] {
        match self {
            Self::InStore(blocks, places) => {
                let place = places[point as usize] as usize;
                blocks[place >> 16].positions[place & 0xffff]
            }
            Self::Copied(block) => block.positions[point as usize],
        }
    }

    fn row(&self, point: u32, row_bytes: usize) -> &[u8] {
        match self {
            Self::InStore(blocks, places) => {
                let place = places[point as usize] as usize;
                &blocks[place >> 16].rows[(place & 0xffff) * row_bytes..][..row_bytes]
            }
            Self::Copied(block) => &block.rows[point as usize * row_bytes..][..row_bytes],
        }
    }
}

/// A chunk, built.
#[derive(Debug)]
pub struct Built {
    /// Every node below the chunk's root.
    pub nodes: Vec<OutNode>,
    /// The encoded payloads, per group.
    pub buffers: Vec<Vec<u8>>,
    /// Ranges of the encoded values.
    pub ranges: Ranges,
    /// The chunk's root node, which the top of the tree completes.
    pub root: Root,
    /// Accepted points near the chunk's border.
    pub skin: Skin,
}

/// What stands for a chunk at its root's level.
#[derive(Debug)]
pub struct Root {
    /// The chunk's cube.
    pub key: NodeKey,
    /// Octants of its children.
    pub child_mask: u8,
    /// Tight bounds of all points of the chunk.
    pub bounds: LatticeBox,
    /// Where there are normals: those of all points of the chunk.
    pub normals: Option<Normals>,
    /// Points in the chunk.
    pub points: u64,
    /// The candidates, in Morton order, relative to the root cube, with their rows.
    pub candidates: Block,
}

/// Builds a chunk. `neighbours` are the skins of touching chunks that were built before.
///
/// # Errors
/// [`Error::Setup`] where more points coincide than a node can hold.
pub fn build(
    context: &Context,
    key: NodeKey,
    part: u32,
    points: &Points,
    neighbours: &[&Skin],
) -> Result<Built> {
    let bits = context.manifest.lattice.node_bits(key.level());
    if bits <= <u64 as MortonCode>::AXIS_BITS {
        build_with::<u64>(context, key, part, points, neighbours)
    } else {
        build_with::<u128>(context, key, part, points, neighbours)
    }
}

fn build_with<C: MortonCode>(
    context: &Context,
    key: NodeKey,
    part: u32,
    points: &Points,
    neighbours: &[&Skin],
) -> Result<Built> {
    let lattice = &context.manifest.lattice;
    let bits = lattice.node_bits(key.level());
    let corner = lattice.node_min(key);
    let count = points.len() as u32;
    let mut codes: Vec<C> = (0..count)
        .map(|p| {
            let q = points.position(p);
            C::encode(std::array::from_fn(|a| q[a].wrapping_sub(corner[a])))
        })
        .collect();
    let mut order: Vec<u32> = (0..count).collect();
    sort_by_code(&mut codes, &mut order, 3 * u32::from(bits));
    let tree = Tree::split(key, bits, &codes, context.manifest.method.leaf_capacity);
    let domain = Domain { corner, bits, grid_bits: context.grid_bits };
    let sampled = poisson::sample(&tree, &codes, domain, neighbours);
    let bounds = tight_bounds(&tree, &codes, corner);
    let row_bytes = context.layout.row_bytes;
    let normals = context.layout.normal.map(|column| {
        let unit = |&point: &u32| column.unit(points.row(point, row_bytes));
        let units: Vec<[f32; 3]> = order.iter().map(unit).collect();
        cones::of_tree(&tree, &units)
    });

    let mut encoder = NodeEncoder::new(context.layout);
    let mut nodes = Vec::new();
    for depth in 1..tree.levels.len() {
        for (index, node) in tree.levels[depth].iter().enumerate() {
            let own: Vec<u32> = sampled.points_of(&tree, depth, index).collect();
            let tight = bounds[depth][index];
            let below = u64::from(node.end - node.start);
            let detail = Detail::of(context, node.key.level(), node.is_leaf(), tight, below);
            let mut out =
                encode_node(context, &mut encoder, node, tight, detail, part, &codes, &own, |p| {
                    points.row(order[p as usize], row_bytes)
                })?;
            out.normal_cone = normals.as_ref().map(|normals| normals[depth][index].cone);
            nodes.push(out);
        }
    }
    let chosen = sampled.root_candidates(&tree);
    let mut candidates = Block::default();
    for &p in &chosen {
        let point = order[p as usize];
        candidates.positions.push(points.position(point));
        candidates.rows.extend_from_slice(points.row(point, row_bytes));
    }
    let Sampled { skin, .. } = sampled;
    Ok(Built {
        nodes,
        buffers: encoder.buffers,
        ranges: encoder.ranges,
        root: Root {
            key,
            child_mask: tree.levels[0][0].child_mask,
            bounds: bounds[0][0],
            normals: normals.map(|normals| normals[0][0]),
            points: u64::from(count),
            candidates,
        },
        skin,
    })
}

/// Encodes one node of a tree whose sorted points have `codes` relative to the tree's root.
/// `own` are the sorted points it keeps. Normal cones are the caller's.
#[expect(clippy::too_many_arguments, reason = "one call site per tree, all of different kinds")]
pub fn encode_node<'r, C: MortonCode>(
    context: &Context,
    encoder: &mut NodeEncoder,
    node: &TreeNode,
    bounds: LatticeBox,
    detail: Detail,
    part: u32,
    codes: &[C],
    own: &[u32],
    row: impl Fn(u32) -> &'r [u8],
) -> Result<OutNode> {
    let level = node.key.level();
    let bits = context.manifest.lattice.node_bits(level);
    let starts = encoder.buffers.iter().map(|b| b.len() as u64).collect();
    let relative: Vec<C> = own.iter().map(|&p| codes[p as usize].within(bits)).collect();
    let cell_bits = context.manifest.cell_bits(level, detail.spacing);
    let payloads = encoder
        .encode(&relative, bits, cell_bits, |i| row(own[i]))
        .map_err(|e| Error::Setup(format!("node {}: {e}; too many points coincide", node.key)))?;
    Ok(OutNode {
        key: node.key,
        child_mask: node.child_mask,
        points: own.len() as u32,
        bounds,
        geometric_error: detail.geometric_error,
        spacing: detail.spacing,
        normal_cone: None,
        payloads,
        part,
        starts,
    })
}

/// How fine a node is, world units.
#[derive(Debug, Clone, Copy)]
pub struct Detail {
    /// How far the picture is off where the tree is cut here.
    pub geometric_error: f32,
    /// Between neighbouring points.
    pub spacing: f32,
}

impl Detail {
    /// Of a node of `points` points, those below it among them, in these bounds.
    pub fn of(
        context: &Context,
        level: u8,
        is_leaf: bool,
        bounds: LatticeBox,
        points: u64,
    ) -> Self {
        let guaranteed = context.manifest.spacing_world(level);
        if is_leaf {
            let mean = leaf_spacing(context, bounds, points);
            Self { geometric_error: 0.0, spacing: mean.min(guaranteed) as f32 }
        } else {
            Self { geometric_error: guaranteed as f32, spacing: guaranteed as f32 }
        }
    }
}

/// Mean distance of neighbours were the points spread over the largest face of their bounds.
fn leaf_spacing(context: &Context, bounds: LatticeBox, points: u64) -> f64 {
    if points == 0 {
        return 0.0;
    }
    let mut sides: [f64; 3] =
        std::array::from_fn(|a| f64::from(bounds.max[a].saturating_sub(bounds.min[a])) + 1.0);
    sides.sort_by(f64::total_cmp);
    (sides[1] * sides[2] / points as f64).sqrt() * context.manifest.lattice.scale
}

/// Tight bounds of every node's points, and of all below.
fn tight_bounds<C: MortonCode>(tree: &Tree, codes: &[C], corner: [u32; 3]) -> Vec<Vec<LatticeBox>> {
    let mut bounds: Vec<Vec<LatticeBox>> =
        tree.levels.iter().map(|nodes| vec![LatticeBox::EMPTY; nodes.len()]).collect();
    for depth in (0..tree.levels.len()).rev() {
        let (upper, lower) = bounds.split_at_mut(depth + 1);
        for (node, tight) in tree.levels[depth].iter().zip(&mut upper[depth]) {
            if node.is_leaf() {
                for code in &codes[node.range()] {
                    tight.grow(code.decode());
                }
            } else {
                node.child_range().for_each(|child| tight.merge(&lower[0][child]));
            }
        }
    }
    let shift = |q: [u32; 3]| std::array::from_fn(|a| corner[a].wrapping_add(q[a]));
    for tight in bounds.iter_mut().flatten() {
        *tight = LatticeBox { min: shift(tight.min), max: shift(tight.max) };
    }
    bounds
}
