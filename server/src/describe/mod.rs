//! What a dataset holds, in figures: from its manifest and hierarchy, without any payload.

mod render;
mod table;

use lodestream_protocol::{
    Attribute, Dataset, Fine, GroupInfo, Lattice, Manifest, Method, Node, Primitive, ReadAt,
    Refinement, Result, ScalarType, SourceInfo,
};
use serde::Serialize;

pub use render::render;

/// Attributes that views and methods know what to do with: said to be absent where they are.
const WELL_KNOWN: [&str; 5] = ["color", "intensity", "classification", "normal", "gps_time"];

/// A dataset in figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Description {
    /// Format version, major and minor.
    pub format_version: (u16, u16),
    /// Program and version that wrote the file.
    pub generator: String,
    /// Identity of the content, in hexadecimal.
    pub content_id: String,
    /// Elements over all nodes.
    pub points: u64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Length of the file.
    pub file_bytes: u64,
    /// File bytes per element; 0 where there are none.
    pub bytes_per_point: f64,
    /// Header, manifest and all hierarchy pages.
    pub index_bytes: u64,
    /// What the first picture needs: the part of the file before `boot_bytes`.
    pub boot_bytes: u64,
    /// What the elements are.
    pub primitive: Primitive,
    /// How a child relates to its parent.
    pub refinement: Refinement,
    /// How the levels were made.
    pub method: Method,
    /// Tight bounds in world units; nothing where there are no elements.
    pub bounds: Option<WorldBounds>,
    /// The integer lattice of all coordinates.
    pub lattice: Lattice,
    /// Largest distance on any axis between a source coordinate and its lattice point, world units.
    pub largest_rounding: f64,
    /// Column groups.
    pub groups: Vec<GroupDescription>,
    /// Attributes that are stored per element, in column order.
    pub attributes: Vec<AttributeDescription>,
    /// Attributes that have one value for all elements.
    pub constants: Vec<ConstantDescription>,
    /// Well-known attributes that the dataset does not have.
    pub absent: Vec<&'static str>,
    /// Levels of the tree, coarsest first.
    pub levels: Vec<LevelDescription>,
    /// Coordinate reference system as the source gives it.
    pub crs: Option<String>,
    /// Inputs, in build order.
    pub sources: Vec<SourceInfo>,
}

/// A box in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorldBounds {
    /// Lowest coordinates.
    pub min: [f64; 3],
    /// Highest coordinates.
    pub max: [f64; 3],
}

/// A column group: what is fetched together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupDescription {
    /// Name.
    pub name: String,
    /// Its columns, in order; `position` is the first of group 0.
    pub columns: Vec<ColumnDescription>,
    /// Bytes over all nodes.
    pub bytes: u64,
    /// Bytes per element; 0 where there are none.
    pub bytes_per_point: f64,
}

/// A column of a group.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ColumnDescription {
    /// Attribute, or `position`.
    pub name: String,
    /// Bytes over all nodes.
    pub bytes: u64,
    /// Bytes per element; 0 where there are none.
    pub bytes_per_point: f64,
}

/// An attribute that is stored per element.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AttributeDescription {
    /// Name.
    pub name: String,
    /// Type of each component.
    #[serde(rename = "type")]
    pub scalar: ScalarType,
    /// Components per value.
    pub components: u8,
    /// Name of its column group.
    pub group: String,
    /// Smallest value per component; empty where it is not known.
    pub min: Vec<f64>,
    /// Largest value per component; empty where it is not known.
    pub max: Vec<f64>,
}

/// An attribute that has one value for all elements.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConstantDescription {
    /// Name.
    pub name: String,
    /// Type of each component.
    #[serde(rename = "type")]
    pub scalar: ScalarType,
    /// The value, per component.
    pub value: Vec<f64>,
}

/// A level of the tree.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelDescription {
    /// Halvings of the root cube's side.
    pub level: u8,
    /// Nodes of the level.
    pub nodes: u64,
    /// Elements in them.
    pub points: u64,
    /// Bytes of their payloads, all groups.
    pub bytes: u64,
    /// Minimum distance in world units that sampled elements of the level keep.
    pub spacing: f64,
}

/// Reads manifest and hierarchy and sums them up.
///
/// # Errors
/// What the source says, or what is wrong with the bytes.
pub fn describe<R: ReadAt>(dataset: &Dataset<R>) -> Result<Description> {
    let (manifest, header) = (dataset.manifest(), &dataset.boot().header);
    let nodes = dataset.hierarchy()?;
    let payload_bytes = manifest.groups.iter().fold(0u64, |sum, g| sum.saturating_add(g.bytes()));
    let bounds = manifest.bounds_world();
    let has = |name: &str| manifest.attribute(name).is_some();
    Ok(Description {
        format_version: header.version,
        generator: manifest.generator.clone(),
        content_id: header.content_id_hex(),
        points: manifest.points,
        nodes: manifest.nodes,
        file_bytes: header.file_bytes,
        bytes_per_point: per_point(header.file_bytes, manifest),
        index_bytes: header.file_bytes.saturating_sub(payload_bytes),
        boot_bytes: header.boot_bytes,
        primitive: manifest.primitive,
        refinement: manifest.refinement,
        method: manifest.method.clone(),
        bounds: bounds.map(|(min, max)| WorldBounds { min, max }),
        lattice: manifest.lattice,
        largest_rounding: manifest.largest_rounding,
        groups: groups(manifest),
        attributes: manifest.attributes.iter().filter_map(|a| stored(a, manifest)).collect(),
        constants: manifest.attributes.iter().filter_map(constant).collect(),
        absent: WELL_KNOWN.into_iter().filter(|name| !has(name)).collect(),
        levels: levels(&nodes, manifest),
        crs: manifest.crs.clone(),
        sources: manifest.sources.clone(),
    })
}

fn per_point(bytes: u64, manifest: &Manifest) -> f64 {
    if manifest.points == 0 { 0.0 } else { bytes as f64 / manifest.points as f64 }
}

fn groups(manifest: &Manifest) -> Vec<GroupDescription> {
    let describe = |(index, group): (usize, &GroupInfo)| {
        let position = (index == 0).then_some("position");
        let fine = manifest.fine.filter(|fine| fine.group == index);
        let fine = fine.map_or(&[][..], Fine::columns).iter().copied();
        let names =
            position.into_iter().chain(fine).chain(manifest.columns_of(index).map(|a| &*a.name));
        let columns = names.zip(&group.columns).map(|(name, &bytes)| ColumnDescription {
            name: name.to_owned(),
            bytes,
            bytes_per_point: per_point(bytes, manifest),
        });
        GroupDescription {
            name: group.name.clone(),
            columns: columns.collect(),
            bytes: group.bytes(),
            bytes_per_point: per_point(group.bytes(), manifest),
        }
    };
    manifest.groups.iter().enumerate().map(describe).collect()
}

fn stored(attribute: &Attribute, manifest: &Manifest) -> Option<AttributeDescription> {
    let group = manifest.groups.get(attribute.group()?)?;
    Some(AttributeDescription {
        name: attribute.name.clone(),
        scalar: attribute.scalar,
        components: attribute.components,
        group: group.name.clone(),
        min: attribute.min.clone(),
        max: attribute.max.clone(),
    })
}

fn constant(attribute: &Attribute) -> Option<ConstantDescription> {
    let bytes = attribute.constant()?;
    let values = bytes.chunks_exact(attribute.scalar.size_bytes());
    Some(ConstantDescription {
        name: attribute.name.clone(),
        scalar: attribute.scalar,
        value: values.map(|value| attribute.scalar.to_f64(value)).collect(),
    })
}

fn levels(nodes: &[Node], manifest: &Manifest) -> Vec<LevelDescription> {
    let empty = |level| LevelDescription {
        level,
        nodes: 0,
        points: 0,
        bytes: 0,
        spacing: manifest.spacing_world(level),
    };
    let mut levels: Vec<_> = (0..manifest.levels).map(empty).collect();
    for node in nodes {
        if let Some(level) = levels.get_mut(usize::from(node.key.level())) {
            level.nodes += 1;
            level.points += u64::from(node.points);
            level.bytes += node.payloads.iter().map(|p| u64::from(p.bytes)).sum::<u64>();
        }
    }
    levels
}
