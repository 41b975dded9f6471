//! Proof that a dataset is what it should be: checksums, tree, distances, and, beside its inputs, that
//! every point is there with every value.

use std::{
    collections::{HashMap, HashSet},
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use lodestream_protocol::{
    Dataset, LatticeBox, Manifest, Node, NodeKey, NodePoints, ReadAt, Refinement,
};
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    build::Progress,
    error::{Error, Result},
    file::FileSource,
    grid::{self, InputCoordinates},
    inputs,
    readers::CoordinateKind,
    schema::{RowMap, Schema},
    store::{RawBlock, Store, StoreWriter},
};

/// What to verify.
#[derive(Debug, Clone)]
pub struct VerifyConfig {
    /// The dataset file.
    pub dataset: PathBuf,
    /// The inputs it was built from; none: the dataset is checked by itself.
    pub against: Vec<String>,
    /// What the columns of text inputs are, as for the build.
    pub columns: Option<String>,
    /// Set to stop.
    pub cancel: Arc<AtomicBool>,
}

/// What was found.
#[derive(Debug, Clone, Default, Serialize)]
pub struct VerifyReport {
    /// Points decoded.
    pub points: u64,
    /// Nodes decoded.
    pub nodes: u64,
    /// Pairs of points in sampled nodes of one level, ancestors' included, that are closer than the
    /// level's distance.
    pub spacing_violations: u64,
    /// Points checked for their distance.
    pub spacing_checked: u64,
    /// The comparison with the inputs, where there are any.
    pub against: Option<Comparison>,
    /// All that is wrong, one line each; at most [`MAX_FINDINGS`] are kept.
    pub findings: Vec<String>,
    /// Findings beyond those kept.
    pub further_findings: u64,
}

/// Most findings that a report spells out.
pub const MAX_FINDINGS: usize = 100;

/// How a dataset compares with its inputs.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Comparison {
    /// Points that the inputs deliver.
    pub input_points: u64,
    /// Points the readers left out (NaN and such), as the build does.
    pub dropped: u64,
    /// Whether both hold the same multiset of points, every coordinate and value bit by bit.
    pub identical: bool,
    /// Largest distance on an axis between an input's coordinate and its lattice point, world units.
    pub largest_coordinate_error: f64,
    /// Attributes of the inputs that the dataset does not have.
    pub attributes_left_out: Vec<String>,
}

impl VerifyReport {
    /// Whether nothing is wrong.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.findings.is_empty()
    }

    fn find(&mut self, line: String) {
        if self.findings.len() < MAX_FINDINGS {
            self.findings.push(line);
        } else {
            self.further_findings += 1;
        }
    }
}

/// A sum of hashes that does not depend on order: equal multisets have equal sums, and different
/// ones differ but for a chance of 2^-128.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Fingerprint {
    points: u64,
    sum: u128,
}

impl Fingerprint {
    fn add(&mut self, record: &[u8]) {
        self.points += 1;
        self.sum = self.sum.wrapping_add(xxhash_rust::xxh3::xxh3_128(record));
    }

    fn merge(self, other: Self) -> Self {
        Self { points: self.points + other.points, sum: self.sum.wrapping_add(other.sum) }
    }
}

/// Verifies a dataset.
///
/// # Errors
/// Where the dataset cannot be opened at all, or an input cannot be read. What is wrong inside the
/// dataset is in the report.
pub fn verify(config: &VerifyConfig, progress: &dyn Progress) -> Result<VerifyReport> {
    let path = config.dataset.display().to_string();
    let format = |source| Error::Format { path: path.clone(), source };
    let dataset = Dataset::open(FileSource::open(&config.dataset)?).map_err(format)?;
    let manifest = dataset.manifest();
    let mut report = VerifyReport::default();
    let size = dataset.source().size().map_err(format)?;
    if size != dataset.boot().header.file_bytes {
        let said = dataset.boot().header.file_bytes;
        report.find(format!("the file has {size} bytes, its header says {said}"));
    }
    let nodes = match dataset.hierarchy() {
        Ok(nodes) => nodes,
        Err(e) => {
            report.find(e.to_string());
            return Ok(report);
        }
    };
    check_tree(manifest, &nodes, &mut report);
    check_sizes(manifest, &nodes, &mut report);

    progress.phase("decode", manifest.points, "points");
    let groups: Vec<usize> = (0..manifest.groups.len()).collect();
    let mut fingerprint = Fingerprint::default();
    let mut points_of: HashMap<NodeKey, Vec<[u32; 3]>> = HashMap::new();
    // In batches: only the positions stay.
    for batch in nodes.chunks(64) {
        if config.cancel.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let decoded: Vec<_> = batch
            .par_iter()
            .map(|node| {
                let points = dataset.read_node(node, &groups)?;
                let prints = fingerprint_node(manifest, &points);
                Ok((points, prints))
            })
            .collect();
        for (node, result) in batch.iter().zip(decoded) {
            match result {
                Ok((points, print)) => {
                    check_points(manifest, node, &points, &mut report);
                    fingerprint = fingerprint.merge(print);
                    let corner = manifest.lattice.node_min(node.key);
                    let absolute =
                        points.positions.iter().map(|q| std::array::from_fn(|a| q[a] + corner[a]));
                    points_of.insert(node.key, absolute.collect());
                }
                Err(e) => {
                    let e: lodestream_protocol::Error = e;
                    report.find(format!("node {}: {e}", node.key));
                }
            }
            progress.advance(u64::from(node.points));
        }
    }
    report.points = fingerprint.points;
    report.nodes = nodes.len() as u64;
    if fingerprint.points != manifest.points {
        report.find(format!(
            "{} points in the nodes, the manifest says {}",
            fingerprint.points, manifest.points
        ));
    }
    if manifest.refinement == Refinement::Additive && manifest.method.name == "poisson" {
        progress.phase("spacing", manifest.points, "points");
        check_spacing(manifest, &nodes, &points_of, &mut report, progress);
    }
    if !config.against.is_empty() {
        compare(config, manifest, fingerprint, &mut report, progress)?;
    }
    Ok(report)
}

/// Every node below the root has its parent, parents know their children, bounds nest.
fn check_tree(manifest: &Manifest, nodes: &[Node], report: &mut VerifyReport) {
    let by_key: HashMap<NodeKey, &Node> = nodes.iter().map(|n| (n.key, n)).collect();
    if by_key.len() != nodes.len() {
        report.find("a node appears twice".into());
    }
    let mut deepest = 0;
    for node in nodes {
        deepest = deepest.max(node.key.level() + 1);
        for child in node.children() {
            let Some(child) = by_key.get(&child) else {
                report.find(format!("node {}: its child {child} is missing", node.key));
                continue;
            };
            // Bounds are rounded outward by up to 1/256 of each node's own side.
            let slack = (1u64 << manifest.lattice.node_bits(node.key.level())) / 128 + 1;
            let nests = (0..3).all(|a| {
                u64::from(child.bounds.min[a]) + slack >= u64::from(node.bounds.min[a])
                    && u64::from(child.bounds.max[a]) <= u64::from(node.bounds.max[a]) + slack
            });
            if !nests {
                report.find(format!("node {}: bounds reach out of its parent's", child.key));
            }
        }
        if let Some(parent) = node.key.parent() {
            let known = by_key.get(&parent).is_some_and(|p| p.children().any(|c| c == node.key));
            if !known {
                report.find(format!("node {}: its parent does not know it", node.key));
            }
        }
        if node.is_leaf() && node.geometric_error != 0.0 {
            report.find(format!("node {}: a leaf with a geometric error", node.key));
        }
    }
    if deepest != manifest.levels {
        report.find(format!("{deepest} levels, the manifest says {}", manifest.levels));
    }
}

/// Groups take as many bytes as the manifest says.
fn check_sizes(manifest: &Manifest, nodes: &[Node], report: &mut VerifyReport) {
    for (index, group) in manifest.groups.iter().enumerate() {
        let payloads = nodes.iter().filter_map(|node| node.payloads.get(index));
        let bytes: u64 = payloads.map(|payload| u64::from(payload.bytes)).sum();
        if bytes != group.bytes() {
            report.find(format!(
                "group {}: {bytes} bytes in the nodes, the manifest says {}",
                group.name,
                group.bytes()
            ));
        }
    }
}

/// Points are as many as announced, inside the bounds, in Morton order.
fn check_points(manifest: &Manifest, node: &Node, points: &NodePoints, report: &mut VerifyReport) {
    if points.positions.len() != node.points as usize {
        report.find(format!("node {}: {} points", node.key, points.positions.len()));
    }
    let corner = manifest.lattice.node_min(node.key);
    let mut tight = LatticeBox::EMPTY;
    for q in &points.positions {
        tight.grow(std::array::from_fn(|a| q[a] + corner[a]));
    }
    let inside = |outer: &LatticeBox| outer.contains(tight.min) && outer.contains(tight.max);
    let all_inside = inside(&node.bounds) && inside(&manifest.bounds);
    if !points.positions.is_empty() && !all_inside {
        report.find(format!("node {}: points outside its bounds", node.key));
    }
    let code = |q: &[u32; 3]| <u128 as lodestream_protocol::MortonCode>::encode(*q);
    if !points.positions.is_sorted_by_key(code) {
        report.find(format!("node {}: points are not in Morton order", node.key));
    }
}

/// Hashes position (relative to the root cube) and all attribute values, constants included, of
/// every point.
fn fingerprint_node(manifest: &Manifest, points: &NodePoints) -> Fingerprint {
    let corner = manifest.lattice.node_min(points.key);
    let constants: Vec<Option<Vec<u8>>> =
        manifest.attributes.iter().map(lodestream_protocol::Attribute::constant).collect();
    let columns: Vec<_> =
        (0..manifest.attributes.len()).map(|index| points.column(index)).collect();
    let mut print = Fingerprint::default();
    let mut record = Vec::new();
    for (i, q) in points.positions.iter().enumerate() {
        record.clear();
        let absolute: [u32; 3] = std::array::from_fn(|a| q[a] + corner[a]);
        record.extend(absolute.iter().flat_map(|c| c.to_le_bytes()));
        for (index, attribute) in manifest.attributes.iter().enumerate() {
            let len = attribute.value_bytes();
            match (&constants[index], columns[index]) {
                (Some(constant), _) => record.extend_from_slice(constant),
                (None, Some(column)) => record.extend_from_slice(&column.bytes[i * len..][..len]),
                (None, None) => {}
            }
        }
        print.add(&record);
    }
    print
}

/// For each level: the points of sampled nodes (those with children) of that level, together with
/// their ancestors' points inside them, keep the level's distance from one another. Cells of a hash
/// grid are exactly that wide, so the own and the 26 cells around are all that can hold a point too
/// near.
fn check_spacing(
    manifest: &Manifest,
    nodes: &[Node],
    points_of: &HashMap<NodeKey, Vec<[u32; 3]>>,
    report: &mut VerifyReport,
    progress: &dyn Progress,
) {
    let sampled: HashSet<NodeKey> = nodes.iter().filter(|n| !n.is_leaf()).map(|n| n.key).collect();
    let deepest = sampled.iter().map(|k| k.level()).max();
    let Some(deepest) = deepest else { return };
    let grid_bits = manifest.method.grid.max(1).ilog2() as u8;
    for level in 0..=deepest {
        let node_bits = manifest.lattice.node_bits(level);
        let cell_bits = node_bits.saturating_sub(grid_bits);
        let min_distance2 = 1u128 << (2 * cell_bits);
        // (cell, point), sorted: a cell is found by binary search, without a table of all cells.
        let mut points: Vec<([u32; 3], [u32; 3])> = Vec::new();
        for (key, own) in points_of.iter().filter(|(key, _)| key.level() <= level) {
            if !sampled.contains(key) {
                continue;
            }
            for &q in own {
                let cube = q.map(|c| u64::from(c).checked_shr(u32::from(node_bits)).unwrap_or(0));
                let node = NodeKey::new(level, cube.map(|c| c as u32));
                if node.is_some_and(|node| sampled.contains(&node)) {
                    points.push((q.map(|c| c >> cell_bits.min(31)), q));
                }
            }
        }
        points.par_sort_unstable();
        let violations: u64 = (0..points.len())
            .into_par_iter()
            .map(|i| {
                let (cell, q) = points[i];
                let mut near = 0;
                // Each pair once: the point itself and those after it, in this and later cells.
                for dx in 0..=1u32 {
                    for dy in -1..=1i32 {
                        if dx == 0 && dy < 0 {
                            continue;
                        }
                        let row = |dz: i32| {
                            Some([
                                cell[0].checked_add(dx)?,
                                cell[1].checked_add_signed(dy)?,
                                cell[2].saturating_add_signed(dz),
                            ])
                        };
                        let (Some(first), Some(last)) = (row(-1), row(1)) else { continue };
                        let start = if dx == 0 && dy == 0 {
                            i + 1
                        } else {
                            points.partition_point(|p| p.0 < first)
                        };
                        let others = points[start..].iter().take_while(|(other, _)| *other <= last);
                        for (_, other) in others {
                            let distance2: u128 = (0..3)
                                .map(|a| {
                                    let d = u128::from(q[a].abs_diff(other[a]));
                                    d * d
                                })
                                .sum();
                            near += u64::from(distance2 < min_distance2);
                        }
                    }
                }
                near
            })
            .sum();
        report.spacing_checked += points.len() as u64;
        progress.advance(points.len() as u64);
        if violations > 0 {
            report.spacing_violations += violations;
            report.find(format!(
                "level {level}: {violations} pairs of points are closer than {} world units",
                manifest.spacing_world(level)
            ));
        }
    }
}

/// Reads the inputs as the build does, on the dataset's lattice, and compares fingerprints.
fn compare(
    config: &VerifyConfig,
    manifest: &Manifest,
    dataset: Fingerprint,
    report: &mut VerifyReport,
    progress: &dyn Progress,
) -> Result<()> {
    let opened = inputs::open_all(&config.against, config.columns.as_deref())?;
    let announced: Option<u64> = opened.iter().map(|i| i.info.points).sum();
    progress.phase("compare", announced.unwrap_or(0), "points");
    let mut comparison = Comparison::default();
    let mut left_out: Vec<String> = Vec::new();
    for attribute in opened.iter().flat_map(|i| &i.info.attributes) {
        if manifest.attribute(&attribute.name).is_none() && !left_out.contains(&attribute.name) {
            left_out.push(attribute.name.clone());
        }
    }
    let schema = Schema::union(opened.iter().map(|i| &i.info.attributes[..]), &left_out);
    let same =
        schema.attributes.len() == manifest.attributes.len()
            && schema.attributes.iter().zip(&manifest.attributes).all(|(a, b)| {
                (&a.name, a.scalar, a.components) == (&b.name, b.scalar, b.components)
            });
    if !same {
        report.find(format!(
            "the inputs have attributes {:?}, the dataset {:?}",
            schema.attributes.iter().map(|a| &a.name).collect::<Vec<_>>(),
            manifest.attributes.iter().map(|a| &a.name).collect::<Vec<_>>(),
        ));
    }
    comparison.attributes_left_out = left_out;

    let mut inputs_print = Fingerprint::default();
    for (index, input) in opened.into_iter().enumerate() {
        let map = RowMap::new(&input.info.attributes, &schema);
        // One input at a time goes through the store that the build uses, held in memory: its
        // lattice placement may only be known once all of it has been read.
        let folder = std::env::temp_dir();
        let mut writer = StoreWriter::new(1, u64::MAX, &folder);
        let read = input.reader.read(&mut |block| {
            if config.cancel.load(Ordering::Relaxed) {
                return Err(Error::Interrupted);
            }
            let count = block.positions.len();
            let rows = map.apply(block.attributes, count, &schema);
            progress.advance(count as u64);
            writer.push(RawBlock { input: 0, positions: block.positions, rows })
        })?;
        let kind = match input.info.coordinates {
            CoordinateKind::Float { single_precision, decimals } => {
                CoordinateKind::Float { decimals: read.decimals.or(decimals), single_precision }
            }
            scaled => scaled,
        };
        comparison.dropped += read.dropped.iter().map(|(_, n)| n).sum::<u64>();
        let coordinates = InputCoordinates { kind, bounds: writer.bounds[0] };
        let placement = grid::placement_on(&manifest.lattice, &coordinates);
        let store = writer.finish()?.place(vec![placement], manifest.lattice, &schema);
        let Store::Memory { blocks, rounding } = store else {
            return Err(Error::Setup(format!("input {index} left memory")));
        };
        comparison.largest_coordinate_error = comparison.largest_coordinate_error.max(rounding);
        let row_bytes = schema.row_bytes;
        let prints = blocks.par_iter().map(|block| {
            let mut print = Fingerprint::default();
            let mut record = Vec::with_capacity(12 + row_bytes);
            for (i, q) in block.positions.iter().enumerate() {
                record.clear();
                record.extend(q.iter().flat_map(|c| c.to_le_bytes()));
                record.extend_from_slice(&block.rows[i * row_bytes..][..row_bytes]);
                print.add(&record);
            }
            print
        });
        inputs_print = inputs_print.merge(prints.reduce(Fingerprint::default, Fingerprint::merge));
    }
    comparison.input_points = inputs_print.points;
    comparison.identical = inputs_print == dataset;
    if inputs_print.points != dataset.points {
        report.find(format!(
            "the inputs have {} points, the dataset {}",
            inputs_print.points, dataset.points
        ));
    } else if !comparison.identical {
        report.find("the inputs' points and the dataset's are not the same".into());
    }
    report.against = Some(comparison);
    Ok(())
}
