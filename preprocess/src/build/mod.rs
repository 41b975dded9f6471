//! The build: files in, one dataset file out.
//!
//! Read once → choose the lattice → count and plan chunks → distribute → build every chunk in core →
//! join the top of the tree → write. See `ARCHITECTURE.md` for why each step is as it is.

mod chunks;
mod config;
mod disk;
mod join;
mod phases;
mod planning;
mod read;
mod report;

use std::{path::Path, sync::atomic::Ordering, time::Instant};

use crate::{
    assemble,
    blobs::Blobs,
    chunk::Context,
    distribute,
    encode::Ranges,
    error::{Error, Result},
    inputs, memory,
    readers::InputInfo,
    store::Store,
    target::folder_of,
};

pub use config::{BuildConfig, CELLS_PER_SPACING, Method};
pub use phases::Progress;
pub use report::{BuildReport, ColumnBytes, Dropped, PhaseSeconds};

use chunks::BuiltChunk;
use phases::Phases;
use planning::{CHUNK_SIZES, ChunkSizes, Planned};

/// What every phase of a build works with.
struct Job<'a> {
    config: &'a BuildConfig,
    sizes: ChunkSizes,
    threads: usize,
    /// Where the output and temporary files go.
    folder: &'a Path,
    progress: &'a dyn Progress,
}

impl Job<'_> {
    /// [`Error::Interrupted`] once the build is cancelled.
    fn check(&self) -> Result<()> {
        match self.config.cancel.load(Ordering::Relaxed) {
            true => Err(Error::Interrupted),
            false => Ok(()),
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
    config.check()?;
    let threads = config
        .threads
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
        .max(1);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| Error::Setup(format!("cannot start {threads} threads: {e}")))?;
    let folder = folder_of(&config.output);
    let job = Job { config, sizes, threads, folder, progress };
    pool.install(|| build_in_pool(&job))
}

fn build_in_pool(job: &Job) -> Result<BuildReport> {
    let begun = Instant::now();
    let Job { config, folder, progress, .. } = *job;
    disk::check_output(&config.output, folder)?;
    let mut phases = Phases::new(progress);

    let opened = inputs::open_all(&config.inputs, config.columns.as_deref())?;
    let left_out = |info: &InputInfo| {
        info.left_out.iter().map(|line| format!("{}: {line}", info.path)).collect::<Vec<_>>()
    };
    let mut warnings: Vec<String> = opened.iter().flat_map(|i| left_out(&i.info)).collect();
    let announced: Option<u64> = opened.iter().map(|i| i.info.points).sum();
    disk::check_disk(&opened, job)?;
    phases.begin("read", announced.unwrap_or(0), "points");
    let mut read = read::read(job, opened, &mut warnings)?;
    let (points, points_read) = (read.points(), read.points_read);
    let dropped = std::mem::take(&mut read.dropped);

    phases.begin("plan", points, "points");
    let Planned { store, plan, layout, mut manifest } = planning::plan(job, read, &mut warnings)?;
    let spilled = matches!(store, Store::File(_));
    let buffers = config.memory_bytes / 8;
    let distributed =
        distribute::distribute(store, &plan, &layout, folder, buffers, &|| job.check())?;

    phases.begin("build", points, "points");
    let grid_bits = config.grid.ilog2() as u8;
    let context = Context { manifest: &manifest, layout: &layout, grid_bits };
    let chunks = plan.chunks.len();
    let blobs = Blobs::new(chunks + 1, config.memory_bytes / 4, folder.to_path_buf());
    let built = chunks::build(job, &context, &plan, &distributed, &blobs)?;
    drop(distributed);

    phases.begin("join", 0, "");
    let mut nodes = Vec::new();
    let mut ranges = Ranges::new(&layout);
    let (mut roots, mut skins) = (Vec::with_capacity(chunks), Vec::with_capacity(chunks));
    for BuiltChunk { nodes: below, ranges: own, root, skin } in built {
        nodes.extend(below);
        ranges.merge(&own);
        roots.push(root);
        skins.push(skin);
    }
    let top = join::join(&context, roots, &skins, chunks as u32)?;
    nodes.extend(top.nodes);
    ranges.merge(&top.ranges);
    blobs.put(chunks, top.buffers)?;
    job.check()?;
    assemble::prune(&mut nodes);
    assemble::sort(&mut nodes);
    manifest.nodes = nodes.len() as u64;
    manifest.levels = nodes.last().map_or(0, |n| n.key.level() + 1);
    ranges.fill(&mut manifest);

    phases.begin("write", ranges.bytes(), "bytes");
    let written = assemble::write(&config.output, &manifest, &nodes, &blobs.finish(), &|bytes| {
        progress.advance(bytes);
        job.check()
    })?;
    let seconds = phases.finish();

    warnings.iter().for_each(|line| progress.warn(line));
    Ok(BuildReport {
        output: config.output.clone(),
        points_read,
        points_written: points,
        dropped,
        largest_coordinate_error: manifest.largest_rounding,
        scale: manifest.lattice.scale,
        nodes: manifest.nodes,
        levels: manifest.levels,
        chunks: chunks as u64,
        spilled,
        seconds,
        total_seconds: begun.elapsed().as_secs_f64(),
        peak_memory_bytes: memory::peak_bytes(),
        file_bytes: written.file_bytes,
        index_bytes: written.index_bytes,
        columns: ColumnBytes::of(&manifest, &ranges),
        warnings,
    })
}

#[cfg(test)]
mod tests;
