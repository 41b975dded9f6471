//! A set of points of one dataset: what was drawn of it, or all.

use std::sync::{Arc, OnceLock};

use lodestream_protocol::{Lattice, Manifest, NodePoints};

use super::{MetricsError, neighbours::Neighbours};
use crate::render::{ColorMode, Coloring, NodeColor, NodeSurface, Surroundings};

/// Points of a dataset: 12 bytes each, 4 more with colours, 16 more with normals, and 17 once they
/// are compared.
///
/// Coordinates are the lattice's integers relative to the root cube: exact, wherever in the world the
/// cloud is.
#[derive(Debug)]
pub struct PointSet {
    cloud: Arc<Manifest>,
    around: Surroundings,
    has_colors: bool,
    pub(super) places: Vec<[u32; 3]>,
    /// One per point or none at all; `None` where the node's colours have not arrived.
    pub(super) colors: Vec<Option<[u8; 3]>>,
    /// Likewise.
    pub(super) normals: Vec<Option<[f32; 3]>>,
    has_normals: bool,
    neighbours: OnceLock<Neighbours>,
}

impl PointSet {
    /// No points yet.
    #[must_use]
    pub fn new(cloud: &Arc<Manifest>) -> Self {
        let around = Surroundings::of(std::slice::from_ref(cloud), |_| ColorMode::Rgb);
        // Without colours, clouds are painted by something else, which is no error of theirs.
        let painted =
            matches!(around.colorings[..], [Coloring::Rgb { .. } | Coloring::Constant(_)]);
        Self {
            has_colors: painted && cloud.attribute("color").is_some(),
            has_normals: Coloring::of(ColorMode::Normal, cloud) == Coloring::Normal,
            cloud: Arc::clone(cloud),
            around,
            places: Vec::new(),
            colors: Vec::new(),
            normals: Vec::new(),
            neighbours: OnceLock::new(),
        }
    }

    /// Takes the points of a node.
    ///
    /// # Errors
    /// [`MetricsError::TooManyPoints`] beyond 2^32 - 1.
    pub fn add(&mut self, points: &NodePoints) -> Result<(), MetricsError> {
        let count = points.positions.len();
        let all = u32::try_from(self.places.len().saturating_add(count));
        all.map_err(|_| MetricsError::TooManyPoints)?;
        let corner = self.cloud.lattice.node_min(points.key);
        // A node lies inside the root cube, whose coordinates fit; those of a damaged one wrap.
        let place = |q: &[u32; 3]| std::array::from_fn(|a| corner[a].wrapping_add(q[a]));
        self.places.extend(points.positions.iter().map(place));
        let surface = NodeSurface::of_normals(&self.cloud, points);
        if self.has_normals {
            let normal = |index| Some(surface.normal(index)?.as_vec3().to_array());
            self.normals.extend((0..count).map(normal));
        }
        if self.has_colors {
            let lattice = &self.cloud.lattice;
            let colors = NodeColor::of(&self.around, 0, lattice, points, &surface);
            let arrived = match self.around.colorings[0].attribute() {
                Some(attribute) => points.column(attribute).is_some(),
                None => true,
            };
            let color = |index: usize| arrived.then(|| colors.color(index, || 0));
            self.colors.extend((0..count).map(color));
        }
        self.neighbours = OnceLock::new();
        Ok(())
    }

    /// How many points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    pub(super) fn lattice(&self) -> &Lattice {
        &self.cloud.lattice
    }

    /// The tree of the points, built when it is first asked for.
    pub(super) fn neighbours(&self) -> &Neighbours {
        self.neighbours.get_or_init(|| Neighbours::of(&self.places))
    }
}
