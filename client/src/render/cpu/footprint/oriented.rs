//! Splats that lie in the surface: discs across the normal, ellipses spanned by half axes.
//!
//! A pixel's ray meets the splat's plane at `centre + a u + b v`; the splat is where
//! `a² + b² <= 1` (Botsch et al. 2005). All is told relative to the centre's own ray, and in units
//! of the splat's radius: so nothing cancels, however far beside the view axis or however small
//! the splat is.
//!
//! In a perspective view with `û, v̂` the half axes in radii, `c` the centre, `e` the pixel's place
//! from the centre's in radii (y up) and `ε` the radius over the centre's distance, the ray through
//! the pixel demands
//!
//! ```text
//! a (û' - e ε û.z) + b (v̂' - e ε v̂.z) = e    with    û' = û.xy - û.z c.xy / c.z
//! ```
//!
//! and in an orthographic one the same with `û' = û.xy` and `ε = 0`.

use glam::{DVec2, DVec3};

use super::{Footprint, Fragment, Grid, Spot, closed_span};
use crate::render::{settings::LARGEST_SPLAT_PX, surface::NodeSurface, view::View};

/// The splats of a node.
pub(in super::super) struct Oriented<'a> {
    view: &'a View,
    surface: &'a NodeSurface<'a>,
    has_axes: bool,
    /// How far from the centre a splat reaches at most, however near the eye it comes.
    farthest_px: f64,
}

impl<'a> Oriented<'a> {
    /// Discs, or ellipses where `has_axes`, of a picture of `samples` by `samples` samples a pixel.
    pub fn new(view: &'a View, surface: &'a NodeSurface<'a>, has_axes: bool, samples: u32) -> Self {
        Self { view, surface, has_axes, farthest_px: LARGEST_SPLAT_PX * f64::from(samples) }
    }

    /// Half axes in view space, the longer one of length 1. They face the picture where a point does
    /// not say how it lies.
    #[inline]
    fn axes(&self, index: usize) -> [DVec3; 2] {
        if self.has_axes
            && let Some(axes) = self.surface.axes(index)
        {
            // First by the largest component: squares of long axes could overflow.
            let largest = axes[0].abs().max(axes[1].abs()).max_element();
            let axes = axes.map(|axis| self.view.direction(axis / largest));
            let longer = axes[0].length().max(axes[1].length());
            return axes.map(|axis| axis / longer);
        }
        match self.surface.normal(index) {
            // Which tangents is all the same.
            Some(normal) => self.view.direction(normal).any_orthonormal_pair().into(),
            None => [DVec3::X, DVec3::Y],
        }
    }
}

/// A splat seen from the eye, by the equations above.
struct Tilted {
    /// û', v̂'.
    across: [DVec2; 2],
    /// ε û.z, ε v̂.z.
    deeper: [f64; 2],
}

impl Tilted {
    /// Least and largest place on an axis of the picture, radii from the centre; the whole axis
    /// where the splat reaches the eye's plane. (Sigg et al. 2006, in the
    /// centre's own frame)
    #[inline]
    fn extent(&self, axis: usize) -> [f64; 2] {
        let [u, v] = self.across.map(|across| across[axis]);
        let [u_deeper, v_deeper] = self.deeper;
        let q = u_deeper * u_deeper + v_deeper * v_deeper - 1.0;
        if q >= 0.0 {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        // The lines e = t that touch the rim: q t² - 2 p t + m = 0.
        let (p, m) = (u * u_deeper + v * v_deeper, u * u + v * v);
        let root = (p * p - q * m).max(0.0).sqrt();
        [(p + root) / q, (p - root) / q]
    }

    /// Where the ray of the pixel at `e` meets the plane: a, b and a² + b², where that is at most 1.
    #[inline]
    fn hit(&self, e: DVec2) -> Option<(f64, f64, f64)> {
        let [u, v] = self.across;
        let [u, v] = [u - e * self.deeper[0], v - e * self.deeper[1]];
        let determinant = u.x * v.y - v.x * u.y;
        // Cramer's rule; the division comes after the test, which most pixels of a slanted splat's
        // rectangle fail.
        let (a, b) = (e.x * v.y - v.x * e.y, u.x * e.y - e.x * u.y);
        if a * a + b * b > determinant * determinant {
            return None;
        }
        let (a, b) = (a / determinant, b / determinant);
        let r_squared = a * a + b * b;
        // False for NaN: seen edge-on, the determinant is 0.
        (r_squared <= 1.0 + 1e-12).then_some((a, b, r_squared.min(1.0)))
    }
}

impl Footprint for Oriented<'_> {
    #[inline]
    fn cover(&self, spot: &Spot, grid: Grid, mut take: impl FnMut(Fragment)) {
        let Spot { place, at, radius_px, .. } = *spot;
        let [u, v] = self.axes(spot.index);
        let radius = spot.radius();
        let tilted = if self.view.perspective {
            let slope = place.truncate() / place.z;
            let radius_of_distance = radius_px / self.view.px_per_world;
            Tilted {
                across: [u, v].map(|axis| axis.truncate() - slope * axis.z),
                deeper: [u, v].map(|axis| radius_of_distance * axis.z),
            }
        } else {
            Tilted { across: [u, v].map(DVec3::truncate), deeper: [0.0; 2] }
        };
        let reach = |least: f64, most: f64| {
            let cap = self.farthest_px;
            // At least the pixel that holds the centre.
            [(least * radius_px).clamp(-cap, -0.5), (most * radius_px).clamp(0.5, cap)]
        };
        let [left, right] = tilted.extent(0);
        let [left, right] = reach(left, right);
        let [lowest, highest] = tilted.extent(1);
        // Rows grow downwards.
        let [upper, lower] = reach(-highest, -lowest);
        let columns = closed_span(at.x + left, at.x + right, grid.width);
        let [center_column, center_row] = spot.center_pixel();
        let per_px = 1.0 / radius_px;
        for row in closed_span(at.y + upper, at.y + lower, grid.height) {
            let y = (at.y - (row as f64 + 0.5)) * per_px;
            for column in columns.clone() {
                let x = (column as f64 + 0.5 - at.x) * per_px;
                let part = tilted.hit(DVec2::new(x, y)).and_then(|(a, b, r_squared)| {
                    let distance = at.distance + radius * (a * u.z + b * v.z);
                    let in_front = distance + self.view.depth_bias >= self.view.near;
                    in_front.then_some((distance, r_squared))
                });
                let holds_center = column == center_column && row == center_row;
                let centre = holds_center.then_some((at.distance, 1.0));
                if let Some((distance, r_squared)) = part.or(centre) {
                    let pixel = row * grid.width + column;
                    take(Fragment { pixel, distance, r_squared, radius });
                }
            }
        }
    }
}
