//! Writes the first inputs of every target: `cargo run --example seeds -- DATASET.lods fuzz/seeds`.
//!
//! From the dataset, which is to be a small one (`build 'sim:courtyard?points=6000' --grid 32`): its boot block,
//! its pages, the payloads of a few nodes. From nowhere: columns of every scalar type, which no single dataset
//! holds, and rights to be signed.

use std::{error::Error, fs, path::Path};

use lodestream_fuzz::{
    BootInput, ColumnsInput, HierarchyInput, LinkInput, in_parts, leaf, manifest,
};
use lodestream_protocol::{
    Attribute, Boot, Dataset, Domain, HEADER_BYTES, HierarchyPage, Node, NodeKey, NormalCone,
    PageRef, PayloadRef, Primitive, ReadAt, ScalarType, Storage, decode_unchecked, encode_column,
    encode_positions, morton_encode,
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [dataset, out] = &arguments[..] else { return Err("usage: seeds DATASET OUT".into()) };
    let dataset = Dataset::open(fs::read(dataset)?)?;
    let out = Path::new(out);
    for target in ["boot", "hierarchy", "columns", "signature"] {
        fs::create_dir_all(out.join(target))?;
    }

    let header = dataset.boot().header;
    let json = dataset.source().read_at(HEADER_BYTES as u64, header.manifest_bytes as usize)?;
    let page_at = (HEADER_BYTES + json.len()) as u64;
    let root = dataset.source().read_at(page_at, header.root_page_bytes as usize)?;
    let bytes = BootInput { manifest: &json, page: &root }.to_bytes();
    fs::write(out.join("boot/dataset"), bytes.ok_or("the manifest is too large for a seed")?)?;

    let manifest = dataset.manifest();
    let nodes = dataset.hierarchy()?;
    let groups = u8::try_from(manifest.groups.len())?;
    let levels = manifest.levels;
    let input = HierarchyInput { groups, levels, root: &root, child: &[] };
    fs::write(out.join("hierarchy/dataset"), input.to_bytes().ok_or("too large for a seed")?)?;
    write_paged(&out.join("hierarchy/paged"))?;

    // The smallest nodes, one a level: small inputs are mutated best.
    for level in 0..manifest.levels {
        let of_level = nodes.iter().filter(|node| node.key.level() == level);
        let Some(node) = of_level.min_by_key(|node| node.points) else { continue };
        for (part, group) in [("", Some(0)), ("_fine", manifest.fine.map(|fine| fine.group))] {
            let payload = group.map(|group| &node.payloads[group]).filter(|p| p.bytes > 0);
            let Some(payload) = payload else { continue };
            let payload = dataset.source().read_at(payload.offset, payload.bytes as usize)?;
            let (manifest, node) = (manifest.clone(), node.clone());
            let input = ColumnsInput { manifest, node, payload: &payload };
            write_columns(&out.join(format!("columns/dataset_level_{level}{part}")), &input)?;
        }
    }

    write_links(&out.join("signature"))?;

    for scalar in ScalarType::ALL {
        let name = format!("{scalar:?}").to_lowercase();
        for components in [1, 3] {
            let attributes = vec![attribute("a0", scalar, components, Domain::Element)];
            let path = out.join(format!("columns/{name}x{components}"));
            write_made(&path, attributes, Primitive::Point, 21)?;
        }
    }
    let textured = vec![
        attribute("texture_size", ScalarType::U8, 2, Domain::Element),
        attribute("a1", ScalarType::U8, 4, Domain::Texel),
    ];
    write_made(&out.join("columns/texture"), textured, Primitive::Rectangle, 32)
}

/// Writes rights as they are signed, one of them altered and with the fields of another behind it.
fn write_links(folder: &Path) -> Result<(), Box<dyn Error>> {
    const ANOTHER: &[u8] = b"&v=0&datasets=%2A&expires=2000";
    let link = LinkInput { datasets: "site-*", expires: 1000, edits: &[], suffix: &[] };
    let name = LinkInput { datasets: "a", expires: u64::MAX, ..link };
    let altered =
        LinkInput { edits: &[9, 0, b'*', 40, 1, 0, 50, 2, b'%'], suffix: ANOTHER, ..link };
    for (file_name, input) in [("prefix", link), ("name", name), ("altered", altered)] {
        fs::write(folder.join(file_name), input.to_bytes().ok_or("too large for a seed")?)?;
    }
    Ok(())
}

/// Writes a tree of two pages, which a small dataset never has.
fn write_paged(path: &Path) -> Result<(), Box<dyn Error>> {
    let lattice = manifest(32, 3, 1, Vec::new()).lattice;
    let payload = PayloadRef { offset: 0, bytes: 100, crc: 1 };
    let node = |key, child_mask| Node {
        child_mask,
        payloads: vec![payload],
        normal_cone: Some(NormalCone::from_bytes([128, 128, 10])),
        ..leaf(key, 50)
    };
    let children: Vec<NodeKey> = (0..2).filter_map(|octant| NodeKey::ROOT.child(octant)).collect();
    let mut paged = node(children[1], 0b1000_0001);
    let leaves: Vec<Node> = paged.children().map(|key| node(key, 0)).collect();
    paged.child_page = Some(PageRef { offset: 300, bytes: 90, nodes: 2, crc: 0 });
    let top = [node(NodeKey::ROOT, 0b11), node(children[0], 0), paged];
    let root = HierarchyPage::encode(&top, vec![0], &lattice)?;
    let child = HierarchyPage::encode(&leaves, vec![300], &lattice)?;
    let input = HierarchyInput { groups: 1, levels: 3, root: &root, child: &child };
    let boot = Boot::parse(&input.seal().ok_or("the seed cannot be sealed")?)?;
    input.child_page_of(&boot, &boot.root_page.nodes[2]).ok_or("no child page")??;
    Ok(fs::write(path, input.to_bytes().ok_or("too large for a seed")?)?)
}

fn attribute(name: &str, scalar: ScalarType, components: u8, domain: Domain) -> Attribute {
    let storage = Storage::Column { group: 0 };
    let (name, min, max) = (name.to_owned(), Vec::new(), Vec::new());
    Attribute { name, scalar, components, domain, storage, min, max }
}

/// Writes a root node of 300 elements; textures have 2 x 3 texels each.
fn write_made(
    path: &Path,
    attributes: Vec<Attribute>,
    primitive: Primitive,
    side_bits: u8,
) -> Result<(), Box<dyn Error>> {
    const ELEMENTS: u32 = 300;
    let mut payload = Vec::new();
    let mut codes: Vec<u64> = (0..ELEMENTS).map(|i| morton_encode([i * 7, i * i, i / 3])).collect();
    codes.sort_unstable();
    encode_positions(&mut payload, &codes, side_bits)?;
    for attribute in &attributes {
        let values = match attribute.domain {
            Domain::Element => ELEMENTS as usize,
            Domain::Texel => ELEMENTS as usize * 6,
        };
        let bytes: Vec<u8> = match attribute.name.as_str() {
            "texture_size" => [2, 3].repeat(values),
            _ => (0..values * attribute.value_bytes()).map(|i| (i * i / 5) as u8).collect(),
        };
        encode_column(&mut payload, attribute, &bytes)?;
    }
    let mut manifest = manifest(side_bits, 1, 1, attributes);
    manifest.primitive = primitive;
    let node = leaf(NodeKey::ROOT, ELEMENTS);
    write_columns(path, &ColumnsInput { manifest, node, payload: &payload })
}

/// Writes a seed, once it is clear that the target reads it as what it was meant to be.
fn write_columns(path: &Path, input: &ColumnsInput<'_>) -> Result<(), Box<dyn Error>> {
    let bytes = input.to_bytes().ok_or("more columns than an input of `columns` can name")?;
    let back = ColumnsInput::parse(&bytes).ok_or("the seed describes no manifest")?;
    let read =
        |manifest, group| decode_unchecked(manifest, group, &back.node, back.payload).map(drop);
    let parted = in_parts(&back.manifest);
    read(&back.manifest, 0).or_else(|_| read(&parted, 0)).or_else(|_| read(&parted, 1))?;
    Ok(fs::write(path, bytes)?)
}
