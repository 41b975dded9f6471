//! The build: files in, one dataset file out.
//!
//! Read once → choose the lattice → count and plan chunks → distribute → build every chunk in core →
//! join the top of the tree → write. See `ARCHITECTURE.md` for why each step is as it is.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    time::Instant,
};

use lodestream_protocol::{
    LatticeBox, Manifest, Method as ManifestMethod, MortonCode, NodeKey, Primitive, Refinement,
    SourceInfo,
};
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    assemble,
    blobs::Blobs,
    chunk::{self, Context},
    cones::Normals,
    distribute,
    encode::{Layout, NodeEncoder, OutNode, Ranges},
    error::{Error, Result},
    grid::{self, InputCoordinates},
    inputs::{self, OpenedInput},
    lod::poisson::{self, Domain, Skin},
    memory,
    plan::Plan,
    readers::CoordinateKind,
    schedule,
    schema::{RowMap, Schema},
    store::{RawBlock, Store, StoreWriter},
    target::folder_of,
    tree::Tree,
};

/// How levels of detail are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Method {
    /// Poisson-disk subsampling into a nested octree (Radner 2018, 3.1.1 and 5.1).
    #[default]
    Poisson,
}

impl Method {
    /// The name on the command line and in the manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Poisson => "poisson",
        }
    }
}

/// What to build.
#[derive(Debug, Clone)]
pub struct BuildConfig {
    /// Files, folders, or simulated scans (`sim:courtyard?points=2M&seed=1`).
    pub inputs: Vec<String>,
    /// The dataset file.
    pub output: PathBuf,
    /// How levels of detail are made.
    pub method: Method,
    /// Grid cells per node side: a power of two, 4 to 1024.
    pub grid: u32,
    /// Memory the build may take, in bytes.
    pub memory_bytes: u64,
    /// Threads; `None`: as many as the machine has.
    pub threads: Option<usize>,
    /// Names of attributes to leave out.
    pub drop_attributes: Vec<String>,
    /// What the columns of text inputs are; `None`: detected.
    pub columns: Option<String>,
    /// Lattice step in world units; `None`: the inputs' own, or far below the point spacing.
    pub scale: Option<f64>,
    /// Set to stop the build.
    pub cancel: Arc<AtomicBool>,
}

/// Hears how the build gets on. Called from many threads.
pub trait Progress: Sync {
    /// A phase begins: `total` of `unit` are to be done (0: unknown).
    fn phase(&self, name: &str, total: u64, unit: &str);
    /// So much more of the phase is done.
    fn advance(&self, amount: u64);
    /// Something that the user should know.
    fn warn(&self, line: &str);
}

/// What was built. Also the `--report` of `lodestream build`.
#[derive(Debug, Clone, Serialize)]
pub struct BuildReport {
    /// The dataset file.
    pub output: PathBuf,
    /// Points in the inputs.
    pub points_read: u64,
    /// Points in the dataset.
    pub points_written: u64,
    /// Points left out, by reason.
    pub dropped: Vec<Dropped>,
    /// Largest distance on any axis between a source coordinate and its lattice point, world units.
    pub largest_coordinate_error: f64,
    /// World units per lattice unit.
    pub scale: f64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Levels in the tree.
    pub levels: u8,
    /// Chunks built in core.
    pub chunks: u64,
    /// Whether the points went through temporary files.
    pub spilled: bool,
    /// Seconds per phase, in order.
    pub seconds: Vec<PhaseSeconds>,
    /// Seconds in all.
    pub total_seconds: f64,
    /// Most memory the process has held, in bytes, where the system tells.
    pub peak_memory_bytes: Option<u64>,
    /// Length of the dataset file.
    pub file_bytes: u64,
    /// Header, manifest and hierarchy.
    pub index_bytes: u64,
    /// Encoded bytes per column; constants take none.
    pub columns: Vec<ColumnBytes>,
    /// What a user should know of, one line each.
    pub warnings: Vec<String>,
}

/// Points left out of the dataset for one reason.
#[derive(Debug, Clone, Serialize)]
pub struct Dropped {
    /// Input and reason.
    pub reason: String,
    /// How many.
    pub points: u64,
}

/// Time spent in a phase.
#[derive(Debug, Clone, Serialize)]
pub struct PhaseSeconds {
    /// Phase.
    pub phase: String,
    /// Wall-clock seconds.
    pub seconds: f64,
}

/// Size of a column.
#[derive(Debug, Clone, Serialize)]
pub struct ColumnBytes {
    /// Attribute, or `position`.
    pub name: String,
    /// Encoded bytes over all nodes.
    pub bytes: u64,
    /// Encoded bytes per point of the dataset.
    pub bytes_per_point: f64,
}

/// A node is split past this many points per grid cell of one of its faces. A sampled surface keeps
/// about one point a cell, so leaves and inner nodes hold alike numbers. On Autzen 2 makes 918 nodes
/// instead of the 2729 that 1 makes, saves 0.19 bytes a point and a fifth of the time; 4 saves
/// 0.06 bytes more but makes leaves that are slow to stream.
const LEAF_CAPACITY_PER_CELL_OF_A_FACE: u32 = 2;
/// How many points are built in core at once.
#[derive(Debug, Clone, Copy)]
struct ChunkSizes {
    /// Fewest: below, borders cost more than parallelism gains.
    min: u64,
    /// Most.
    max: u64,
    /// Chunks to aim for, so that all threads have work to the end.
    wanted: u64,
}

const CHUNK_SIZES: ChunkSizes = ChunkSizes { min: 1 << 17, max: 1 << 20, wanted: 16 };
/// Bytes of working memory per point of a chunk in core, besides its rows.
const CHUNK_BYTES_PER_POINT: u64 = 80;
/// Bytes of a normal's direction while cones are measured.
const UNIT_NORMAL_BYTES: u64 = 12;

/// What stays of a chunk when its payloads are put away.
type ChunkResult = (Vec<OutNode>, Ranges, chunk::Root);

struct Phases<'a> {
    progress: &'a dyn Progress,
    started: Instant,
    done: Vec<PhaseSeconds>,
    name: String,
}

impl Phases<'_> {
    fn begin(&mut self, name: &str, total: u64, unit: &str) {
        self.end();
        self.name = name.into();
        self.started = Instant::now();
        self.progress.phase(name, total, unit);
    }

    fn end(&mut self) {
        if !self.name.is_empty() {
            let seconds = self.started.elapsed().as_secs_f64();
            self.done.push(PhaseSeconds { phase: std::mem::take(&mut self.name), seconds });
        }
    }
}

/// Builds a dataset.
///
/// The same inputs and parameters give the same bytes, for any number of threads and any memory.
///
/// # Errors
/// What is wrong with an input, the options, the disk; [`Error::Interrupted`] when cancelled.
/// Nothing is left at the output's place then that was not there before.
pub fn build(config: &BuildConfig, progress: &dyn Progress) -> Result<BuildReport> {
    build_in_chunks(config, CHUNK_SIZES, progress)
}

fn build_in_chunks(
    config: &BuildConfig,
    sizes: ChunkSizes,
    progress: &dyn Progress,
) -> Result<BuildReport> {
    if !(4..=1024).contains(&config.grid) || !config.grid.is_power_of_two() {
        return Err(Error::Setup(format!(
            "--grid {}: must be a power of two from 4 to 1024",
            config.grid
        )));
    }
    if config.scale.is_some_and(|s| !(s.is_finite() && s > 0.0)) {
        return Err(Error::Setup("--scale must be a finite number above zero".into()));
    }
    let threads = config
        .threads
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
        .max(1);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Setup(format!("cannot start {threads} threads: {e}")))?;
    pool.install(|| build_in_pool(config, sizes, threads, progress))
}

fn build_in_pool(
    config: &BuildConfig,
    sizes: ChunkSizes,
    threads: usize,
    progress: &dyn Progress,
) -> Result<BuildReport> {
    let begun = Instant::now();
    let check = || match config.cancel.load(Ordering::Relaxed) {
        true => Err(Error::Interrupted),
        false => Ok(()),
    };
    let folder = folder_of(&config.output);
    check_output(&config.output, folder)?;
    let mut warnings: Vec<String> = Vec::new();
    let mut phases = Phases { progress, started: begun, done: Vec::new(), name: String::new() };

    let opened = inputs::open_all(&config.inputs, config.columns.as_deref())?;
    for input in &opened {
        for line in &input.info.left_out {
            warnings.push(format!("{}: {line}", input.info.path));
        }
    }
    let announced: Option<u64> = opened.iter().map(|i| i.info.points).sum();
    check_disk(&opened, config, folder)?;
    phases.begin("read", announced.unwrap_or(0), "points");
    let read = read_all(config, opened, folder, &check, progress, &mut warnings)?;
    let points: u64 = read.writer.points.iter().sum();
    let points_per_input = read.writer.points.clone();
    if points == 0 {
        let dropped: u64 = read.dropped.iter().map(|d| d.points).sum();
        let reasons: Vec<&str> = read.dropped.iter().map(|d| d.reason.as_str()).collect();
        return Err(Error::Setup(match dropped {
            0 => format!("{}: no points, so there is nothing to build", read.names.join(", ")),
            _ => format!("all {dropped} points are unusable: {}", reasons.join("; ")),
        }));
    }

    phases.begin("plan", points, "points");
    let coordinates: Vec<InputCoordinates> = read
        .kinds
        .iter()
        .zip(read.writer.bounds.iter().zip(&read.writer.steps))
        .map(|(&kind, (&bounds, &steps))| InputCoordinates { kind, bounds, steps })
        .collect();
    let choice = grid::choose(&coordinates, points, config.scale)?;
    let raw = read.writer.finish()?;
    let mut store = raw.place(choice.placements, choice.lattice, &read.schema);
    let spilled = matches!(store, Store::File(_));
    let leaf_capacity = LEAF_CAPACITY_PER_CELL_OF_A_FACE * config.grid * config.grid;
    let capacity =
        (points / sizes.wanted).clamp(sizes.min, sizes.max).max(u64::from(leaf_capacity));
    let mut plan = Plan::new(choice.lattice.side_bits);
    let row_bytes = read.schema.row_bytes;
    let scan = distribute::count(&mut store, &mut plan, capacity, row_bytes, &check)?;
    check_chunks(&plan, capacity, config.memory_bytes)?;
    if scan.rounding > 0.0 {
        let step = choice.lattice.scale;
        warnings.push(format!("coordinates are rounded to multiples of {step:e}"));
    }
    let constant = constant_attributes(&read.schema, &scan.constant_bytes);
    let layout = Layout::new(&read.schema, &constant, &scan.first_row);
    let mut manifest = Manifest {
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
        crs: read.crs,
        sources: read
            .names
            .iter()
            .zip(points_per_input)
            .map(|(name, points)| SourceInfo { name: name.clone(), points })
            .collect(),
    };
    let write_buffers = config.memory_bytes / 8;
    let points_by_chunk =
        distribute::distribute(store, &plan, &layout, folder, write_buffers, &check)?;

    phases.begin("build", points, "points");
    let context =
        Context { manifest: &manifest, layout: &layout, grid_bits: config.grid.ilog2() as u8 };
    let neighbours = plan.neighbours();
    let dependencies = schedule::dependencies(&neighbours);
    let chunks = plan.chunks.len();
    let blobs = Blobs::new(chunks + 1, config.memory_bytes / 4, folder.to_path_buf());
    let skins: Vec<Mutex<Option<Arc<Skin>>>> = (0..chunks).map(|_| Mutex::new(None)).collect();
    let results: Vec<Mutex<Option<ChunkResult>>> = (0..chunks).map(|_| Mutex::new(None)).collect();
    let normal_bytes = if layout.normal.is_some() { UNIT_NORMAL_BYTES } else { 0 };
    let point_bytes = CHUNK_BYTES_PER_POINT + normal_bytes + 2 * layout.row_bytes as u64;
    let cost = |i: usize| plan.chunks[i].points * point_bytes;
    schedule::run(&dependencies, threads, cost, config.memory_bytes / 2, |i| {
        check()?;
        let near: Vec<Arc<Skin>> = dependencies[i]
            .iter()
            .filter_map(|&j| skins[j].lock().expect("no holder panics").clone())
            .collect();
        let near: Vec<&Skin> = near.iter().map(AsRef::as_ref).collect();
        let points = points_by_chunk.points(&plan, i, folder)?;
        let built = chunk::build(&context, plan.chunks[i].key, i as u32, &points, &near)?;
        *skins[i].lock().expect("no holder panics") = Some(Arc::new(built.skin));
        blobs.put(i, built.buffers)?;
        let result = Some((built.nodes, built.ranges, built.root));
        *results[i].lock().expect("no holder panics") = result;
        progress.advance(plan.chunks[i].points);
        Ok(())
    })?;
    drop(points_by_chunk);
    let skins: Vec<Arc<Skin>> =
        skins.into_iter().filter_map(|skin| skin.into_inner().expect("no holder panics")).collect();

    phases.begin("join", 0, "");
    let mut nodes = Vec::new();
    let mut ranges = Ranges::new(&layout);
    let mut roots = Vec::with_capacity(chunks);
    for result in results {
        let result = result.into_inner().expect("no holder panics");
        let (chunk_nodes, chunk_ranges, root) = result.expect("every chunk was built");
        nodes.extend(chunk_nodes);
        ranges.merge(&chunk_ranges);
        roots.push(root);
    }
    if !roots.is_empty() {
        let top = if choice.lattice.side_bits <= <u64 as MortonCode>::AXIS_BITS {
            join::<u64>(&context, roots, &skins, chunks as u32)?
        } else {
            join::<u128>(&context, roots, &skins, chunks as u32)?
        };
        nodes.extend(top.nodes);
        ranges.merge(&top.ranges);
        blobs.put(chunks, top.buffers)?;
    }
    check()?;
    assemble::prune(&mut nodes);
    assemble::sort(&mut nodes);
    manifest.nodes = nodes.len() as u64;
    manifest.levels = nodes.last().map_or(0, |n| n.key.level() + 1);
    ranges.fill(&mut manifest);

    let blobs = blobs.finish();
    let payload_bytes: u64 = ranges.column_bytes.iter().sum();
    phases.begin("write", payload_bytes, "bytes");
    let written = assemble::write(&config.output, &manifest, &nodes, &blobs, &|bytes| {
        progress.advance(bytes);
        check()
    })?;
    phases.end();

    for line in &warnings {
        progress.warn(line);
    }
    let names =
        std::iter::once("position").chain(manifest.attributes.iter().map(|a| a.name.as_str()));
    Ok(BuildReport {
        output: config.output.clone(),
        points_read: read.points_read,
        points_written: points,
        dropped: read.dropped,
        largest_coordinate_error: scan.rounding,
        scale: choice.lattice.scale,
        nodes: manifest.nodes,
        levels: manifest.levels,
        chunks: chunks as u64,
        spilled,
        seconds: phases.done,
        total_seconds: begun.elapsed().as_secs_f64(),
        peak_memory_bytes: memory::peak_bytes(),
        file_bytes: written.file_bytes,
        index_bytes: written.index_bytes,
        columns: names
            .zip(&ranges.column_bytes)
            .map(|(name, &bytes)| ColumnBytes {
                name: name.into(),
                bytes,
                bytes_per_point: bytes as f64 / points.max(1) as f64,
            })
            .collect(),
        warnings,
    })
}

/// Refuses before any work what cannot be written at its end.
fn check_output(output: &Path, folder: &Path) -> Result<()> {
    if output.is_dir() {
        return Err(Error::Setup(format!(
            "{}: is a folder; name a file, as in {}",
            output.display(),
            output.join("NAME.lods").display()
        )));
    }
    tempfile::tempfile_in(folder).map_err(Error::io(folder, "cannot create files here"))?;
    Ok(())
}

/// Refuses before any work what the disk surely has no room for: the temporary files, where the points
/// do not fit the memory, and a quarter of the raw points as the dataset.
fn check_disk(opened: &[OpenedInput], config: &BuildConfig, folder: &Path) -> Result<()> {
    let raw: u64 = opened
        .iter()
        .map(|input| {
            let row = Schema::new(input.info.attributes.clone()).row_bytes as u64;
            let position = match input.info.coordinates {
                CoordinateKind::Scaled { .. } => 12,
                CoordinateKind::Float { .. } => 24,
            };
            input.info.points.unwrap_or(0).saturating_mul(position + row)
        })
        .fold(0, u64::saturating_add);
    let temporary = if raw > config.memory_bytes / 2 { raw.saturating_mul(2) } else { 0 };
    let needed = temporary.saturating_add(raw / 4);
    // Where the system does not tell, the build finds out.
    let Ok(free) = fs4::available_space(folder) else { return Ok(()) };
    if free < needed {
        let memory = if temporary > 0 { " or raise --memory" } else { "" };
        return Err(Error::Setup(format!(
            "{}: the build needs about {} MiB of disk, {} MiB are free; choose another place for the \
             output{memory}",
            folder.display(),
            needed >> 20,
            free >> 20
        )));
    }
    Ok(())
}

/// What reading found.
struct Read {
    schema: Schema,
    writer: StoreWriter,
    kinds: Vec<CoordinateKind>,
    names: Vec<String>,
    crs: Option<String>,
    points_read: u64,
    dropped: Vec<Dropped>,
}

fn read_all(
    config: &BuildConfig,
    opened: Vec<OpenedInput>,
    folder: &Path,
    check: &dyn Fn() -> Result<()>,
    progress: &dyn Progress,
    warnings: &mut Vec<String>,
) -> Result<Read> {
    let schema =
        Schema::union(opened.iter().map(|i| &i.info.attributes[..]), &config.drop_attributes);
    for name in &config.drop_attributes {
        if !opened.iter().any(|i| i.info.attributes.iter().any(|a| a.name == *name)) {
            return Err(Error::Setup(format!("--drop {name}: no input has this attribute")));
        }
    }
    let mut read = Read {
        writer: StoreWriter::new(opened.len(), config.memory_bytes / 2, folder),
        kinds: Vec::new(),
        names: Vec::new(),
        crs: None,
        points_read: 0,
        dropped: Vec::new(),
        schema,
    };
    for (index, input) in opened.into_iter().enumerate() {
        let info = input.info;
        for attribute in &read.schema.attributes {
            if !info.attributes.iter().any(|a| a.name == attribute.name) {
                let name = &attribute.name;
                warnings.push(format!("{}: has no {name}; stored as zero", info.path));
            }
        }
        match (&read.crs, &info.crs) {
            (None, Some(crs)) => read.crs = Some(crs.clone()),
            (Some(known), Some(crs)) if known != crs => warnings.push(format!(
                "{}: its coordinate reference system differs from that of the inputs before; \
                 coordinates are taken as they are",
                info.path
            )),
            _ => {}
        }
        let map = RowMap::new(&info.attributes, &read.schema);
        let (schema, writer) = (&read.schema, &mut read.writer);
        let report = input.reader.read(&mut |block| {
            check()?;
            let count = block.positions.len();
            let rows = map.apply(block.attributes, count, schema);
            writer.push(RawBlock { input: index as u32, positions: block.positions, rows })?;
            progress.advance(count as u64);
            Ok(())
        })?;
        read.points_read += report.points_read;
        for (reason, points) in report.dropped {
            read.dropped.push(Dropped { reason: format!("{}: {reason}", info.path), points });
        }
        warnings.extend(report.warnings.iter().map(|line| format!("{}: {line}", info.path)));
        read.kinds.push(match info.coordinates {
            CoordinateKind::Float { single_precision, decimals } => {
                CoordinateKind::Float { decimals: report.decimals.or(decimals), single_precision }
            }
            scaled => scaled,
        });
        read.names.push(inputs::display_name(&info.path));
    }
    Ok(read)
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

fn check_chunks(plan: &Plan, capacity: u64, memory_bytes: u64) -> Result<()> {
    let Some(largest) = plan.chunks.iter().max_by_key(|c| c.points) else { return Ok(()) };
    let needed = largest.points * CHUNK_BYTES_PER_POINT;
    if largest.points > capacity && needed > memory_bytes {
        return Err(Error::Setup(format!(
            "{} points coincide in one place; building them takes {} MiB: raise --memory",
            largest.points,
            needed >> 20
        )));
    }
    Ok(())
}

struct Joined {
    nodes: Vec<OutNode>,
    buffers: Vec<Vec<u8>>,
    ranges: Ranges,
}

/// Builds the tree above the chunks from what stands for each, and completes the chunks' roots.
fn join<C: MortonCode>(
    context: &Context,
    roots: Vec<chunk::Root>,
    skins: &[Arc<Skin>],
    part: u32,
) -> Result<Joined> {
    let lattice = &context.manifest.lattice;
    let row_bytes = context.layout.row_bytes;
    let mut codes: Vec<C> = Vec::new();
    let mut leaves = Vec::with_capacity(roots.len());
    for root in &roots {
        let start = codes.len() as u32;
        codes.extend(root.candidates.positions.iter().map(|&q| C::encode(q)));
        leaves.push((root.key, start..codes.len() as u32));
    }
    let tree = Tree::above(&leaves);
    let domain = Domain { corner: [0; 3], bits: lattice.side_bits, grid_bits: context.grid_bits };
    // Chunks reach up to different levels: beside a node sampled here there may be nodes of the same
    // level that were sampled in their chunk.
    let skins: Vec<&Skin> = skins.iter().map(AsRef::as_ref).collect();
    let sampled = poisson::sample(&tree, &codes, domain, &skins);
    // A leaf of this tree is a chunk's root.
    let root_index: HashMap<NodeKey, usize> =
        leaves.iter().enumerate().map(|(i, (key, _))| (*key, i)).collect();
    let root_of = |key: NodeKey| root_index.get(&key).copied();
    let mut bounds: Vec<Vec<LatticeBox>> = vec![Vec::new(); tree.levels.len()];
    for depth in (0..tree.levels.len()).rev() {
        let boxes = tree.levels[depth].iter().map(|node| {
            if node.is_leaf() {
                return root_of(node.key).map_or(LatticeBox::EMPTY, |r| roots[r].bounds);
            }
            let mut tight = LatticeBox::EMPTY;
            bounds[depth + 1][node.child_range()].iter().for_each(|b| tight.merge(b));
            tight
        });
        bounds[depth] = boxes.collect();
    }
    let mut normals: Vec<Vec<Option<Normals>>> = vec![Vec::new(); tree.levels.len()];
    for depth in (0..tree.levels.len()).rev() {
        let nodes = tree.levels[depth].iter().map(|node| {
            if node.is_leaf() {
                return root_of(node.key).and_then(|r| roots[r].normals);
            }
            context.layout.normal?;
            let below = normals[depth + 1][node.child_range()].iter();
            Some(Normals::of_children(below.flatten()))
        });
        normals[depth] = nodes.collect();
    }
    let all: Vec<(usize, usize)> = (0..tree.levels.len())
        .flat_map(|d| (0..tree.levels[d].len()).map(move |n| (d, n)))
        .collect();
    let row = |p: u32| -> &[u8] {
        let chunk = leaves.partition_point(|(_, range)| range.end <= p);
        let inside = (p - leaves[chunk].1.start) as usize;
        &roots[chunk].candidates.rows[inside * row_bytes..][..row_bytes]
    };
    let encoded: Vec<(OutNode, Vec<Vec<u8>>, Ranges)> = all
        .par_iter()
        .map(|&(depth, index)| {
            let node = &tree.levels[depth][index];
            let own: Vec<u32> = sampled.points_of(&tree, depth, index).collect();
            let mut encoder = NodeEncoder::new(context.layout);
            let tight = bounds[depth][index];
            let mut out =
                chunk::encode_node(context, &mut encoder, node, tight, part, &codes, &own, row)?;
            out.normal_cone = normals[depth][index].map(|normals| normals.cone);
            if let Some(root) = node.is_leaf().then(|| root_of(node.key)).flatten() {
                let guaranteed = context.manifest.spacing_world(node.key.level());
                out.child_mask = roots[root].child_mask;
                if out.child_mask != 0 {
                    out.geometric_error = guaranteed as f32;
                    out.spacing = guaranteed as f32;
                } else {
                    let mean = chunk::leaf_spacing(context, tight, roots[root].points);
                    out.spacing = mean.min(guaranteed) as f32;
                }
            }
            Ok((out, encoder.buffers, encoder.ranges))
        })
        .collect::<Result<_>>()?;
    let mut joined = Joined {
        nodes: Vec::with_capacity(encoded.len()),
        buffers: vec![Vec::new(); context.layout.groups.len()],
        ranges: Ranges::new(context.layout),
    };
    for (mut node, buffers, ranges) in encoded {
        node.starts = joined.buffers.iter().map(|b| b.len() as u64).collect();
        for (all, own) in joined.buffers.iter_mut().zip(&buffers) {
            all.extend_from_slice(own);
        }
        joined.ranges.merge(&ranges);
        joined.nodes.push(node);
    }
    Ok(joined)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readers::las::tests::scan::{Compression, Scan};
    use crate::verify::{VerifyConfig, verify};
    use lodestream_protocol::{Dataset, NormalCone, ScalarType};
    use proptest::prelude::*;

    struct Quiet;

    impl Progress for Quiet {
        fn phase(&self, _: &str, _: u64, _: &str) {}
        fn advance(&self, _: u64) {}
        fn warn(&self, _: &str) {}
    }

    /// Clouds that octrees find hard: noise, needles, sheets, clumps, duplicates, outliers.
    fn cloud() -> impl Strategy<Value = Vec<[i64; 3]>> {
        let shape = prop_oneof![
            Just([1 << 20, 1 << 20, 1 << 20]),
            Just([1 << 20, 1 << 18, 64]),
            Just([1 << 22, 4, 4]),
            Just([16, 16, 16]),
            Just([1, 1, 1]),
            Just([1 << 31, 1 << 31, 1 << 31]),
        ];
        let clump = (shape, any::<[u16; 3]>(), 1usize..600, any::<u64>());
        prop::collection::vec(clump, 1..4).prop_map(|clumps| {
            let mut points = Vec::new();
            for (shape, at, count, seed) in clumps {
                let mut state = seed | 1;
                let mut next = |limit: i64| {
                    state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                    i64::try_from(state >> 33).unwrap_or(0) % limit
                };
                for _ in 0..count {
                    points.push(std::array::from_fn(|a| i64::from(at[a]) + next(shape[a])));
                }
            }
            points
        })
    }

    fn config(
        folder: &Path,
        points: &[[i64; 3]],
        threads: usize,
        memory_bytes: u64,
    ) -> BuildConfig {
        let input = folder.join("cloud.xyz");
        let text: String =
            points.iter().enumerate().map(|(i, [x, y, z])| format!("{x} {y} {z} {i}\n")).collect();
        std::fs::write(&input, text).expect("temporary folder");
        BuildConfig {
            inputs: vec![input.display().to_string()],
            output: folder.join(format!("out-{threads}-{memory_bytes}.lods")),
            method: Method::Poisson,
            grid: 4,
            memory_bytes,
            threads: Some(threads),
            drop_attributes: Vec::new(),
            columns: Some("x,y,z,number".into()),
            scale: None,
            cancel: Arc::default(),
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn every_point_is_kept_at_its_distance_in_the_same_bytes(points in cloud()) {
            let folder = tempfile::tempdir().expect("temporary folder");
            let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
            let mut files = Vec::new();
            for threads in [1, 3] {
                let config = config(folder.path(), &points, threads, 1 << 30);
                let report = build_in_chunks(&config, sizes, &Quiet).expect("builds");
                prop_assert_eq!(report.points_written, points.len() as u64);
                files.push(std::fs::read(&config.output).expect("written"));
                let verified = verify(
                    &VerifyConfig {
                        dataset: config.output.clone(),
                        against: config.inputs.clone(),
                        columns: config.columns.clone(),
                        cancel: Arc::default(),
                    },
                    &Quiet,
                );
                let verified = verified.expect("opens");
                prop_assert!(verified.is_sound(), "{:?}", verified.findings);
                prop_assert!(verified.against.is_some_and(|c| c.identical));
            }
            prop_assert!(files[0] == files[1], "threads change the bytes");
        }
    }

    /// A line per point: place, normal.
    fn text_with_normals(points: &[([i64; 3], [i32; 3])]) -> String {
        let line = |([x, y, z], [nx, ny, nz]): &([i64; 3], [i32; 3])| {
            // Of any length, as some files have them.
            format!("{x} {y} {z} {nx} {ny} {nz}\n")
        };
        points.iter().map(line).collect()
    }

    fn cloud_with_normals() -> impl Strategy<Value = Vec<([i64; 3], [i32; 3])>> {
        // Around one direction, wide or narrow, with or without some that have no direction.
        let normals = ([-9..=9i32, -9..=9, -9..=9], 0..=9i32, any::<bool>());
        (cloud(), normals, any::<u64>()).prop_map(|(points, (near, spread, zeros), seed)| {
            let mut state = seed | 1;
            let mut next = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                i32::try_from(state >> 40).unwrap_or(0)
            };
            let normal = |_| match zeros && next() % 50 == 0 {
                true => [0; 3],
                false => near.map(|c| 9 * c + next() % (2 * spread + 1) - spread),
            };
            let normals: Vec<[i32; 3]> = points.iter().map(normal).collect();
            points.into_iter().zip(normals).collect()
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn every_normal_lies_in_the_cones_of_its_node_and_of_all_above(points in cloud_with_normals()) {
            let folder = tempfile::tempdir().expect("temporary folder");
            let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
            let files = [(1, 1 << 30), (3, 1 << 30), (2, 64 << 10)].map(|(threads, memory)| {
                let mut config = config(folder.path(), &[], threads, memory);
                config.columns = Some("x,y,z,nx,ny,nz".into());
                std::fs::write(&config.inputs[0], text_with_normals(&points)).expect("temporary folder");
                build_in_chunks(&config, sizes, &Quiet).expect("builds");
                std::fs::read(&config.output).expect("written")
            });
            prop_assert!(files[0] == files[1] && files[0] == files[2], "threads or memory change the bytes");

            let [file, ..] = files;
            let dataset = Dataset::open(file).expect("a dataset");
            let nodes = dataset.hierarchy().expect("nodes");
            let Some(index) = dataset.manifest().attributes.iter().position(|a| a.group().is_some()) else {
                prop_assert!(nodes.iter().all(|n| n.normal_cone.is_none()), "the same normal everywhere");
                return Ok(());
            };
            let cones: HashMap<NodeKey, NormalCone> =
                nodes.iter().map(|n| (n.key, n.normal_cone.expect("a cone"))).collect();
            for node in nodes.iter().filter(|node| node.points > 0) {
                let decoded = dataset.read_node(node, &[0, 1]).expect("decodes");
                for normal in decoded.column(index).expect("stored").bytes.chunks_exact(12) {
                    let normal = std::array::from_fn(|a| ScalarType::F32.to_f64(&normal[4 * a..]));
                    for level in 0..=node.key.level() {
                        let above = node.key.ancestor(level).expect("not below the node");
                        prop_assert!(cones[&above].contains(normal), "{} {above}: {normal:?}", node.key);
                    }
                }
            }
        }
    }

    #[test]
    fn cones_are_as_narrow_as_the_normals_and_as_wide_where_one_has_no_direction() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let mut config = config(folder.path(), &[], 2, 1 << 30);
        config.columns = Some("x,y,z,nx,ny,nz".into());
        // A floor, a wall, and far off a point that has no normal.
        let floor = (0..1000i64).map(|i| ([i % 32, i / 32, 0], [0, 0, 1]));
        let wall = (0..1000i64).map(|i| ([100, i % 32, i / 32], [1, 0, 0]));
        let lone = std::iter::once(([100, 100, 100], [0, 0, 0]));
        let points: Vec<_> = floor.chain(wall).chain(lone).collect();
        std::fs::write(&config.inputs[0], text_with_normals(&points)).expect("temporary folder");
        build(&config, &Quiet).expect("builds");
        let dataset =
            Dataset::open(std::fs::read(&config.output).expect("written")).expect("sound");
        let widths: Vec<(NodeKey, u8)> = dataset
            .hierarchy()
            .expect("nodes")
            .iter()
            .map(|node| (node.key, node.normal_cone.expect("a cone").to_bytes()[2]))
            .collect();
        let of = |key| widths.iter().find(|(k, _)| *k == key).map(|(_, width)| *width);
        let child = |octant| NodeKey::ROOT.child(octant).expect("a child");
        // Steps of pi / 255: floor and wall are one direction each, half of the root's would be 64.
        assert!(of(child(0)).is_some_and(|width| width <= 2), "{widths:?}");
        assert!(of(child(1)).is_some_and(|width| width <= 2), "{widths:?}");
        // Where the point without direction is, any direction may be.
        assert_eq!(of(NodeKey::ROOT), Some(255), "{widths:?}");
    }

    /// A LAS file of points on steps of a centimetre, written at another scale and offset.
    fn las(folder: &Path, name: &str, centimetres: &[[i32; 3]], scale: f64, offset: i32) -> String {
        let mut scan = Scan::new(0, centimetres.len(), 0, Compression::None);
        let header = &mut scan.header;
        (header.x_scale_factor, header.y_scale_factor, header.z_scale_factor) =
            (scale, scale, scale);
        let zero = f64::from(offset);
        (header.x_offset, header.y_offset, header.z_offset) = (zero, zero, zero);
        let steps = (0.01 / scale).round() as i32;
        for (record, point) in scan.points.chunks_exact_mut(20).zip(centimetres) {
            record.fill(0);
            for a in 0..3 {
                let native = (point[a] - 100 * offset) * steps;
                record[4 * a..4 * a + 4].copy_from_slice(&native.to_le_bytes());
            }
        }
        let path = folder.join(name);
        std::fs::write(&path, scan.bytes()).expect("temporary folder");
        path.display().to_string()
    }

    #[test]
    fn parts_with_scales_and_offsets_of_their_own_make_what_the_whole_does() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let points: Vec<[i32; 3]> =
            (0..3000).map(|i| [i * 7919 % 10_000, i * 31 % 10_007, i % 10]).collect();
        let whole = vec![las(folder.path(), "whole.las", &points, 0.01, 0)];
        let parts = [(0.001, 0), (0.01, 3), (0.0001, 0), (0.005, -7)];
        let parts: Vec<String> = points
            .chunks(750)
            .zip(parts)
            .enumerate()
            .map(|(i, (points, (scale, offset)))| {
                las(folder.path(), &format!("{i}.las"), points, scale, offset)
            })
            .collect();
        let built = [&whole, &parts].map(|inputs| {
            let mut config = config(folder.path(), &[], 2, 1 << 30);
            config.inputs = inputs.clone();
            config.columns = None;
            let report = build(&config, &Quiet).expect("builds");
            assert_eq!((report.scale, report.largest_coordinate_error), (0.01, 0.0));
            let position = report.columns[0].bytes;
            let against = VerifyConfig {
                dataset: config.output,
                against: whole.clone(),
                columns: None,
                cancel: Arc::default(),
            };
            (position, verify(&against, &Quiet).expect("opens"))
        });
        assert_eq!(built[0].0, built[1].0, "bytes of the positions");
        for (_, verified) in built {
            let against = verified.against.expect("compared");
            assert_eq!(against.largest_coordinate_error, 0.0);
            assert!(against.identical);
        }
    }

    #[test]
    fn points_beyond_memory_go_through_the_disk_to_the_same_bytes() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let points: Vec<[i64; 3]> =
            (0..5000i64).map(|i| [i * 7919 % 1000, i * 104_729 % 1000, i % 10]).collect();
        let sizes = ChunkSizes { min: 40, max: 200, wanted: 16 };
        let built = [1 << 30, 64 << 10].map(|memory| {
            let config = config(folder.path(), &points, 2, memory);
            let report = build_in_chunks(&config, sizes, &Quiet).expect("builds");
            assert_eq!(report.spilled, memory < 1 << 20);
            std::fs::read(&config.output).expect("written")
        });
        assert!(built[0] == built[1], "memory changes the bytes");
    }

    #[test]
    fn a_cancelled_build_leaves_nothing() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let config = config(folder.path(), &[[0, 0, 0], [5, 5, 5]], 1, 1 << 20);
        config.cancel.store(true, Ordering::Relaxed);
        let result = build(&config, &Quiet);
        assert!(matches!(result, Err(Error::Interrupted)), "{result:?}");
        let left: Vec<_> = std::fs::read_dir(folder.path()).expect("there").collect();
        assert_eq!(left.len(), 1, "only the input is there: {left:?}");
    }

    #[test]
    fn a_folder_is_no_output() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let mut config = config(folder.path(), &[[0, 0, 0]], 1, 1 << 20);
        config.output = folder.path().to_path_buf();
        let error = build(&config, &Quiet).expect_err("refused").to_string();
        assert!(error.contains("is a folder; name a file"), "{error}");
    }
}
