//! Proof that a dataset is what it should be: checksums, tree, distances, normal cones, and, beside its inputs, that
//! every point is there with every value.

mod against;
mod normals;
mod spacing;
#[cfg(test)]
mod tests;
mod tree;

use std::{
    collections::HashMap,
    path::PathBuf,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use lodestream_protocol::{Dataset, LatticeBox, Manifest, NodeKey, NodePoints, ReadAt, Refinement};
use normals::Cones;
use rayon::prelude::*;
use serde::Serialize;

use crate::{
    build::Progress,
    error::{Error, Result},
    file::FileSource,
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
    tree::check_tree(manifest, &nodes, &mut report);
    tree::check_sizes(manifest, &nodes, &mut report);
    let cones = Cones::of(manifest, &nodes, &mut report);

    progress.phase("decode", manifest.points, "points");
    let groups: Vec<usize> = (0..manifest.groups.len()).collect();
    let mut fingerprint = Fingerprint::default();
    let mut bounds = LatticeBox::EMPTY;
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
                let off = cones.as_ref().map(|cones| cones.check(manifest, &points));
                Ok((points, prints, off.unwrap_or_default()))
            })
            .collect();
        for (node, result) in batch.iter().zip(decoded) {
            match result {
                Ok((points, print, off)) => {
                    off.into_iter().for_each(|line| report.find(line));
                    bounds.merge(&tree::check_points(manifest, node, &points, &mut report));
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
    } else if fingerprint.points > 0 && bounds != manifest.bounds {
        report.find("the manifest's bounds are not those of the points".into());
    }
    if manifest.refinement == Refinement::Additive && manifest.method.name == "poisson" {
        progress.phase("spacing", manifest.points, "points");
        spacing::check_spacing(manifest, &nodes, &points_of, &mut report, progress);
    }
    if !config.against.is_empty() {
        against::compare(config, manifest, fingerprint, &mut report, progress)?;
    }
    Ok(report)
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
