//! The paraboloid as triangles. (Fraiss 2017, 3.3.4, fig. 3.10)
//!
//! All splats have the same mesh but for size and place, so that its triangles are made ready once,
//! in units of the radius. A mesh turns onto itself by the angle between two vertices of its first
//! ring: a pixel has to look at the triangles of one such sector only.

use std::f64::consts::TAU;

use super::{Footprint, Fragment, Grid, Spot, closed_span};
use crate::render::view::View;

/// Most rings of a mesh.
const MOST_RINGS: usize = 3;

/// A middle so far (in parts of the triangle's height) outside of an edge is on it: so no pixel falls
/// between two triangles by rounding.
const ON_EDGE: f64 = 1e-9;

/// A mesh is drawn at least so large: a polygon of eight sides then holds every place within 0.7072
/// pixels, and so the middle of the pixel that holds its centre.
const SMALLEST_RADIUS_PX: f64 = 0.766;

/// A triangle in units of the radius, x right, y down.
#[derive(Debug, Clone, Copy)]
struct Triangle {
    /// Barycentric coordinate of each corner: `[0] + [1] * x + [2] * y`.
    weights: [[f64; 3]; 3],
    /// The corners' rings.
    rings: [usize; 3],
}

impl Triangle {
    fn of(corners: [Vertex; 3]) -> Self {
        let [a, b, c] = corners.map(|v| v.place);
        // Twice the signed areas of the triangles between an edge and a place, over the whole.
        let edge = |[x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| [x0 * y1 - x1 * y0, y0 - y1, x1 - x0];
        let weights = [edge(b, c), edge(c, a), edge(a, b)];
        let whole: f64 = weights.iter().map(|w| w[0]).sum();
        Self {
            weights: weights.map(|w| w.map(|term| term / whole)),
            rings: corners.map(|v| v.ring),
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct Vertex {
    place: [f64; 2],
    ring: usize,
}

/// The triangles of all splats of a picture.
#[derive(Debug)]
pub(in super::super) struct Mesh {
    rings: usize,
    /// Sector by sector, beginning to the right and turning downwards.
    sectors: Vec<Vec<Triangle>>,
    depth_bias: f64,
}

impl Mesh {
    /// The mesh of [`rings`](lodestream_shaders::Footprint::rings) of 4 or 8 vertices first, doubled
    /// or not from one to the next.
    pub fn new(rings: &[u32], view: &View) -> Self {
        debug_assert!(rings.len() <= MOST_RINGS);
        let sector_count = rings.first().copied().unwrap_or(0);
        let vertex = |ring: usize, k: u32| {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(rings[ring - 1])).sin_cos();
            let r = ring as f64 / rings.len() as f64;
            Vertex { place: [r * cos, r * sin], ring }
        };
        let tip = Vertex { place: [0.0; 2], ring: 0 };
        let sector = |first: u32| {
            let mut triangles = vec![[tip, vertex(1, first), vertex(1, first + 1)]];
            for (a, pair) in (1..).zip(rings.windows(2)) {
                let (b, per_sector) = (a + 1, pair[0] / sector_count);
                for k in first * per_sector..(first + 1) * per_sector {
                    let (a0, a1) = (vertex(a, k), vertex(a, k + 1));
                    if pair[0] == pair[1] {
                        let (b0, b1) = (vertex(b, k), vertex(b, k + 1));
                        triangles.extend([[a0, b0, b1], [a0, b1, a1]]);
                    } else {
                        let [b0, b1, b2] = [0, 1, 2].map(|step| vertex(b, 2 * k + step));
                        triangles.extend([[a0, b0, b1], [a0, b1, a1], [a1, b1, b2]]);
                    }
                }
            }
            triangles.into_iter().map(Triangle::of).collect()
        };
        let sectors = (0..sector_count).map(sector).collect();
        Self { rings: rings.len(), sectors, depth_bias: view.depth_bias }
    }

    /// Triangles that may hold a place.
    #[inline]
    fn sector(&self, x: f64, y: f64) -> &[Triangle] {
        // Turned by whole quadrants into the first.
        let (quadrant, x, y) = match (x > 0.0, y > 0.0) {
            (true, true) => (0, x, y),
            (false, true) => (1, y, -x),
            (false, false) => (2, -x, -y),
            (true, false) => (3, -y, x),
        };
        let sector =
            if self.sectors.len() == 4 { quadrant } else { 2 * quadrant + usize::from(y > x) };
        self.sectors.get(sector).map_or(&[], Vec::as_slice)
    }

    /// The reversed depth at a place, mixed from those of the rings as rasterisers mix it; `None`
    /// outside of the mesh.
    #[inline]
    fn depth(&self, x: f64, y: f64, ring_depths: &[f64; MOST_RINGS + 1]) -> Option<f64> {
        self.sector(x, y).iter().find_map(|triangle| {
            let weights = triangle.weights.map(|w| w[0] + w[1] * x + w[2] * y);
            weights.iter().all(|weight| *weight >= -ON_EDGE).then(|| {
                let corners = weights.iter().zip(triangle.rings);
                corners.map(|(weight, ring)| weight * ring_depths[ring]).sum()
            })
        })
    }
}

impl Footprint for &Mesh {
    #[inline]
    fn cover(&self, spot: &Spot, grid: Grid, mut take: impl FnMut(Fragment)) {
        let at = spot.at;
        let radius_px = spot.radius_px.max(SMALLEST_RADIUS_PX);
        let columns = closed_span(at.x - radius_px, at.x + radius_px, grid.width);
        let rows = closed_span(at.y - radius_px, at.y + radius_px, grid.height);
        if columns.is_empty() || rows.is_empty() {
            return;
        }
        let [center_column, center_row] = spot.center_pixel();
        let (radius, per_px) = (spot.radius(), 1.0 / radius_px);
        // Not times `near`, as it cancels.
        let ring_depths = std::array::from_fn(|ring| {
            let r = ring as f64 / self.rings as f64;
            1.0 / (at.distance + r * r * radius + self.depth_bias)
        });
        for row in rows {
            let y = (row as f64 + 0.5 - at.y) * per_px;
            for column in columns.clone() {
                let x = (column as f64 + 0.5 - at.x) * per_px;
                let distance = match self.depth(x, y, &ring_depths) {
                    Some(depth) => 1.0 / depth - self.depth_bias,
                    None if column == center_column && row == center_row => at.distance,
                    None => continue,
                };
                let r_squared = (x * x + y * y).min(1.0);
                let pixel = row * grid.width + column;
                take(Fragment { pixel, distance, r_squared, radius });
            }
        }
    }
}
