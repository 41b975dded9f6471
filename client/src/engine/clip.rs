//! A box that the view is limited to.

use glam::DVec3;

use super::view::WorldBox;

/// A box in world units, along the axes. Nodes that lie outside are neither loaded nor drawn; of those
/// that reach in, whoever draws leaves out the points outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClipBox {
    /// Lowest corner.
    pub min: DVec3,
    /// Highest corner.
    pub max: DVec3,
}

impl ClipBox {
    /// Whether a point lies in the box or on its border.
    #[must_use]
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// Whether no part of the bounds can be inside.
    pub(super) fn excludes(&self, bounds: &WorldBox) -> bool {
        let (lowest, highest) = (bounds.center - bounds.half, bounds.center + bounds.half);
        highest.cmplt(self.min).any() || lowest.cmpgt(self.max).any()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn corners() -> impl Strategy<Value = (DVec3, DVec3)> {
        let corner = || prop::array::uniform3(-10.0..10.0).prop_map(DVec3::from_array);
        (corner(), corner()).prop_map(|(a, b)| (a.min(b), a.max(b)))
    }

    proptest! {
        #[test]
        fn what_holds_a_point_inside_is_never_excluded_and_what_is_beside_always(
            (min, max) in corners(), at in prop::array::uniform3(0.0..=1.0), (low, high) in corners(),
        ) {
            let clip = ClipBox { min: low, max: high };
            let excluded = clip.excludes(&WorldBox::from_corners(min, max));
            let point = min + DVec3::from(at) * (max - min);
            prop_assert!(!(excluded && clip.contains(point)));
            let beside = WorldBox::from_corners(min, max.min(low - 0.001));
            prop_assert!(min.cmpgt(low - 0.001).any() || clip.excludes(&beside));
        }
    }
}
