//! Datasets that were built soundly and then changed in one place, every checksum made anew: what is
//! wrong with them is found by what they say, and by nothing else.

use lodestream_protocol::{
    Boot, HierarchyPage, Manifest, MortonCode, Node, NodePoints, NormalCone, encode_column,
    encode_positions, morton_encode,
};

use super::*;
use crate::build::{BuildConfig, Method, build};

struct Quiet;

impl Progress for Quiet {
    fn phase(&self, _: &str, _: u64, _: &str) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

const COLUMNS: &str = "x,y,z,intensity,nx,ny,nz";

/// A dataset of two levels, taken apart.
struct Parts {
    folder: tempfile::TempDir,
    manifest: Manifest,
    nodes: Vec<Node>,
    points: Vec<NodePoints>,
}

impl Parts {
    /// A bumpy sheet of 3,000 points with intensities and normals.
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("temporary folder");
        let line = |i: u32| {
            let (x, y) = (i % 60, i / 60);
            format!("{x} {y} {} {} {}.5 1 9\n", x * y % 7, i % 500, i % 3)
        };
        let text: String = (0..3000).map(line).collect();
        std::fs::write(folder.path().join("sheet.xyz"), text).expect("temporary folder");
        let config = BuildConfig {
            inputs: vec![folder.path().join("sheet.xyz").display().to_string()],
            output: folder.path().join("sheet.lods"),
            method: Method::Poisson,
            grid: 16,
            memory_bytes: 1 << 30,
            threads: Some(2),
            drop_attributes: Vec::new(),
            columns: Some(COLUMNS.into()),
            scale: None,
            cells_per_spacing: crate::CELLS_PER_SPACING,
            cancel: Arc::default(),
        };
        build(&config, &Quiet).expect("builds");
        let file = std::fs::read(&config.output).expect("built");
        let dataset = Dataset::open(file).expect("sound");
        let manifest = dataset.manifest().clone();
        let nodes = dataset.hierarchy().expect("sound");
        assert!(nodes.len() > 4 && nodes.iter().all(|n| n.child_page.is_none()));
        let all: Vec<usize> = (0..manifest.groups.len()).collect();
        let points =
            nodes.iter().map(|node| dataset.read_node(node, &all).expect("sound")).collect();
        Self { folder, manifest, nodes, points }
    }

    /// A leaf with points.
    fn leaf(&self) -> usize {
        self.nodes.iter().position(|n| n.is_leaf() && n.points > 1).expect("there is one")
    }

    fn attribute(&self, name: &str) -> usize {
        self.manifest.attributes.iter().position(|a| a.name == name).expect("it was built with it")
    }

    /// Removes the last point of a node, from the node alone.
    fn remove_point(&mut self, node: usize) {
        let points = &mut self.points[node];
        points.positions.pop();
        for column in &mut points.columns {
            let len = self.manifest.attributes[column.attribute].value_bytes();
            column.bytes.truncate(column.bytes.len() - len);
        }
        self.nodes[node].points -= 1;
    }

    /// Puts the parts together again, writes them and verifies the file, beside the input too.
    fn verify(self) -> VerifyReport {
        let Self { folder, manifest, mut nodes, points } = self;
        let groups = manifest.groups.len();
        let mut payloads = vec![Vec::new(); groups];
        for (node, points) in nodes.iter_mut().zip(&points) {
            let starts: Vec<usize> = payloads.iter().map(Vec::len).collect();
            if !points.positions.is_empty() {
                let codes: Vec<u64> = points.positions.iter().map(|&q| morton_encode(q)).collect();
                let bits = manifest.lattice.node_bits(node.key.level());
                encode_positions(&mut payloads[0], &codes, bits).expect("few points");
            }
            for column in &points.columns {
                let attribute = &manifest.attributes[column.attribute];
                let payload = &mut payloads[attribute.group().expect("a column")];
                encode_column(payload, attribute, &column.bytes).expect("few points");
            }
            for (group, start) in starts.into_iter().enumerate() {
                let bytes = &payloads[group][start..];
                node.payloads[group].bytes = u32::try_from(bytes.len()).expect("few points");
                node.payloads[group].crc = crc32fast::hash(bytes);
            }
        }
        let mut offset = 0;
        let offsets: Vec<u64> = payloads
            .iter()
            .map(|payload| {
                let start = offset;
                offset += payload.len() as u64;
                start
            })
            .collect();
        let page = HierarchyPage::encode(&nodes, offsets, &manifest.lattice).expect("small");
        let mut file = Boot::encode(&manifest, &page, 0, offset).expect("a manifest");
        payloads.iter().for_each(|payload| file.extend_from_slice(payload));
        let dataset = folder.path().join("changed.lods");
        std::fs::write(&dataset, file).expect("temporary folder");
        let against = vec![folder.path().join("sheet.xyz").display().to_string()];
        let columns = Some(COLUMNS.into());
        let config = VerifyConfig { dataset, against, columns, cancel: Arc::default() };
        verify(&config, &Quiet).expect("opens")
    }

    /// What is found, less what every change of payloads does: their lengths differ.
    fn findings(self) -> Vec<String> {
        let findings = self.verify().findings;
        findings.into_iter().filter(|line| !line.starts_with("group ")).collect()
    }
}

fn assert_found(findings: &[String], expected: &[&str]) {
    assert_eq!(findings.len(), expected.len(), "{findings:#?}");
    for (line, part) in findings.iter().zip(expected) {
        assert!(line.contains(part), "{part:?} is not in {line:?}");
    }
}

#[test]
fn what_is_put_together_unchanged_is_sound() {
    let report = Parts::new().verify();
    assert!(report.is_sound(), "{:#?}", report.findings);
    assert_eq!((report.points, report.spacing_violations), (3000, 0));
    assert!(report.spacing_checked > 100);
    assert!(report.against.is_some_and(|against| against.identical));
}

#[test]
fn a_lost_point_is_found() {
    let mut parts = Parts::new();
    parts.remove_point(parts.leaf());
    let expected =
        ["2999 points in the nodes, the manifest says 3000", "have 3000 points, the dataset 2999"];
    assert_found(&parts.findings(), &expected);

    // However well it is hidden.
    let mut parts = Parts::new();
    parts.remove_point(parts.leaf());
    parts.manifest.points -= 1;
    assert_found(&parts.findings(), &["have 3000 points, the dataset 2999"]);
}

#[test]
fn a_changed_value_is_found() {
    for name in ["intensity", "normal"] {
        let mut parts = Parts::new();
        let (leaf, attribute) = (parts.leaf(), parts.attribute(name));
        let columns = &mut parts.points[leaf].columns;
        let column = columns.iter_mut().find(|c| c.attribute == attribute).expect("read");
        column.bytes[0] ^= 1;
        assert_found(&parts.findings(), &["the inputs' points and the dataset's are not the same"]);
    }
}

#[test]
fn a_point_moved_by_one_step_is_found() {
    let mut parts = Parts::new();
    let leaf = parts.leaf();
    // The last in Morton order stays the last, wherever in its pair of cells it goes.
    let q = parts.points[leaf].positions.last_mut().expect("a point");
    q[2] ^= 1;
    let findings = parts.findings();
    assert!(findings.iter().any(|line| line.contains("are not the same")), "{findings:#?}");
}

#[test]
fn points_closer_than_their_level_allows_are_found() {
    let parts = Parts::new();
    let inner = parts.nodes.iter().position(|n| !n.is_leaf() && n.points > 1).expect("one");
    let key = parts.nodes[inner].key;
    let distance = 1u32 << (parts.manifest.lattice.node_bits(key.level()) - 4);
    // One step nearer than the distance, on an axis, and then as far as that.
    for (apart, violations) in [(distance - 1, 1), (distance, 0)] {
        let mut parts = Parts::new();
        let points = &mut parts.points[inner];
        let first = points.positions[0];
        // Nothing else is near: of this node and those above only two points are left.
        points.positions = vec![first, [first[0] + apart, first[1], first[2]]];
        points.positions.sort_by_key(|&q| <u64 as MortonCode>::encode(q));
        for column in &mut points.columns {
            let len = parts.manifest.attributes[column.attribute].value_bytes();
            column.bytes.truncate(2 * len);
        }
        parts.nodes[inner].points = 2;
        for node in 0..parts.nodes.len() {
            if node != inner && !parts.nodes[node].is_leaf() {
                while parts.nodes[node].points > 0 {
                    parts.remove_point(node);
                }
            }
        }
        assert_eq!(parts.verify().spacing_violations, violations, "{apart}");
    }
}

#[test]
fn a_tree_that_does_not_hold_together_is_found() {
    let change = |change: &dyn Fn(&mut Parts, usize)| {
        let mut parts = Parts::new();
        let leaf = parts.leaf();
        change(&mut parts, leaf);
        parts.findings()
    };
    let error = change(&|parts, leaf| parts.nodes[leaf].geometric_error = 0.5);
    assert_found(&error, &["a leaf with a geometric error"]);
    let levels = change(&|parts, _| parts.manifest.levels += 1);
    assert_found(&levels, &["levels, the manifest says"]);
    let bounds = change(&|parts, leaf| {
        let node = &mut parts.nodes[leaf];
        node.bounds.min = node.bounds.max;
    });
    assert_found(&bounds, &["points outside its bounds"]);
    let nest = change(&|parts, _| {
        let root = &mut parts.nodes[0].bounds;
        root.max[0] = root.min[0];
    });
    assert!(nest.iter().any(|line| line.contains("bounds reach out of its parent's")), "{nest:#?}");
    let manifest = change(&|parts, _| parts.manifest.bounds.max[1] += 1);
    assert_found(&manifest, &["the manifest's bounds are not those of the points"]);
    let nodes = change(&|parts, _| parts.manifest.nodes += 1);
    assert!(nodes.iter().any(|line| line.contains("nodes, the manifest says")), "{nodes:#?}");
}

#[test]
fn wrong_bytes_of_a_group_are_found() {
    let mut parts = Parts::new();
    parts.manifest.groups[0].columns[0] += 1;
    assert!(parts.verify().findings.iter().any(|line| line.starts_with("group base: ")));
}

#[test]
fn cones_that_are_too_narrow_or_missing_are_found() {
    let mut parts = Parts::new();
    let leaf = parts.leaf();
    let [u, v, _] = parts.nodes[leaf].normal_cone.expect("a cone").to_bytes();
    parts.nodes[leaf].normal_cone = Some(NormalCone::from_bytes([u, v, 0]));
    let key = parts.nodes[leaf].key;
    assert_found(&parts.findings(), &[&format!("outside of the cone of {key}")]);

    // That of an inner node holds the normals of all below it.
    let mut parts = Parts::new();
    let [u, v, _] = parts.nodes[0].normal_cone.expect("a cone").to_bytes();
    parts.nodes[0].normal_cone = Some(NormalCone::from_bytes([u, v, 0]));
    let findings = parts.findings();
    assert!(findings.len() > 1, "{findings:#?}");
    assert!(findings.iter().all(|line| line.contains("outside of the cone of 0/0/0/0")));

    let mut parts = Parts::new();
    let count = parts.nodes.len();
    parts.nodes.iter_mut().for_each(|node| node.normal_cone = None);
    let findings = parts.findings();
    assert_eq!(findings.len(), count, "{findings:#?}");
    assert!(findings.iter().all(|line| line.contains("no normal cone")), "{findings:#?}");
}

#[test]
fn bytes_behind_the_end_are_found() {
    let parts = Parts::new();
    let path = parts.folder.path().join("sheet.lods");
    let mut file = std::fs::read(&path).expect("built");
    file.push(0);
    std::fs::write(&path, file).expect("temporary folder");
    let config =
        VerifyConfig { dataset: path, against: Vec::new(), columns: None, cancel: Arc::default() };
    assert_found(&verify(&config, &Quiet).expect("opens").findings, &["its header says"]);
}
