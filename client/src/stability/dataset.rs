//! Datasets made of a case's points by the product itself: written as a file, built, read again.

use std::path::PathBuf;

use lodestream_preprocess::{BuildConfig, BuildReport, FileSource, Method, Progress, build};
use lodestream_protocol::{Dataset, Lattice, LatticeBox, Manifest, Node, NodeKey};
use tempfile::TempDir;

use super::{
    StabilityError,
    exact::{Big, whole},
};

/// Grid cells a node's side that make small clouds have many levels.
pub(super) const FEW_CELLS: u32 = 8;

/// Points with a known number of decimals: whole multiples of `10^-decimals`.
pub(super) struct Digits {
    /// What is stiff or extreme about them.
    pub name: &'static str,
    /// Digits after the point.
    pub decimals: u32,
    /// In units of the last digit.
    pub points: Vec<[i64; 3]>,
}

impl Digits {
    /// As lines of text, with each point's number behind it.
    pub fn text(&self) -> String {
        let ten_to = 10u64.pow(self.decimals);
        let number = |value: i64| {
            let (sign, size) = (if value < 0 { "-" } else { "" }, value.unsigned_abs());
            let digits = self.decimals as usize;
            if digits == 0 {
                return format!("{sign}{size}");
            }
            format!("{sign}{}.{:0digits$}", size / ten_to, size % ten_to)
        };
        let line = |(i, p): (usize, &[i64; 3])| {
            format!("{} {} {} {i}\n", number(p[0]), number(p[1]), number(p[2]))
        };
        self.points.iter().enumerate().map(line).collect()
    }

    /// The exact coordinates of a point.
    pub fn exact(&self, point: usize) -> [Big; 3] {
        let ten_to = whole(10i128.pow(self.decimals));
        self.points[point].map(|value| whole(value.into()) / &ten_to)
    }
}

/// A point of a dataset.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    /// The node it is in.
    pub node: NodeKey,
    /// Whether nothing lies below that.
    pub is_leaf: bool,
    /// Lattice units relative to the root cube.
    pub q: [u32; 3],
    /// Its number in the input.
    pub number: usize,
}

/// A dataset in a temporary folder.
pub(super) struct Built {
    pub dataset: Dataset<FileSource>,
    pub path: PathBuf,
    pub report: BuildReport,
    _folder: TempDir,
}

/// The manifest of a single point, at the lowest corner of its lattice, for cases that need no file.
pub(super) fn manifest(lattice: Lattice) -> Manifest {
    Manifest {
        generator: "lodestream stability".into(),
        points: 1,
        nodes: 1,
        levels: 1,
        method: lodestream_protocol::Method {
            name: "poisson".into(),
            grid: 128,
            leaf_capacity: 32_768,
        },
        lattice,
        bounds: LatticeBox { min: [0; 3], max: [0; 3] },
        ..Manifest::empty()
    }
}

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

impl Built {
    /// Builds the file `name` of these bytes, whose points have `x`, `y`, `z` and `number` (in LAS:
    /// `point_source_id`), with `grid` cells a node's side.
    pub fn of(name: &str, bytes: &[u8], grid: u32) -> Result<Self, StabilityError> {
        let failed = |path: PathBuf| {
            move |e: std::io::Error| StabilityError::File { path, why: e.to_string() }
        };
        let folder = tempfile::tempdir().map_err(failed(std::env::temp_dir()))?;
        let (input, path) = (folder.path().join(name), folder.path().join("case.lods"));
        std::fs::write(&input, bytes).map_err(failed(input.clone()))?;
        let is_text = name.ends_with(".xyz");
        let config = BuildConfig {
            inputs: vec![input.display().to_string()],
            output: path.clone(),
            method: Method::Poisson,
            grid,
            memory_bytes: 1 << 30,
            threads: None,
            drop_attributes: Vec::new(),
            columns: is_text.then(|| "x,y,z,number".into()),
            scale: None,
            cells_per_spacing: lodestream_preprocess::CELLS_PER_SPACING,
            cancel: Default::default(),
        };
        let report = build(&config, &Quiet)?;
        let dataset = Dataset::open(FileSource::open(&path)?)?;
        Ok(Self { dataset, path, report, _folder: folder })
    }

    /// All points, in no promised order.
    pub fn points(&self) -> Result<Vec<Placed>, StabilityError> {
        let manifest = self.dataset.manifest();
        // LAS has no field of that name; this one is free.
        let is_number = |name: &str| name == "number" || name == "point_source_id";
        let number = manifest.attributes.iter().position(|a| is_number(&a.name));
        let groups: Vec<usize> = (0..manifest.groups.len()).collect();
        let mut placed = Vec::new();
        for node in self.dataset.hierarchy()? {
            placed.extend(self.points_of(&node, &groups, number)?);
        }
        Ok(placed)
    }

    fn points_of(
        &self,
        node: &Node,
        groups: &[usize],
        number: Option<usize>,
    ) -> Result<Vec<Placed>, StabilityError> {
        let manifest = self.dataset.manifest();
        let points = self.dataset.read_node(node, groups)?;
        let corner = manifest.lattice.node_min(node.key);
        let number_of = |point: usize| -> usize {
            // A single point's number does not vary: it is a constant of the manifest, zero.
            let Some((attribute, column)) =
                number.and_then(|index| Some((&manifest.attributes[index], points.column(index)?)))
            else {
                return 0;
            };
            let size = attribute.value_bytes();
            attribute.scalar.to_f64(&column.bytes[point * size..][..size]) as usize
        };
        let place = |(point, q): (usize, &[u32; 3])| Placed {
            node: node.key,
            is_leaf: node.is_leaf(),
            q: std::array::from_fn(|a| corner[a].wrapping_add(q[a])),
            number: number_of(point),
        };
        Ok(points.positions.iter().enumerate().map(place).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::exact::decimal;

    #[test]
    fn digits_are_written_as_they_are_meant() {
        let digits = Digits { name: "", decimals: 3, points: vec![[-1, 12_345, 0]] };
        assert_eq!(digits.text(), "-0.001 12.345 0.000 0\n");
        assert_eq!(digits.exact(0), [decimal("-0.001"), decimal("12.345"), whole(0)]);
    }
}
