//! What a node is worth: the order in which nodes are wanted, and in which they are loaded.

use super::view::{Optics, WorldBox};

/// Errors far below this many pixels are not seen any more.
const SEEN_PX: f64 = 2.0;

/// What a node costs besides its bytes: its part of the gaps that are fetched in vain and of the
/// requests. (Without, leaves of few points come too early: overviews lose 2 % of the area below.)
const COST_BYTES: f64 = 10_000.0;

/// Largest error in pixels that is told from others: it is that of what lies around the eye.
const LARGEST_PX: f64 = 1e9;

/// How much more urgent the middle is. Without, or with Fraiss's own 1, the nodes of the edge come before
/// those of the same size in the middle (partial rank correlations of -0.2 on a courtyard of 1 M points from two
/// places; 3: 0.05, 4: 0.1). What it costs where the whole cloud is in the picture: SSIM 0.95 on autzen's medium view
/// at 20 Mbit/s and 40 ms after 0.85 s with 0 to 3, 0.95 s with 4.
const MIDDLE: i32 = 3;

/// Which nodes come first.
///
/// Measured with everything else the same (960 x 540, a million points, 20 Mbit/s and 40 ms, from a
/// cold start), [`ErrorPerByte`](Self::ErrorPerByte) against [`Fraiss`](Self::Fraiss): the area between SSIM and 1
/// over time until that has settled, as a part of its, and what SSIM the complete picture gains.
///
/// | scene | view | area | SSIM |
/// | --- | --- | --- | --- |
/// | airborne, colours, 10.7 M points | medium | 0.98 | +0.006 |
/// | | near | 0.98 | +0.012 |
/// | terrestrial, colours, 9 M points | medium | 0.99 | +0.001 |
/// | | near | 0.97 | +0.036 |
/// | one object, no colours | medium | 0.99 | 0 |
/// | | near | 0.99 | 0 |
/// | simulated courtyard, 4 M points | medium | 1.00 | 0 |
/// | | near | 0.94 | +0.022 |
/// | | gate | 0.94 | +0.021 |
/// | | courtyard | 0.97 | +0.031 |
/// | | door | 0.91 | +0.067 |
/// | indoors | hall | 1.01 | 0 |
/// | | living room | 1.00 | 0 |
///
/// Where the budget does not bind, the same nodes come in another order, and 1 % is all there is to gain;
/// where it does, they are better ones. Without the weight of what is near, indoor views lose 5 %;
/// Fraiss's weight of the middle changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Priority {
    /// Those that take away most error for their bytes: pixels of the picture that the node's
    /// bounds take up, times how often the error there is halved, over the bytes to load; and the more
    /// the nearer, because what is near is less likely to lie behind something.
    #[default]
    ErrorPerByte,
    /// The largest, and those in the middle of the picture. (Fraiss 2017, eqs. 3.2-3.4)
    Fraiss,
    /// The largest, and first of all those around the eye, as Potree has it. (With all else ours, on the airborne
    /// scan by the same link: medium as soon at SSIM 0.95, area 1.00; near 1.15, and it ends at 0.812 for 0.872.)
    Size,
}

/// What a node is about to change.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    /// World units by which the picture is off without the node.
    pub error_before: f64,
    /// The same with it.
    pub error_after: f64,
    /// Bytes of its wanted groups.
    pub bytes: u64,
}

impl Priority {
    /// How early a node of that priority is loaded: people look at the middle, and boxes at the edge take up
    /// more pixels. Which nodes are drawn in the end does not hang on it.
    pub(super) fn urgency(self, optics: &Optics, bounds: &WorldBox, priority: f64) -> f64 {
        match self {
            Self::ErrorPerByte => {
                let middle = optics.priority(bounds.center, 1.0); // Fraiss 2017, eq. 3.4
                priority * middle.powi(MIDDLE)
            }
            Self::Fraiss | Self::Size => priority,
        }
    }

    /// What a node with these bounds is worth; not NaN, not negative.
    pub(super) fn of(self, optics: &Optics, bounds: &WorldBox, change: Change) -> f64 {
        match self {
            Self::ErrorPerByte => {
                let scale = optics.largest_scale(bounds);
                let seen = |error: f64| (error * scale).min(LARGEST_PX) + SEEN_PX;
                let halvings = (seen(change.error_before) / seen(change.error_after)).log2();
                let gain = optics.area(bounds) * halvings.max(0.0) * scale;
                (gain / (change.bytes as f64 + COST_BYTES)).max(0.0)
            }
            Self::Fraiss => {
                let size = optics.projected_size(bounds.center, bounds.radius());
                optics.priority(bounds.center, size)
            }
            Self::Size => optics.projected_size(bounds.center, bounds.radius()),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::{
        camera::{Camera, Projection},
        engine::view::View,
    };

    const CHANGE: Change = Change { error_before: 0.5, error_after: 0.25, bytes: 10_000 };

    fn optics() -> Optics {
        let projection = Projection::Perspective { fov_y: 1.0 };
        let camera = Camera { eye: DVec3::ZERO, target: DVec3::Y, up: DVec3::Z, projection };
        Optics::new(&View { camera, size_px: [640, 480] })
    }

    fn worth(center: [f64; 3], change: Change) -> f64 {
        let bounds = WorldBox { center: center.into(), half: DVec3::ONE };
        Priority::ErrorPerByte.of(&optics(), &bounds, change)
    }

    #[test]
    fn what_takes_away_more_error_for_its_bytes_comes_first() {
        let ahead = [0.0, 20.0, 0.0];
        let usual = worth(ahead, CHANGE);
        assert!(usual > 0.0);
        assert!(worth(ahead, Change { bytes: 20_000, ..CHANGE }) < usual);
        assert!(worth(ahead, Change { error_before: 1.0, ..CHANGE }) > usual);
        assert!(worth([0.0, 40.0, 0.0], CHANGE) < usual, "farther away");
        assert!(worth([15.0, 20.0, 0.0], CHANGE) < usual, "a part of it is in the picture");
        assert_eq!(worth(ahead, Change { error_after: 0.5, ..CHANGE }), 0.0, "changes nothing");
    }

    proptest! {
        #[test]
        fn no_node_is_worth_something_that_is_no_number(
            center in prop::array::uniform3(any::<f64>()), half in prop::array::uniform3(any::<f64>()),
            error_before in any::<f64>(), error_after in any::<f64>(), bytes in any::<u64>(),
        ) {
            let bounds = WorldBox { center: center.into(), half: half.into() };
            let change = Change { error_before, error_after, bytes };
            for priority in [Priority::ErrorPerByte, Priority::Fraiss, Priority::Size] {
                prop_assert!(priority.of(&optics(), &bounds, change) >= 0.0);
            }
        }
    }
}
