//! The format held still: tiny datasets of every primitive and both refinements, byte for byte.
//!
//! `LODESTREAM_WRITE_GOLDEN=1 cargo test -p lodestream-protocol` writes the files anew, which is only
//! right together with a new format version.

use std::path::PathBuf;

use lodestream_protocol::{
    Attribute, Boot, Dataset, Domain, Error, Fine, GroupInfo, HierarchyPage, Lattice, LatticeBox,
    Manifest, Method, Node, NodeKey, NodePoints, NormalCone, PageRef, PayloadRef, Primitive,
    ReadAt, Refinement, ScalarType, SourceInfo, Storage, decode_group, encode_cells, encode_colors,
    encode_column, encode_fine_positions, encode_positions, morton_encode,
};

fn attribute(name: &str, scalar: ScalarType, components: u8, group: usize) -> Attribute {
    Attribute {
        name: name.into(),
        scalar,
        components,
        domain: if name.starts_with("texel_") { Domain::Texel } else { Domain::Element },
        storage: Storage::Column { group },
        min: vec![],
        max: vec![],
    }
}

fn f32s(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Attributes and, for the root's two elements and its child's one, their values.
fn elements(primitive: Primitive) -> Vec<(Attribute, [Vec<u8>; 2])> {
    use ScalarType::{F32, U8, U16};
    let axes = || {
        [
            (
                attribute("axis_u", F32, 3, 0),
                [f32s(&[1.0, 0.0, 0.0, 0.5, 0.0, 0.0]), f32s(&[0.25, 0.0, 0.0])],
            ),
            (
                attribute("axis_v", F32, 3, 0),
                [f32s(&[0.0, 2.0, 0.0, 0.0, 0.75, 0.0]), f32s(&[0.0, 0.0, 0.125])],
            ),
        ]
    };
    let mut all = vec![(attribute("color", U8, 3, 0), [vec![255, 128, 0, 1, 2, 3], vec![9, 8, 7]])];
    match primitive {
        Primitive::Point => all
            .push((attribute("intensity", U16, 1, 1), [vec![0x34, 0x12, 0xff, 0xff], vec![7, 0]])),
        Primitive::Disc => {
            all.push((
                attribute("normal", F32, 3, 1),
                [f32s(&[0.0, 0.0, 1.0, 1.0, 0.0, 0.0]), f32s(&[0.0, 1.0, 0.0])],
            ));
            all.push((attribute("radius", F32, 1, 0), [f32s(&[0.5, 0.75]), f32s(&[0.25])]));
        }
        Primitive::Ellipse => all.extend(axes()),
        Primitive::Rectangle => {
            all.extend(axes());
            // 2 x 1 and 1 x 2 texels; then 1 x 1.
            all.push((
                attribute("texture_size", U16, 2, 0),
                [vec![2, 0, 1, 0, 1, 0, 2, 0], vec![1, 0, 1, 0]],
            ));
            all.push((
                attribute("texel_color", U8, 4, 0),
                [(0..16).collect(), vec![200, 100, 50, 255]],
            ));
        }
    }
    all
}

/// Around the third axis and a little wider than half a sphere: all normals above are in it.
const CONE: NormalCone = NormalCone::from_bytes([128, 127, 128]);

/// Whether positions are stored in two parts.
#[derive(Clone, Copy, PartialEq)]
enum Positions {
    Whole,
    Cells,
}

/// A root with two elements and, in a page of its own, one child with one element.
fn dataset(primitive: Primitive, refinement: Refinement, stored: Positions) -> Vec<u8> {
    let elements = elements(primitive);
    let attributes: Vec<Attribute> = elements.iter().map(|(a, _)| a.clone()).collect();
    let last = attributes.iter().filter_map(Attribute::group).max().unwrap_or(0);
    // Cells need a root of more than 256 lattice units.
    let (fine, finer) = match stored {
        Positions::Whole => (None, 0),
        Positions::Cells => (Some(Fine { group: last + 1, color: false, cells_per_spacing: 2 }), 8),
    };
    let groups = 1 + last + usize::from(fine.is_some());
    let lattice = Lattice {
        scale: 0.01,
        offset: [1000.0, 2000.0, -5.0],
        origin: [7, -8, 9],
        side_bits: 4 + finer,
    };
    let positions = [vec![[0, 1, 2], [15, 15, 15]], vec![[3, 0, 7]]];
    let within = if fine.is_some() { 37 } else { 0 };
    let positions =
        positions.map(|node| node.into_iter().map(|q| q.map(|c| (c << finer) + within)).collect());
    let positions: [Vec<[u32; 3]>; 2] = positions;
    let keys = [NodeKey::ROOT, NodeKey::ROOT.child(5).expect("octant")];
    let mut payloads: Vec<Vec<Vec<u8>>> = Vec::new();
    let mut infos: Vec<GroupInfo> = (0..groups)
        .map(|group| {
            let name = if group == 0 { "base".into() } else { format!("group{group}") };
            let own = attributes.iter().filter(|a| a.group() == Some(group)).count();
            let has_positions = group == 0 || fine.is_some_and(|fine| fine.group == group);
            GroupInfo { name, columns: vec![0; usize::from(has_positions) + own] }
        })
        .collect();
    for (n, positions) in positions.iter().enumerate() {
        let mut node = vec![Vec::new(); groups];
        let mut columns = vec![0; groups];
        columns[0] = 1;
        let codes: Vec<u64> = positions.iter().map(|&q| morton_encode(q)).collect();
        let bits = lattice.node_bits(n as u8);
        match fine {
            None => encode_positions(&mut node[0], &codes, bits).expect("encodes"),
            Some(fine) => {
                encode_cells(&mut node[0], &codes, bits, CELL_BITS).expect("encodes");
                encode_fine_positions(&mut node[fine.group], &codes, CELL_BITS).expect("encodes");
                infos[fine.group].columns[0] += node[fine.group].len() as u64;
            }
        }
        infos[0].columns[0] += node[0].len() as u64;
        for (attribute, values) in &elements {
            let group = attribute.group().expect("a column");
            let before = node[group].len();
            encode_column(&mut node[group], attribute, &values[n]).expect("encodes");
            infos[group].columns[columns[group]] += (node[group].len() - before) as u64;
            columns[group] += 1;
        }
        payloads.push(node);
    }
    let manifest = Manifest {
        generator: "golden".into(),
        points: 3,
        nodes: 2,
        levels: 2,
        refinement,
        primitive,
        method: Method { name: "golden".into(), grid: 128, leaf_capacity: 2 },
        lattice,
        bounds: LatticeBox {
            min: [0, 0, 2].map(|c| (c << finer) + within),
            max: [(15 << finer) + within; 3],
        },
        largest_rounding: 0.0,
        attributes,
        groups: infos,
        fine,
        crs: None,
        sources: vec![SourceInfo { name: "golden.las".into(), points: 3 }],
    };
    // Offsets from the end of the index: group by group, root before child.
    let mut offset = 0;
    assert!(fine.is_none() || manifest.cell_bits(0, 0.25) == CELL_BITS);
    let mut offsets = [Vec::new(), Vec::new()];
    for group in 0..groups {
        for (node, offsets) in offsets.iter_mut().enumerate() {
            offsets.push(offset);
            offset += payloads[node][group].len() as u64;
        }
    }
    let node = |n: usize, child_mask: u8, bounds: LatticeBox| Node {
        key: keys[n],
        child_mask,
        points: positions[n].len() as u32,
        bounds,
        geometric_error: if n == 0 { 0.5 } else { 0.0 },
        spacing: 0.25,
        normal_cone: (primitive == Primitive::Disc).then_some(CONE),
        payloads: payloads[n]
            .iter()
            .map(|p| PayloadRef { offset: 0, bytes: p.len() as u32, crc: crc32fast::hash(p) })
            .collect(),
        child_page: None,
    };
    let only = [11, 0, 15].map(|c| (c << finer) + within);
    let child = node(1, 0, LatticeBox { min: only, max: only });
    let child_page =
        HierarchyPage::encode(&[child], offsets[1].clone(), &lattice).expect("encodes");
    let mut root = node(0, 1 << 5, manifest.bounds);
    root.child_page = Some(PageRef {
        offset,
        bytes: child_page.len() as u32,
        nodes: 1,
        crc: crc32fast::hash(&child_page),
    });
    let root_page = HierarchyPage::encode(&[root], offsets[0].clone(), &lattice).expect("encodes");
    let top = payloads[0][0].len() as u64;
    let tail = offset + child_page.len() as u64;
    let mut file = Boot::encode(&manifest, &root_page, top, tail).expect("encodes");
    for group in 0..groups {
        payloads.iter().for_each(|p| file.extend_from_slice(&p[group]));
    }
    file.extend_from_slice(&child_page);
    file
}

/// Of spacings of 25 lattice units, two cells each.
const CELL_BITS: u8 = 3;

const KINDS: [(&str, Primitive, Refinement); 8] = [
    ("point-additive", Primitive::Point, Refinement::Additive),
    ("point-replace", Primitive::Point, Refinement::Replace),
    ("disc-additive", Primitive::Disc, Refinement::Additive),
    ("disc-replace", Primitive::Disc, Refinement::Replace),
    ("ellipse-additive", Primitive::Ellipse, Refinement::Additive),
    ("ellipse-replace", Primitive::Ellipse, Refinement::Replace),
    ("rectangle-additive", Primitive::Rectangle, Refinement::Additive),
    ("rectangle-replace", Primitive::Rectangle, Refinement::Replace),
];

#[test]
fn every_primitive_and_refinement_keeps_its_bytes() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let whole = KINDS.map(|(name, primitive, refinement)| {
        (name, dataset(primitive, refinement, Positions::Whole))
    });
    let cells = dataset(Primitive::Point, Refinement::Additive, Positions::Cells);
    for (name, bytes) in whole.into_iter().chain([("point-cells", cells)]) {
        let path = folder.join(format!("{name}.lods"));
        if std::env::var_os("LODESTREAM_WRITE_GOLDEN").is_some() {
            std::fs::create_dir_all(&folder).expect("folder");
            std::fs::write(&path, &bytes).expect("writes");
        }
        let golden = std::fs::read(&path).expect("golden file is committed");
        assert!(golden == bytes, "{name}: the encoder no longer writes the golden bytes");
    }
}

/// Colours of 8 bits, as they are and as LAS has them, in two parts.
#[test]
fn colours_in_two_parts_keep_their_bytes() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/colors.columns");
    let mut bytes = Vec::new();
    for step in [1u16, 257] {
        let colors = (0..300u16).flat_map(|i| [i * 7 % 256, i % 256, 255 - i / 2]);
        let values: Vec<u8> = colors.flat_map(|c| (c * step).to_le_bytes()).collect();
        let color = attribute("color", ScalarType::U16, 3, 0);
        let mut fine = Vec::new();
        encode_colors(&mut bytes, &mut fine, &color, &values).expect("encodes");
        assert!(!fine.is_empty());
        bytes.append(&mut fine);
    }
    if std::env::var_os("LODESTREAM_WRITE_GOLDEN").is_some() {
        std::fs::write(&path, &bytes).expect("writes");
    }
    let golden = std::fs::read(&path).expect("golden file is committed");
    assert!(golden == bytes, "the encoder no longer writes the golden bytes");
}

#[test]
fn every_primitive_and_refinement_reads_back() {
    for (name, primitive, refinement) in KINDS {
        let dataset = dataset(primitive, refinement, Positions::Whole);
        let dataset = Dataset::open(dataset).expect(name);
        assert_eq!(dataset.manifest().primitive, primitive);
        assert_eq!(dataset.manifest().refinement, refinement);
        let nodes = dataset.hierarchy().expect(name);
        assert_eq!(nodes[1].key.to_string(), "1/1/0/1");
        let groups: Vec<usize> = (0..dataset.manifest().groups.len()).collect();
        for (n, node) in nodes.iter().enumerate() {
            let points = dataset.read_node(node, &groups).expect(name);
            assert_eq!(points.positions.len(), 2 - n);
            for (index, (_, values)) in elements(primitive).iter().enumerate() {
                let column = points.column(index).expect("read");
                assert_eq!(column.bytes, values[n], "{name} attribute {index}");
                if dataset.manifest().attributes[index].is_normal() {
                    let cone = node.normal_cone.expect("discs have normals");
                    for normal in values[n].chunks_exact(12) {
                        let component = |a: usize| ScalarType::F32.to_f64(&normal[4 * a..]);
                        assert!(cone.contains(std::array::from_fn(component)));
                    }
                }
            }
        }
    }
}

#[test]
fn files_of_the_first_version_are_read() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden/version-1.lods");
    let old = Dataset::open(std::fs::read(path).expect("committed")).expect("a dataset");
    assert_eq!(old.boot().header.version, (1, 0));
    let new = dataset(Primitive::Rectangle, Refinement::Replace, Positions::Whole);
    let new = Dataset::open(new).expect("a dataset");
    assert_eq!(old.manifest(), new.manifest());
    for node in old.hierarchy().expect("a tree") {
        let read = |dataset: &Dataset<Vec<u8>>| dataset.read_node(&node, &[0]).expect("read");
        assert_eq!(read(&old), read(&new));
    }
}

#[test]
fn cells_are_drawn_in_their_middles_and_fine_positions_are_exact() {
    let bytes = dataset(Primitive::Point, Refinement::Additive, Positions::Cells);
    let dataset = Dataset::open(bytes).expect("a dataset");
    let nodes = dataset.hierarchy().expect("a tree");
    let exact = dataset.read_node(&nodes[0], &[]).expect("read");
    assert_eq!(exact.positions, [[37, 256 + 37, 512 + 37], [15 * 256 + 37; 3]]);
    let base = nodes[0].payloads[0];
    let payload = dataset.source().read_at(base.offset, base.bytes as usize).expect("read");
    let mut points = NodePoints::new(nodes[0].key);
    points
        .add(decode_group(dataset.manifest(), 0, &nodes[0], &payload).expect("decodes"))
        .expect("fits");
    // 37 lies in the cell from 32 to 39.
    assert_eq!(points.positions, [[36, 256 + 36, 512 + 36], [15 * 256 + 36; 3]]);
    assert_eq!((points.cell_bits, exact.cell_bits), (CELL_BITS, 0));
}

#[test]
fn every_cut_is_refused() {
    let whole = dataset(Primitive::Rectangle, Refinement::Replace, Positions::Whole);
    for len in 0..whole.len() {
        let error = Dataset::open(whole[..len].to_vec()).expect_err("refused");
        assert!(matches!(error, Error::Truncated { .. }), "{len}: {error}");
    }
}

#[test]
fn every_flipped_bit_is_found() {
    let whole = dataset(Primitive::Disc, Refinement::Replace, Positions::Whole);
    for bit in 0..8 * whole.len() {
        let mut bytes = whole.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let read_all = || {
            let dataset = Dataset::open(bytes)?;
            let nodes = dataset.hierarchy()?;
            nodes.iter().try_for_each(|node| dataset.read_node(node, &[0, 1]).map(|_| ()))
        };
        assert!(read_all().is_err(), "bit {bit} was flipped and nobody noticed");
    }
}
