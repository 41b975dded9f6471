//! How large the splats of a node are, in world units.

use crate::render::{
    settings::{CLOSED_SURFACE, SplatSize},
    surface::NodeSurface,
    tree::VisibleTree,
};

/// Diameters of the splats of one node, world units. WGSL twins: `shaders/size_*.wgsl`.
#[derive(Debug, Clone, Copy)]
pub(crate) enum NodeSize<'a> {
    /// The same for all points; 0 where sizes are in pixels.
    Same(f64),
    /// By the detail that is drawn where the point is.
    Adaptive {
        /// Times the spacing.
        factor: f64,
        /// Of the picture.
        tree: &'a VisibleTree,
        /// Of the node, in the tree.
        place: u32,
        /// Of the node's side.
        bits: u8,
    },
    /// What the points say.
    Own(NodeSurface<'a>),
}

impl<'a> NodeSize<'a> {
    /// The sizes in a node of `spacing` world units that is at `place` in the tree and whose side
    /// is `bits` bits.
    pub fn of(
        size: SplatSize,
        spacing: f32,
        tree: &'a VisibleTree,
        place: u32,
        bits: u8,
        surface: &NodeSurface<'a>,
    ) -> Self {
        match size {
            SplatSize::Pixels(_) => Self::Same(0.0),
            SplatSize::World(size) => Self::Same(size),
            SplatSize::Level(factor) => Self::Same(factor * f64::from(spacing)),
            SplatSize::Own if surface.has_own_radii() => Self::Own(*surface),
            SplatSize::Own => Self::Adaptive { factor: CLOSED_SURFACE, tree, place, bits },
            SplatSize::Adaptive(factor) => Self::Adaptive { factor, tree, place, bits },
        }
    }

    /// The diameter of point `index`, which lies at `q` in the node. (Radner 2018, eq. 5.2: the
    /// spacing halves from level to level)
    pub fn world(&self, index: usize, q: [u32; 3]) -> f64 {
        match *self {
            Self::Same(size) => size,
            Self::Adaptive { factor, tree, place, bits } => {
                factor * f64::from(tree.spacing(place, bits, q))
            }
            Self::Own(surface) => 2.0 * surface.own_radius(index).unwrap_or(0.0),
        }
    }
}
