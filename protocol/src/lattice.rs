//! The integer lattice that every coordinate lives on.
//!
//! `world = offset + scale * (origin + q)`. `scale` and `offset` are those of the source where it
//! has them and uses all its steps, so that a point's world coordinate comes out bit-identical to
//! the source's own arithmetic; `origin` (an integer) moves the root cube to the cloud. The root cube's side is
//! `2^side_bits` lattice units: cubes, octants and Morton codes are shifts and masks.

use serde::{Deserialize, Serialize};

use crate::key::NodeKey;

/// Most bits of a lattice coordinate inside the root cube, and so the most levels below the root.
pub const MAX_SIDE_BITS: u8 = 32;

/// The lattice of a dataset. World units are the source's (metres, feet, degrees, …).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Lattice {
    /// World units per lattice unit, the same on all axes; finite and positive.
    pub scale: f64,
    /// World coordinate of lattice coordinate zero.
    pub offset: [f64; 3],
    /// Lattice coordinate of the root cube's lowest corner.
    pub origin: [i64; 3],
    /// The root cube's side is `2^side_bits` lattice units; at most [`MAX_SIDE_BITS`].
    pub side_bits: u8,
}

impl Lattice {
    /// World coordinates of a point given relative to the root cube's lowest corner.
    #[must_use]
    pub fn world(&self, q: [u32; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            // The sum is exact in i64; one rounding to f64, one multiplication, one addition: the
            // arithmetic of LAS readers, hence the same bits.
            let steps = self.origin[a].saturating_add(i64::from(q[a]));
            steps as f64 * self.scale + self.offset[a]
        })
    }

    /// World coordinates of a (possibly fractional) position relative to the root cube's corner.
    #[must_use]
    pub fn world_f64(&self, q: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| (self.origin[a] as f64 + q[a]) * self.scale + self.offset[a])
    }

    /// Bits of a coordinate relative to a node of `level`; the node's side is two to this power.
    #[must_use]
    pub const fn node_bits(&self, level: u8) -> u8 {
        self.side_bits.saturating_sub(level)
    }

    /// Lowest corner of a node's cube, in lattice units relative to the root cube's corner.
    #[must_use]
    pub fn node_min(&self, key: NodeKey) -> [u32; 3] {
        let bits = u32::from(self.node_bits(key.level()));
        key.coords().map(|c| (u64::from(c) << bits) as u32)
    }

    /// Side of a node's cube in world units.
    #[must_use]
    pub fn node_side_world(&self, level: u8) -> f64 {
        self.scale * (f64::from(self.side_bits) - f64::from(level)).exp2()
    }

    /// Whether the numbers can be used: finite scale above zero, finite offsets, bits in range.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.scale.is_finite()
            && self.scale > 0.0
            && self.offset.iter().all(|o| o.is_finite())
            && self.side_bits <= MAX_SIDE_BITS
            && self.origin.iter().all(|o| o.unsigned_abs() < 1 << 62)
    }
}

/// An axis-aligned box in lattice units relative to the root cube's corner, both corners inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct LatticeBox {
    /// Lowest coordinates.
    pub min: [u32; 3],
    /// Highest coordinates (inclusive).
    pub max: [u32; 3],
}

impl LatticeBox {
    /// A box that holds nothing: growing it by a point gives the point.
    pub const EMPTY: Self = Self { min: [u32::MAX; 3], max: [0; 3] };

    /// Grows the box to hold `q`.
    pub fn grow(&mut self, q: [u32; 3]) {
        self.min = std::array::from_fn(|a| self.min[a].min(q[a]));
        self.max = std::array::from_fn(|a| self.max[a].max(q[a]));
    }

    /// Grows the box to hold all that `other` holds.
    pub fn merge(&mut self, other: &Self) {
        self.min = std::array::from_fn(|a| self.min[a].min(other.min[a]));
        self.max = std::array::from_fn(|a| self.max[a].max(other.max[a]));
    }

    /// Whether `q` is inside.
    #[must_use]
    pub fn contains(&self, q: [u32; 3]) -> bool {
        (0..3).all(|a| self.min[a] <= q[a] && q[a] <= self.max[a])
    }
}
