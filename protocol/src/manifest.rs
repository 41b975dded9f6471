//! The manifest: what a dataset is, as JSON in the boot block.

use serde::{Deserialize, Serialize};

use crate::{
    attribute::{Attribute, Domain},
    color::is_partable_color,
    error::{Result, corrupt},
    hierarchy::BOUNDS_BITS,
    lattice::{Lattice, LatticeBox},
    position::MAX_CELL_AXIS_BITS,
};

/// How a child relates to its parent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Refinement {
    /// Children add to the parent: draw both (subsampling).
    Additive,
    /// Children stand in for the parent: draw either (clusters, surfels, averages, rectangles).
    Replace,
}

/// What a node's elements are. The attributes each kind needs are checked on reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Primitive {
    /// A position.
    Point,
    /// A position, `normal` and `radius` (world units).
    Disc,
    /// A position and the half axes `axis_u`, `axis_v` (world units, perpendicular).
    Ellipse,
    /// A centre, half sides `axis_u`, `axis_v`, `texture_size` (columns, rows) and texels:
    /// `texel_color` (red, green, blue, alpha), optionally `texel_height` (offset along
    /// `axis_u × axis_v`, in lattice units).
    Rectangle,
}

impl Primitive {
    /// Names and component counts of the attributes that the primitive cannot do without.
    #[must_use]
    pub const fn required_attributes(self) -> &'static [(&'static str, u8)] {
        match self {
            Self::Point => &[],
            Self::Disc => &[("normal", 3), ("radius", 1)],
            Self::Ellipse => &[("axis_u", 3), ("axis_v", 3)],
            Self::Rectangle => {
                &[("axis_u", 3), ("axis_v", 3), ("texture_size", 2), ("texel_color", 4)]
            }
        }
    }
}

/// How the levels of detail were made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Method {
    /// `poisson`, …
    pub name: String,
    /// Grid cells per node side; the minimum distance at a level is the node's side over this.
    pub grid: u32,
    /// A node with at most this many points is not split.
    pub leaf_capacity: u32,
}

/// A column group: columns that are fetched together.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct GroupInfo {
    /// `base` for group 0, which holds the positions; others by content.
    pub name: String,
    /// Bytes of each column over all nodes, in column order; group 0 begins with the positions'.
    pub columns: Vec<u64>,
}

impl GroupInfo {
    /// Bytes of the group over all nodes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.columns.iter().fold(0, |sum, &bytes| sum.saturating_add(bytes))
    }
}

/// Positions, and colours, in two parts: cells and coarse colours in group 0, the rest in a group of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Fine {
    /// The group that says where in their cells the points lie, and what coarse colours lack. It has no
    /// other columns.
    pub group: usize,
    /// Whether `color` is in two parts, too.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub color: bool,
    /// The side of a node's cells is the largest power of two of lattice units that is at most its
    /// spacing over this.
    pub cells_per_spacing: u32,
}

impl Fine {
    /// What the group's columns are, in order.
    #[must_use]
    pub fn columns(self) -> &'static [&'static str] {
        if self.color { &["position, fine", "color, fine"] } else { &["position, fine"] }
    }
}

/// One input the dataset was made from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SourceInfo {
    /// File name without directories, or the specification of a simulated scan.
    pub name: String,
    /// Points taken from it.
    pub points: u64,
}

/// What a dataset is. Unknown fields are ignored by readers of the same major version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Program and version that wrote the file.
    pub generator: String,
    /// Elements (points, discs, …) over all nodes.
    pub points: u64,
    /// Nodes in the tree.
    pub nodes: u64,
    /// Levels in the tree: one more than the deepest node's level; 0 for an empty dataset.
    pub levels: u8,
    /// How a child relates to its parent.
    pub refinement: Refinement,
    /// What the elements are.
    pub primitive: Primitive,
    /// How the levels were made.
    pub method: Method,
    /// The integer lattice of all coordinates.
    pub lattice: Lattice,
    /// Tight bounds of all points; min above max where there are none.
    pub bounds: LatticeBox,
    /// Largest distance on any axis between a source coordinate and its lattice point, world units.
    pub largest_rounding: f64,
    /// Attributes, in column order.
    pub attributes: Vec<Attribute>,
    /// Column groups; group 0 always exists and starts with the position column.
    pub groups: Vec<GroupInfo>,
    /// Where positions and colours are stored in two parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fine: Option<Fine>,
    /// Coordinate reference system as the source gives it (WKT), if it does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crs: Option<String>,
    /// Inputs, in build order.
    pub sources: Vec<SourceInfo>,
}

impl Manifest {
    /// Of a dataset without points and attributes, on a lattice of world units.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            generator: String::new(),
            points: 0,
            nodes: 0,
            levels: 0,
            refinement: Refinement::Additive,
            primitive: Primitive::Point,
            method: Method { name: String::new(), grid: 1, leaf_capacity: 0 },
            lattice: Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 1 },
            bounds: LatticeBox::EMPTY,
            largest_rounding: 0.0,
            attributes: Vec::new(),
            groups: vec![GroupInfo { name: "base".into(), columns: vec![0] }],
            fine: None,
            crs: None,
            sources: Vec::new(),
        }
    }

    /// Parses and checks a manifest.
    ///
    /// # Errors
    /// [`Error::Corrupt`](crate::Error::Corrupt) where the JSON or its numbers cannot be a manifest.
    pub fn parse(json: &[u8]) -> Result<Self> {
        let manifest: Self =
            serde_json::from_slice(json).map_err(|e| corrupt("manifest", e.to_string()))?;
        manifest.check()?;
        Ok(manifest)
    }

    /// The manifest as compact JSON.
    ///
    /// # Errors
    /// [`Error::Corrupt`](crate::Error::Corrupt) where a number is not finite.
    pub fn to_json(&self) -> Result<Vec<u8>> {
        self.check()?;
        serde_json::to_vec(self).map_err(|e| corrupt("manifest", e.to_string()))
    }

    fn check(&self) -> Result<()> {
        let bad = |why: String| -> Result<()> { Err(corrupt("manifest", why)) };
        if !self.lattice.is_valid() {
            return bad(format!("unusable lattice {:?}", self.lattice));
        }
        if self.groups.is_empty() || self.groups.len() > 64 {
            return bad(format!("{} column groups (1 to 64 allowed)", self.groups.len()));
        }
        if self.attributes.len() > 4096 {
            return bad(format!("{} attributes (at most 4096 allowed)", self.attributes.len()));
        }
        if !self.largest_rounding.is_finite() {
            return bad("largest_rounding is not finite".into());
        }
        for (i, attribute) in self.attributes.iter().enumerate() {
            let name = &attribute.name;
            if name.is_empty() || name == "position" {
                return bad(format!("attribute name {name:?} is not allowed"));
            }
            if self.attributes[..i].iter().any(|other| other.name == *name) {
                return bad(format!("attribute {name} appears twice"));
            }
            if !(1..=64).contains(&attribute.components) {
                return bad(format!("attribute {name} has {} components", attribute.components));
            }
            match attribute.group() {
                Some(group) if group >= self.groups.len() => {
                    return bad(format!(
                        "attribute {name} is in group {group}, which is not there"
                    ));
                }
                None if attribute.constant().is_none() => {
                    return bad(format!("attribute {name} has a malformed constant"));
                }
                _ => {}
            }
            if attribute.domain == Domain::Texel {
                // The number of texels must be known before texels are decoded.
                let sizes = self.attributes[..i].iter().find(|a| a.name == "texture_size");
                if sizes.is_none_or(|sizes| sizes.group() != attribute.group()) {
                    return bad(format!(
                        "texels of {name} must follow texture_size in the same column group"
                    ));
                }
            }
        }
        for (index, group) in self.groups.iter().enumerate() {
            let fine = self.fine.filter(|fine| fine.group == index);
            let attributes = self.columns_of(index).count();
            if fine.is_some() && attributes > 0 {
                return bad(format!("group {} of fine positions has attributes", group.name));
            }
            let fine = fine.map_or(0, |fine| fine.columns().len());
            let columns = usize::from(index == 0) + fine + attributes;
            if group.columns.len() != columns {
                return bad(format!(
                    "group {} tells the bytes of {} columns, it has {columns}",
                    group.name,
                    group.columns.len()
                ));
            }
        }
        if let Some(fine) = self.fine
            && fine.color
            && self.fine_color().is_none()
        {
            return bad("fine colours of what is no colour in group 0".into());
        }
        if let Some(Fine { group, cells_per_spacing, .. }) = self.fine
            && (group == 0 || group >= self.groups.len() || cells_per_spacing == 0)
        {
            let why = format!("group {group}, {cells_per_spacing} cells a spacing");
            return bad(format!("fine positions in {why}, which cannot be"));
        }
        for &(name, components) in self.primitive.required_attributes() {
            if self.attribute(name).is_none_or(|a| a.components != components) {
                return bad(format!(
                    "{:?} primitives need attribute {name} with {components} components",
                    self.primitive
                ));
            }
        }
        Ok(())
    }

    /// The attribute of that name.
    #[must_use]
    pub fn attribute(&self, name: &str) -> Option<&Attribute> {
        self.attributes.iter().find(|a| a.name == name)
    }

    /// Index of the colours that are stored in two parts.
    #[must_use]
    pub fn fine_color(&self) -> Option<usize> {
        self.fine.filter(|fine| fine.color)?;
        self.attributes.iter().position(is_partable_color)
    }

    /// Attributes stored as columns of `group`, in column order.
    pub fn columns_of(&self, group: usize) -> impl Iterator<Item = &Attribute> {
        self.attributes.iter().filter(move |a| a.group() == Some(group))
    }

    /// Distance in world units that points of a sampled node of `level` keep from one another.
    #[must_use]
    pub fn spacing_world(&self, level: u8) -> f64 {
        self.lattice.node_side_world(level) / f64::from(self.method.grid.max(1))
    }

    /// log2 of the side, in lattice units, of the cells that group 0 tells the positions of a node to;
    /// 0 where it tells them to the last bit.
    #[must_use]
    pub fn cell_bits(&self, level: u8, spacing_world: f32) -> u8 {
        let Some(fine) = self.fine else { return 0 };
        let bits = self.lattice.node_bits(level);
        let side =
            f64::from(spacing_world) / self.lattice.scale / f64::from(fine.cells_per_spacing);
        // The exponent is the whole part of the logarithm.
        let log2 = if side >= 1.0 { (side.to_bits() >> 52) as i64 - 1023 } else { 0 };
        // No cell is larger than a slice of the node's bounds, so that these hold for cells' centres.
        let most = bits.saturating_sub(BOUNDS_BITS);
        let least = bits.saturating_sub(MAX_CELL_AXIS_BITS);
        u8::try_from(log2).unwrap_or(u8::MAX).min(most).max(least)
    }

    /// Tight bounds in world units (lowest, highest corner); `None` where there are no points.
    #[must_use]
    pub fn bounds_world(&self) -> Option<([f64; 3], [f64; 3])> {
        (self.points > 0)
            .then(|| (self.lattice.world(self.bounds.min), self.lattice.world(self.bounds.max)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attribute::{ScalarType, Storage};

    fn manifest() -> Manifest {
        Manifest {
            method: Method { name: String::new(), grid: 128, leaf_capacity: 1 },
            lattice: Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 8 },
            attributes: vec![Attribute {
                name: "intensity".into(),
                scalar: ScalarType::U16,
                components: 1,
                domain: Domain::Element,
                storage: Storage::Column { group: 1 },
                min: vec![],
                max: vec![],
            }],
            groups: vec![
                GroupInfo { name: "base".into(), columns: vec![7] },
                GroupInfo { name: "more".into(), columns: vec![8] },
            ],
            ..Manifest::empty()
        }
    }

    #[test]
    fn every_column_tells_its_bytes() {
        assert!(manifest().to_json().is_ok());
        for (group, columns) in [(0, vec![]), (0, vec![7, 7]), (1, vec![]), (1, vec![8, 8])] {
            let mut manifest = manifest();
            manifest.groups[group].columns = columns;
            let error = manifest.to_json().expect_err("refused").to_string();
            assert!(error.contains("tells the bytes of"), "{error}");
        }
    }

    #[test]
    fn colours_in_two_parts_are_colours_of_group_0() {
        let with = |name: &str, scalar, group| {
            let mut manifest = manifest();
            let attribute = &mut manifest.attributes[0];
            (attribute.name, attribute.scalar, attribute.components) = (name.into(), scalar, 3);
            attribute.storage = Storage::Column { group };
            manifest.groups[0].columns = vec![7; 2 - group];
            manifest.groups[1] = GroupInfo { name: "fine".into(), columns: vec![8, 9] };
            manifest.fine = Some(Fine { group: 1, color: true, cells_per_spacing: 8 });
            manifest.to_json()
        };
        assert!(
            with("color", ScalarType::U16, 0).is_ok() && with("color", ScalarType::U8, 0).is_ok()
        );
        for (name, scalar, group) in [
            ("colour", ScalarType::U16, 0),
            ("color", ScalarType::F32, 0),
            ("color", ScalarType::U16, 1),
        ] {
            let error = with(name, scalar, group).expect_err("refused").to_string();
            assert!(error.contains("fine"), "{error}");
        }
        let mut manifest = manifest();
        manifest.groups[1].columns = vec![8, 9];
        assert!(manifest.to_json().is_err(), "two columns of one attribute");
    }

    #[test]
    fn the_bytes_of_a_group_do_not_overflow() {
        let group = GroupInfo { name: "base".into(), columns: vec![u64::MAX, 1] };
        assert_eq!(group.bytes(), u64::MAX);
    }
}
