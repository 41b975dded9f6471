//! `export`: a dataset, or a part of it, into a file that other programs read.

use std::{path::PathBuf, process::ExitCode};

use anyhow::Context;
use clap::Args;
use lodestream_preprocess::{
    Progress,
    writers::{self, ExportBlock, ExportInfo},
};
use lodestream_protocol::{Column, Dataset, LatticeBox, Manifest, Node, NodePoints, Refinement};
use lodestream_server::commands::{TerminalProgress, cancel_on_interrupt, print};
use rayon::prelude::*;

use crate::interrupt::go_on;
use crate::source::{BlockingSource, Source};

/// Nodes that are read and decoded at once.
const BATCH_NODES: usize = 32;

/// Write a dataset's points to a LAS, LAZ or PLY file
#[derive(Debug, Clone, Args)]
pub struct ExportArgs {
    /// A dataset file, its URL, or a server's address with the dataset's name
    #[arg(value_name = "SOURCE")]
    pub source: String,
    /// The file to write; its ending tells the format
    #[arg(short, long, value_name = "OUT.las|.laz|.ply")]
    pub output: PathBuf,
    /// Only the points in this box, in world units, its faces included
    #[arg(
        long, value_name = "x0,y0,z0,x1,y1,z1", value_parser = world_box, allow_hyphen_values = true
    )]
    pub bounds: Option<WorldBox>,
    /// Only the levels down to this one: 0 is the root alone
    #[arg(long, value_name = "N")]
    pub level: Option<u8>,
}

/// A box in world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldBox {
    /// Lowest corner.
    pub min: [f64; 3],
    /// Highest corner.
    pub max: [f64; 3],
}

impl WorldBox {
    fn contains(&self, p: [f64; 3]) -> bool {
        (0..3).all(|a| self.min[a] <= p[a] && p[a] <= self.max[a])
    }

    /// Whether any of a node's points can be inside.
    fn touches(&self, bounds: &LatticeBox, manifest: &Manifest) -> bool {
        let low = manifest.lattice.world(bounds.min);
        let high = manifest.lattice.world(bounds.max);
        (0..3).all(|a| low[a] <= self.max[a] && self.min[a] <= high[a])
    }
}

fn world_box(text: &str) -> Result<WorldBox, String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite()))
        .collect::<Option<_>>()
        .ok_or("expected six numbers: x0,y0,z0,x1,y1,z1")?;
    let [x0, y0, z0, x1, y1, z1] =
        numbers.try_into().map_err(|_| "expected six numbers: x0,y0,z0,x1,y1,z1")?;
    let found = WorldBox { min: [x0, y0, z0], max: [x1, y1, z1] };
    if (0..3).any(|a| found.min[a] > found.max[a]) {
        return Err("the first corner must not be above the second on any axis".into());
    }
    Ok(found)
}

/// Exports.
///
/// # Errors
/// Where the dataset cannot be read or the file cannot be written; nothing is left behind then.
pub fn run(args: ExportArgs) -> anyhow::Result<ExitCode> {
    let cancel = cancel_on_interrupt()?;
    let named = |e: lodestream_protocol::Error| anyhow::anyhow!("{}: {e}", args.source);
    let source = BlockingSource::new(Source::parse(&args.source)?)?;
    let dataset = Dataset::open(source).map_err(named)?;
    let manifest = dataset.manifest();
    anyhow::ensure!(
        manifest.refinement == Refinement::Additive || args.level.is_some(),
        "{}: its levels replace one another; say which one with --level",
        args.source
    );
    let wanted = |node: &Node| {
        let level = node.key.level();
        let shown = match (manifest.refinement, args.level) {
            (Refinement::Additive, limit) => limit.is_none_or(|limit| level <= limit),
            // A cut through the tree: the level itself, and leaves that end above it.
            (Refinement::Replace, limit) => {
                limit.is_none_or(|limit| level == limit || (level < limit && node.is_leaf()))
            }
        };
        shown && args.bounds.is_none_or(|bounds| bounds.touches(&node.bounds, manifest))
    };
    let nodes: Vec<Node> = dataset.hierarchy().map_err(named)?.into_iter().filter(wanted).collect();
    let mut bounds = LatticeBox::EMPTY;
    nodes.iter().for_each(|node| bounds.merge(&node.bounds));
    let points = nodes.iter().map(|node| u64::from(node.points)).sum();
    let mut writer = writers::create(
        &args.output,
        ExportInfo {
            lattice: manifest.lattice,
            bounds,
            points,
            attributes: manifest.attributes.clone(),
            crs: manifest.crs.clone(),
        },
    )?;
    let progress = TerminalProgress::default();
    progress.phase("export", points, "points");
    for note in writer.notes() {
        progress.warn(note);
    }
    let groups: Vec<usize> = (0..manifest.groups.len()).collect();
    let mut written = 0;
    for batch in nodes.chunks(BATCH_NODES) {
        go_on(&cancel)?;
        let blocks: Vec<ExportBlock> = batch
            .par_iter()
            .map(|node| {
                let points = dataset.read_node(node, &groups)?;
                Ok(block(manifest, points, args.bounds.as_ref()))
            })
            .collect::<Result<_, lodestream_protocol::Error>>()
            .map_err(named)?;
        for block in blocks {
            writer.write(&block)?;
            written += block.positions.len() as u64;
        }
        progress.advance(batch.iter().map(|node| u64::from(node.points)).sum());
    }
    writer.finish().with_context(|| format!("{}: cannot finish", args.output.display()))?;
    progress.finish();
    print(&format!("{}: {written} points\n", args.output.display()))?;
    Ok(ExitCode::SUCCESS)
}

/// A node's points as a writer takes them; only those inside `bounds`.
fn block(manifest: &Manifest, points: NodePoints, bounds: Option<&WorldBox>) -> ExportBlock {
    let corner = manifest.lattice.node_min(points.key);
    let positions: Vec<[u32; 3]> = points
        .positions
        .iter()
        .map(|q| std::array::from_fn(|a| corner[a].wrapping_add(q[a])))
        .collect();
    let Some(bounds) = bounds else { return ExportBlock { positions, columns: points.columns } };
    let inside: Vec<bool> =
        positions.iter().map(|&q| bounds.contains(manifest.lattice.world(q))).collect();
    let columns = points
        .columns
        .iter()
        .map(|column| {
            let len = manifest.attributes[column.attribute].value_bytes();
            let values = column.bytes.chunks_exact(len).zip(&inside);
            let bytes = values.filter(|(_, inside)| **inside).flat_map(|(v, _)| v).copied();
            Column { attribute: column.attribute, bytes: bytes.collect() }
        })
        .collect();
    let kept = positions.iter().zip(&inside).filter(|(_, inside)| **inside).map(|(q, _)| *q);
    ExportBlock { positions: kept.collect(), columns }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_six_ordered_numbers() {
        let found = world_box("-1,0, 2.5,1,0,3").expect("a box");
        assert_eq!(found, WorldBox { min: [-1.0, 0.0, 2.5], max: [1.0, 0.0, 3.0] });
        assert!(found.contains([1.0, 0.0, 2.5]) && !found.contains([1.0, 0.1, 2.5]));
        for bad in ["", "1,2,3,4,5", "1,2,3,4,5,x", "2,0,0,1,0,0", "nan,0,0,1,1,1"] {
            assert!(world_box(bad).is_err(), "{bad}");
        }
    }
}
