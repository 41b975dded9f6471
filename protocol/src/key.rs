//! Node keys: the address of a cube in the octree.

use crate::lattice::MAX_SIDE_BITS;

/// A cube of the octree: `level` halvings of the root cube's side, then integer cube coordinates
/// in `0 .. 2^level` per axis. Orders by level, then by Morton order of the coordinates' tuple is
/// *not* implied: the derived order is (level, x, y, z).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeKey {
    level: u8,
    x: u32,
    y: u32,
    z: u32,
}

impl NodeKey {
    /// The whole cube.
    pub const ROOT: Self = Self { level: 0, x: 0, y: 0, z: 0 };

    /// A key, or `None` where the level is beyond [`MAX_SIDE_BITS`] or a coordinate is not below
    /// `2^level`.
    #[must_use]
    pub fn new(level: u8, [x, y, z]: [u32; 3]) -> Option<Self> {
        let fits = |c: u32| u64::from(c) < 1u64 << level;
        (level <= MAX_SIDE_BITS && fits(x) && fits(y) && fits(z)).then_some(Self { level, x, y, z })
    }

    /// Halvings of the root cube's side.
    #[must_use]
    pub const fn level(self) -> u8 {
        self.level
    }

    /// Cube coordinates at this level.
    #[must_use]
    pub const fn coords(self) -> [u32; 3] {
        [self.x, self.y, self.z]
    }

    /// The child in octant `octant` (bit 0: x, bit 1: y, bit 2: z); `None` below the finest level.
    #[must_use]
    pub fn child(self, octant: u8) -> Option<Self> {
        let bit = |b: u8| u32::from(octant >> b & 1);
        if octant > 7 || self.level >= MAX_SIDE_BITS {
            return None;
        }
        Some(Self {
            level: self.level + 1,
            x: self.x << 1 | bit(0),
            y: self.y << 1 | bit(1),
            z: self.z << 1 | bit(2),
        })
    }

    /// The cube this one is an octant of; `None` for the root.
    #[must_use]
    pub fn parent(self) -> Option<Self> {
        (self.level > 0).then(|| Self {
            level: self.level - 1,
            x: self.x >> 1,
            y: self.y >> 1,
            z: self.z >> 1,
        })
    }

    /// Which octant of its parent this is (0 for the root).
    #[must_use]
    pub const fn octant(self) -> u8 {
        ((self.x & 1) | (self.y & 1) << 1 | (self.z & 1) << 2) as u8
    }

    /// The ancestor at `level`; `None` where `level` is finer than this key's.
    #[must_use]
    pub fn ancestor(self, level: u8) -> Option<Self> {
        let up = self.level.checked_sub(level)?;
        let shift = |c: u32| c.checked_shr(u32::from(up)).unwrap_or(0);
        Some(Self { level, x: shift(self.x), y: shift(self.y), z: shift(self.z) })
    }
}

impl std::fmt::Display for NodeKey {
    /// `level/x/y/z`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}/{}/{}", self.level, self.x, self.y, self.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parent_undoes_child(level in 0u8..31, c in any::<[u32; 3]>(), octant in 0u8..8) {
            let mask = ((1u64 << level) - 1) as u32;
            let key = NodeKey::new(level, c.map(|v| v & mask)).expect("masked");
            let child = key.child(octant).expect("above the finest level");
            prop_assert_eq!(child.parent(), Some(key));
            prop_assert_eq!(child.octant(), octant);
            prop_assert_eq!(child.ancestor(0), Some(NodeKey::ROOT));
        }
    }

    #[test]
    fn coordinates_beyond_the_level_are_no_key() {
        assert_eq!(NodeKey::new(2, [4, 0, 0]), None);
        assert_eq!(NodeKey::new(MAX_SIDE_BITS + 1, [0, 0, 0]), None);
        assert_eq!(NodeKey::new(MAX_SIDE_BITS, [u32::MAX; 3]).and_then(|k| k.child(0)), None);
    }
}
