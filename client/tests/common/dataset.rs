//! Small datasets, written with the protocol's own encoder: random trees with several hierarchy
//! pages, two column groups, and either refinement.

use std::{
    collections::{HashMap, VecDeque},
    path::PathBuf,
};

use fastrand::Rng;
use lodestream_protocol::{
    Attribute, Boot, Domain, GroupInfo, HierarchyPage, Lattice, LatticeBox, Manifest, Method, Node,
    NodeKey, PageRef, PayloadRef, Primitive, Refinement, ScalarType, Storage, encode_column,
    encode_positions, morton_encode,
};

const SIDE_BITS: u8 = 16;

/// What a dataset is to be like.
#[derive(Debug, Clone, Copy)]
pub struct Recipe {
    pub seed: u64,
    pub refinement: Refinement,
    /// Levels of the tree, at most 8.
    pub levels: u8,
    /// Levels described by one hierarchy page.
    pub page_levels: u8,
    /// Most points of a node.
    pub node_points: u32,
    /// World coordinate of the cube's lowest corner; its side is 65.536.
    pub corner: [f64; 3],
}

impl Default for Recipe {
    fn default() -> Self {
        Self {
            seed: 1,
            refinement: Refinement::Additive,
            levels: 5,
            page_levels: 2,
            node_points: 300,
            corner: [500_000.0, 5_000_000.0, 100.0],
        }
    }
}

/// A node before it is laid out.
struct Draft {
    key: NodeKey,
    children: Vec<Draft>,
    points: u32,
    bounds: LatticeBox,
    /// One per group.
    payloads: Vec<Vec<u8>>,
}

/// The bytes of a dataset file.
pub fn dataset(recipe: Recipe) -> Vec<u8> {
    let mut manifest = manifest(recipe);
    let mut rng = Rng::with_seed(recipe.seed);
    let root = draft(NodeKey::ROOT, recipe, &manifest, &mut rng);
    let mut layout = Layout::default();
    layout.place_payloads(&root, recipe.page_levels);
    let root_page = layout.encode_page(&[&root], recipe.page_levels, &manifest.lattice);

    manifest.bounds = root.bounds;
    manifest.points = layout.points;
    manifest.nodes = layout.nodes;
    // Payloads of group 0, of group 1, then pages: offsets count from the end of the index.
    let [base, further] = &layout.groups;
    let tail = base.len() + further.len() + layout.pages.len();
    let mut file =
        Boot::encode(&manifest, &root_page, base.len() as u64, tail as u64).expect("encodes");
    file.extend_from_slice(base);
    file.extend_from_slice(further);
    file.extend_from_slice(&layout.pages);
    file
}

#[allow(dead_code, reason = "each of its users needs a part of it")]
/// Writes `bytes` to a file of its own that lives as long as the returned folder.
pub fn write(bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("dataset.lods");
    std::fs::write(&path, bytes).expect("file is written");
    (folder, path)
}

fn manifest(recipe: Recipe) -> Manifest {
    let attribute = |name: &str, scalar, components, group| Attribute {
        name: name.into(),
        scalar,
        components,
        domain: Domain::Element,
        storage: Storage::Column { group },
        min: vec![],
        max: vec![],
    };
    Manifest {
        generator: "test".into(),
        points: 0,
        nodes: 0,
        levels: recipe.levels,
        refinement: recipe.refinement,
        primitive: Primitive::Point,
        method: Method { name: "random".into(), grid: 128, leaf_capacity: recipe.node_points },
        lattice: Lattice {
            scale: 0.001,
            offset: recipe.corner,
            origin: [0; 3],
            side_bits: SIDE_BITS,
        },
        bounds: LatticeBox::EMPTY,
        largest_rounding: 0.0,
        attributes: vec![
            attribute("color", ScalarType::U8, 3, 0),
            attribute("intensity", ScalarType::U16, 1, 1),
        ],
        groups: vec![
            GroupInfo { name: "base".into(), columns: vec![0, 0] },
            GroupInfo { name: "intensity".into(), columns: vec![0] },
        ],
        fine: None,
        crs: None,
        sources: vec![],
    }
}

fn draft(key: NodeKey, recipe: Recipe, manifest: &Manifest, rng: &mut Rng) -> Draft {
    let bits = manifest.lattice.node_bits(key.level());
    let corner = manifest.lattice.node_min(key);
    let points = rng.u32(1..=recipe.node_points);
    let mut codes: Vec<u64> = (0..points)
        .map(|_| morton_encode(std::array::from_fn(|_| rng.u32(0..1 << bits))))
        .collect();
    codes.sort_unstable();
    let mut bounds = LatticeBox::EMPTY;
    for &code in &codes {
        let q = lodestream_protocol::morton_decode(code);
        bounds.grow(std::array::from_fn(|a| corner[a] + q[a]));
    }
    let mut base = Vec::new();
    encode_positions(&mut base, &codes, bits).expect("encodes");
    let colors: Vec<u8> = (0..3 * points).map(|_| rng.u8(..)).collect();
    encode_column(&mut base, &manifest.attributes[0], &colors).expect("encodes");
    let mut further = Vec::new();
    let intensities: Vec<u8> = (0..2 * points).map(|_| rng.u8(..)).collect();
    encode_column(&mut further, &manifest.attributes[1], &intensities).expect("encodes");

    let mut children = Vec::new();
    if key.level() + 1 < recipe.levels {
        for octant in 0..8 {
            // The root has all children, so that every camera finds something.
            if key.level() == 0 || rng.f32() < 0.6 {
                let child = key.child(octant).expect("above the finest level");
                children.push(draft(child, recipe, manifest, rng));
            }
        }
    }
    for child in &children {
        bounds.grow(child.bounds.min);
        bounds.grow(child.bounds.max);
    }
    Draft { key, children, points, bounds, payloads: vec![base, further] }
}

/// Where everything lies.
#[derive(Default)]
struct Layout {
    groups: [Vec<u8>; 2],
    /// Where each page's payloads start in both groups, by the first key of the page.
    starts: HashMap<NodeKey, [u64; 2]>,
    pages: Vec<u8>,
    points: u64,
    nodes: u64,
}

/// The nodes of the page that starts with `seeds`, breadth-first, and whether each one's children
/// are in another page.
fn page_nodes<'a>(seeds: &[&'a Draft], page_levels: u8) -> Vec<(&'a Draft, bool)> {
    let mut nodes = Vec::new();
    let mut level: Vec<&Draft> = seeds.to_vec();
    while !level.is_empty() {
        let last = (level[0].key.level() + 1).is_multiple_of(page_levels);
        nodes.extend(level.iter().map(|&node| (node, last && !node.children.is_empty())));
        level = if last { vec![] } else { level.iter().flat_map(|n| &n.children).collect() };
    }
    nodes
}

impl Layout {
    fn place_payloads(&mut self, root: &Draft, page_levels: u8) {
        let mut pages = VecDeque::from([vec![root]]);
        while let Some(seeds) = pages.pop_front() {
            let start = [self.groups[0].len() as u64, self.groups[1].len() as u64];
            self.starts.insert(seeds[0].key, start);
            for (node, paged) in page_nodes(&seeds, page_levels) {
                self.groups[0].extend_from_slice(&node.payloads[0]);
                self.groups[1].extend_from_slice(&node.payloads[1]);
                self.points += u64::from(node.points);
                self.nodes += 1;
                if paged {
                    pages.push_back(node.children.iter().collect());
                }
            }
        }
    }

    /// Encodes a page; the pages below it first, because it holds their lengths and checksums.
    fn encode_page(&mut self, seeds: &[&Draft], page_levels: u8, lattice: &Lattice) -> Vec<u8> {
        let pages_start = (self.groups[0].len() + self.groups[1].len()) as u64;
        let mut nodes = Vec::new();
        for (draft, paged) in page_nodes(seeds, page_levels) {
            let child_page = paged.then(|| {
                let children: Vec<&Draft> = draft.children.iter().collect();
                let bytes = self.encode_page(&children, page_levels, lattice);
                let page = PageRef {
                    offset: pages_start + self.pages.len() as u64,
                    bytes: bytes.len() as u32,
                    nodes: page_nodes(&children, page_levels).len() as u32,
                    crc: crc32fast::hash(&bytes),
                };
                self.pages.extend_from_slice(&bytes);
                page
            });
            let spacing = (lattice.node_side_world(draft.key.level()) / 32.0) as f32;
            let mask = draft.children.iter().fold(0, |mask, c| mask | 1 << c.key.octant());
            let payloads = draft.payloads.iter().map(|bytes| PayloadRef {
                offset: 0,
                bytes: bytes.len() as u32,
                crc: crc32fast::hash(bytes),
            });
            nodes.push(Node {
                key: draft.key,
                child_mask: mask,
                points: draft.points,
                bounds: draft.bounds,
                // As of a sampled node.
                geometric_error: if mask == 0 { 0.0 } else { spacing },
                spacing,
                normal_cone: None,
                payloads: payloads.collect(),
                child_page,
            });
        }
        let [base, further] = self.starts[&seeds[0].key];
        let offsets = vec![base, self.groups[0].len() as u64 + further];
        HierarchyPage::encode(&nodes, offsets, lattice).expect("encodes")
    }
}
