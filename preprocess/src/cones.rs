//! The normal cone of every node, where the points have normals.
//!
//! A node's axis is the middle of the box around the unit normals of its points and of all below:
//! unlike their mean it does not lean to where most points happen to be, and boxes merge exactly.
//! Inside a chunk the angle is measured over all normals; above, where only the chunks' cones are at
//! hand, over these.

use lodestream_protocol::{NormalCone, ScalarType};

use crate::tree::Tree;

/// Where a point's normal is in its row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NormalColumn {
    /// First byte in the row.
    pub offset: usize,
    /// Type of each of the three components.
    pub scalar: ScalarType,
}

impl NormalColumn {
    /// The direction of the normal in `row`, as [`NormalCone::unit`] gives it.
    pub fn unit(self, row: &[u8]) -> [f32; 3] {
        let size = self.scalar.size_bytes();
        let component = |a: usize| self.scalar.to_f64(&row[self.offset + a * size..]);
        NormalCone::unit(std::array::from_fn(component))
    }
}

/// What is known of the normals of a node and of all below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normals {
    /// Box around the unit normals.
    min: [f32; 3],
    max: [f32; 3],
    /// Holds them all.
    pub cone: NormalCone,
}

impl Normals {
    const NONE: Self =
        Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3], cone: NormalCone::ANY };

    /// Of points.
    fn of_units(units: &[[f32; 3]]) -> Self {
        let mut all = Self::NONE;
        units.iter().for_each(|&unit| all.grow(unit, unit));
        all.cone = NormalCone::of_units(all.axis(), units.iter().copied());
        all
    }

    /// Of all nodes below a node.
    pub fn of_children<'a>(children: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let mut all = Self::NONE;
        children.clone().for_each(|child| all.grow(child.min, child.max));
        all.cone = NormalCone::of_cones(all.axis(), children.map(|child| child.cone));
        all
    }

    fn grow(&mut self, min: [f32; 3], max: [f32; 3]) {
        self.min = std::array::from_fn(|a| self.min[a].min(min[a]));
        self.max = std::array::from_fn(|a| self.max[a].max(max[a]));
    }

    /// Without direction where there are no normals, or opposite ones.
    fn axis(&self) -> [f64; 3] {
        std::array::from_fn(|a| f64::from(self.min[a]) + f64::from(self.max[a]))
    }
}

/// The normals of every node of `tree` over its sorted points, whose directions are `units`.
pub fn of_tree(tree: &Tree, units: &[[f32; 3]]) -> Vec<Vec<Normals>> {
    let levels = tree.levels.iter();
    levels
        .map(|nodes| nodes.iter().map(|node| Normals::of_units(&units[node.range()])).collect())
        .collect()
}
