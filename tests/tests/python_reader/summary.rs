//! What `read_lods.py` prints of a dataset, computed by our own decoder.

use lodestream_protocol::{
    Attribute, Column, Dataset, Domain, Manifest, Node, NodePoints, ReadAt, Result,
};
use serde::Deserialize;

/// Counts, bounds, and a checksum that does not depend on the order of nodes.
#[derive(Debug, PartialEq, Deserialize)]
pub struct Summary {
    points: u64,
    nodes: u64,
    levels: u64,
    min: Option<[f64; 3]>,
    max: Option<[f64; 3]>,
    /// Names, those per element first.
    pub attributes: Vec<String>,
    content_id: String,
    checksum: String,
}

impl Summary {
    /// Reads all of a dataset.
    pub fn of<R: ReadAt>(dataset: &Dataset<R>) -> Result<Self> {
        let manifest = dataset.manifest();
        let nodes = dataset.hierarchy()?;
        let (mut points, mut levels, mut checksum) = (0, 0, 0_u64);
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for node in &nodes {
            let decoded = read(dataset, node)?;
            points += u64::from(node.points);
            levels = levels.max(u64::from(node.key.level()) + 1);
            for (index, position) in world(manifest, &decoded).into_iter().enumerate() {
                let mut row: Vec<u8> = position.into_iter().flat_map(f64::to_le_bytes).collect();
                for attribute in of_domain(manifest, Domain::Element) {
                    row.extend(value(manifest, &decoded, attribute, index));
                }
                checksum = checksum.wrapping_add(crc32fast::hash(&row).into());
                for axis in 0..3 {
                    min[axis] = min[axis].min(position[axis]);
                    max[axis] = max[axis].max(position[axis]);
                }
            }
            for index in 0..texels(manifest, &decoded) {
                let row: Vec<u8> = of_domain(manifest, Domain::Texel)
                    .flat_map(|attribute| value(manifest, &decoded, attribute, index))
                    .collect();
                checksum = checksum.wrapping_add(crc32fast::hash(&row).into());
            }
        }
        let names = |domain| of_domain(manifest, domain).map(|attribute| attribute.name.clone());
        Ok(Self {
            points,
            nodes: nodes.len() as u64,
            levels,
            min: (points > 0).then_some(min),
            max: (points > 0).then_some(max),
            attributes: names(Domain::Element).chain(names(Domain::Texel)).collect(),
            content_id: dataset.boot().header.content_id_hex(),
            checksum: format!("{checksum:016x}"),
        })
    }
}

/// Every element as numbers (their bits, so that they can be sorted): coordinates, then attributes.
pub fn rows<R: ReadAt>(dataset: &Dataset<R>) -> Result<Vec<Vec<u64>>> {
    let manifest = dataset.manifest();
    let mut rows = Vec::new();
    for node in dataset.hierarchy()? {
        let decoded = read(dataset, &node)?;
        for (index, position) in world(manifest, &decoded).into_iter().enumerate() {
            let mut row = position.map(f64::to_bits).to_vec();
            for attribute in of_domain(manifest, Domain::Element) {
                let bytes = value(manifest, &decoded, attribute, index);
                let components = bytes.chunks_exact(attribute.scalar.size_bytes());
                row.extend(components.map(|c| attribute.scalar.to_f64(c).to_bits()));
            }
            rows.push(row);
        }
    }
    Ok(rows)
}

fn read<R: ReadAt>(dataset: &Dataset<R>, node: &Node) -> Result<NodePoints> {
    let groups: Vec<usize> = (0..dataset.manifest().groups.len()).collect();
    dataset.read_node(node, &groups)
}

fn world(manifest: &Manifest, decoded: &NodePoints) -> Vec<[f64; 3]> {
    let lattice = &manifest.lattice;
    let corner = lattice.node_min(decoded.key);
    let positions = decoded.positions.iter();
    positions.map(|q| lattice.world(std::array::from_fn(|a| corner[a] + q[a]))).collect()
}

fn of_domain(manifest: &Manifest, domain: Domain) -> impl Iterator<Item = &Attribute> {
    manifest.attributes.iter().filter(move |attribute| attribute.domain == domain)
}

/// The bytes of one element's or texel's value.
fn value(manifest: &Manifest, decoded: &NodePoints, attribute: &Attribute, at: usize) -> Vec<u8> {
    attribute.constant().unwrap_or_else(|| {
        let size = attribute.value_bytes();
        column(manifest, decoded, attribute).bytes[at * size..][..size].to_vec()
    })
}

/// Texels of a node: as many as its texel columns have values.
fn texels(manifest: &Manifest, decoded: &NodePoints) -> usize {
    let mut stored = of_domain(manifest, Domain::Texel).filter(|a| a.constant().is_none());
    stored.next().map_or(0, |attribute| {
        column(manifest, decoded, attribute).bytes.len() / attribute.value_bytes()
    })
}

fn column<'a>(manifest: &Manifest, decoded: &'a NodePoints, attribute: &Attribute) -> &'a Column {
    let index = manifest.attributes.iter().position(|a| a.name == attribute.name);
    decoded.column(index.expect("an attribute of the manifest")).expect("all groups were read")
}
