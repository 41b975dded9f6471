//! The second phase: the lattice is chosen, the chunks are planned, the columns laid out.

use lodestream_protocol::{
    Fine, LatticeBox, Manifest, Method as ManifestMethod, Primitive, Refinement, SourceInfo,
    is_color,
};

use super::{Job, chunks, read::Read};
use crate::{
    distribute,
    encode::Layout,
    error::Result,
    grid::{self, InputCoordinates},
    plan::Plan,
    schema::Schema,
    store::Store,
};

/// A node is split past this many points per grid cell of one of its faces. A sampled surface keeps
/// about one point a cell, so leaves and inner nodes hold alike numbers. On Autzen 2 makes 918 nodes
/// instead of the 2729 that 1 makes, saves 0.19 bytes a point and a fifth of the time; 4 saves
/// 0.06 bytes more but makes leaves that are slow to stream.
const LEAF_CAPACITY_PER_CELL_OF_A_FACE: u32 = 2;

/// How many points are built in core at once.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChunkSizes {
    /// Fewest: below, borders cost more than parallelism gains.
    pub(super) min: u64,
    /// Most.
    pub(super) max: u64,
    /// Chunks to aim for, so that all threads have work to the end.
    pub(super) wanted: u64,
}

pub(super) const CHUNK_SIZES: ChunkSizes = ChunkSizes { min: 1 << 17, max: 1 << 20, wanted: 16 };

/// What is known before anything is built.
pub(super) struct Planned {
    /// All points, on the lattice.
    pub(super) store: Store,
    pub(super) plan: Plan,
    pub(super) layout: Layout,
    /// All but what the tree and the columns will tell.
    pub(super) manifest: Manifest,
}

/// Plans the build of what was read.
///
/// # Errors
/// Where the coordinates fit no lattice, too many points coincide, or a temporary file fails.
pub(super) fn plan(job: &Job, read: Read, warnings: &mut Vec<String>) -> Result<Planned> {
    let (config, points) = (job.config, read.points());
    let points_per_input = read.writer.points.clone();
    let coordinates: Vec<InputCoordinates> = read
        .kinds
        .iter()
        .zip(read.writer.bounds.iter().zip(&read.writer.steps))
        .map(|(&kind, (&bounds, &steps))| InputCoordinates { kind, bounds, steps })
        .collect();
    let choice = grid::choose(&coordinates, points, config.scale)?;
    let raw = read.writer.finish()?;
    let mut store = raw.place(choice.placements, choice.lattice, &read.schema);
    let leaf_capacity = LEAF_CAPACITY_PER_CELL_OF_A_FACE * config.grid * config.grid;
    let sizes = job.sizes;
    let capacity =
        (points / sizes.wanted).clamp(sizes.min, sizes.max).max(u64::from(leaf_capacity));
    let mut plan = Plan::new(choice.lattice.side_bits);
    let row_bytes = read.schema.row_bytes;
    let scan = distribute::count(&mut store, &mut plan, capacity, row_bytes, &|| job.check())?;
    chunks::check(&plan, capacity, config.memory_bytes)?;
    if scan.rounding > 0.0 {
        let step = choice.lattice.scale;
        warnings.push(format!("coordinates are rounded to multiples of {step:e}"));
    }
    let constant = constant_attributes(&read.schema, &scan.constant_bytes);
    // Where the root has no cells, no node has.
    let cells = config.cells_per_spacing;
    let has_cells = cells > 0 && choice.lattice.side_bits > (cells * config.grid).ilog2() as u8;
    let has_fine = has_cells || cells > 0 && has_colors(&read.schema, &constant);
    let layout = Layout::new(&read.schema, &constant, &scan.first_row, has_fine);
    let sources = read.names.into_iter().zip(points_per_input);
    let manifest = Manifest {
        generator: concat!("lodestream ", env!("CARGO_PKG_VERSION")).into(),
        points,
        nodes: 0,
        levels: 0,
        refinement: Refinement::Additive,
        primitive: Primitive::Point,
        method: ManifestMethod {
            name: config.method.name().into(),
            grid: config.grid,
            leaf_capacity,
        },
        lattice: choice.lattice,
        bounds: scan.bounds.unwrap_or(LatticeBox::EMPTY),
        largest_rounding: scan.rounding,
        attributes: layout.attributes.clone(),
        groups: layout.groups.clone(),
        fine: layout.fine.map(|group| Fine {
            group,
            color: layout.fine_color.is_some(),
            cells_per_spacing: cells,
        }),
        crs: read.crs,
        sources: sources.map(|(name, points)| SourceInfo { name, points }).collect(),
    };
    Ok(Planned { store, plan, layout, manifest })
}

/// Whether there are colours that can be stored in two parts, and that differ.
fn has_colors(schema: &Schema, constant: &[bool]) -> bool {
    let mut attributes = schema.attributes.iter().zip(constant);
    attributes.any(|(a, &constant)| !constant && is_color(&a.name, a.scalar, a.components))
}

/// Attributes of which every byte is the same in every row.
fn constant_attributes(schema: &Schema, constant_bytes: &[bool]) -> Vec<bool> {
    schema
        .attributes
        .iter()
        .zip(&schema.offsets)
        .map(|(attribute, &offset)| {
            let len = crate::schema::value_bytes(attribute);
            // No points at all: nothing varies, but there is no value to keep either.
            constant_bytes.get(offset..offset + len).is_some_and(|b| b.iter().all(|&c| c))
        })
        .collect()
}
