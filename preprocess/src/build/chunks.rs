//! The third phase: chunks are built in core, side by side.

use std::sync::{Arc, Mutex};

use super::Job;
use crate::{
    blobs::Blobs,
    chunk::{self, Context},
    distribute::Distributed,
    encode::{OutNode, Ranges},
    error::{Error, Result},
    lod::poisson::Skin,
    plan::Plan,
    schedule,
};

/// Bytes of working memory per point of a chunk in core, besides its rows.
const CHUNK_BYTES_PER_POINT: u64 = 80;
/// Bytes of a normal's direction while cones are measured.
const UNIT_NORMAL_BYTES: u64 = 12;

/// What stays of a chunk when its payloads are put away.
pub(super) struct BuiltChunk {
    /// Every node below the chunk's root.
    pub(super) nodes: Vec<OutNode>,
    pub(super) ranges: Ranges,
    pub(super) root: chunk::Root,
    pub(super) skin: Arc<Skin>,
}

/// Refuses what would take more memory than there is: points that coincide cannot be parted.
pub(super) fn check(plan: &Plan, capacity: u64, memory_bytes: u64) -> Result<()> {
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

/// Builds every chunk of the plan; their payloads go into `blobs`, part by part.
///
/// # Errors
/// Where too many points coincide, a temporary file fails, or the build is cancelled.
pub(super) fn build(
    job: &Job,
    context: &Context,
    plan: &Plan,
    points: &Distributed,
    blobs: &Blobs,
) -> Result<Vec<BuiltChunk>> {
    let dependencies = schedule::dependencies(&plan.neighbours());
    let built: Vec<Mutex<Option<BuiltChunk>>> =
        plan.chunks.iter().map(|_| Mutex::new(None)).collect();
    let layout = context.layout;
    let normal_bytes = if layout.normal.is_some() { UNIT_NORMAL_BYTES } else { 0 };
    let point_bytes = CHUNK_BYTES_PER_POINT + normal_bytes + 2 * layout.row_bytes as u64;
    let cost = |i: usize| plan.chunks[i].points * point_bytes;
    schedule::run(&dependencies, job.threads, cost, job.config.memory_bytes / 2, |i| {
        job.check()?;
        let skin_of = |&j: &usize| {
            let chunk = built[j].lock().expect("no holder panics");
            chunk.as_ref().map(|chunk| Arc::clone(&chunk.skin))
        };
        let near: Vec<Arc<Skin>> = dependencies[i].iter().filter_map(skin_of).collect();
        let near: Vec<&Skin> = near.iter().map(AsRef::as_ref).collect();
        let points = points.points(plan, i, job.folder)?;
        let chunk = chunk::build(context, plan.chunks[i].key, i as u32, &points, &near)?;
        blobs.put(i, chunk.buffers)?;
        *built[i].lock().expect("no holder panics") = Some(BuiltChunk {
            nodes: chunk.nodes,
            ranges: chunk.ranges,
            root: chunk.root,
            skin: Arc::new(chunk.skin),
        });
        job.progress.advance(plan.chunks[i].points);
        Ok(())
    })?;
    let chunks = built.into_iter().map(|chunk| chunk.into_inner().expect("no holder panics"));
    Ok(chunks.map(|chunk| chunk.expect("every chunk was built")).collect())
}
