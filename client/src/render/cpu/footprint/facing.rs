//! Footprints that face the picture: the dot, the square, and what has a circle's outline.

use super::{Footprint, Fragment, Grid, Spot, closed_span, span};

/// The pixel that holds the centre.
pub(in super::super) struct Dot;

impl Footprint for Dot {
    const SIZED: bool = false;

    #[inline]
    fn cover(&self, spot: &Spot, grid: Grid, mut take: impl FnMut(Fragment)) {
        let [column, row] = spot.center_pixel();
        if column < grid.width && row < grid.height {
            let pixel = row * grid.width + column;
            let (distance, radius) = (spot.at.distance, spot.radius());
            take(Fragment { pixel, distance, r_squared: 0.0, radius });
        }
    }
}

/// The pixels whose middle m satisfies `center - size / 2 < m <= center + size / 2`.
pub(in super::super) struct Square;

impl Footprint for Square {
    #[inline]
    fn cover(&self, spot: &Spot, grid: Grid, mut take: impl FnMut(Fragment)) {
        let Spot { at, radius_px, .. } = *spot;
        let columns = span(at.x - radius_px, at.x + radius_px, grid.width);
        let (distance, radius) = (at.distance, spot.radius());
        for row in span(at.y - radius_px, at.y + radius_px, grid.height) {
            for column in columns.clone() {
                let pixel = row * grid.width + column;
                take(Fragment { pixel, distance, r_squared: 0.0, radius });
            }
        }
    }
}

/// How the parts of a splat with a circle's outline lie behind its centre.
pub(in super::super) trait Profile {
    /// Whether they do not.
    const FLAT: bool = false;

    /// How far, in radii.
    fn behind(&self, r_squared: f64) -> f64;
}

/// Nothing is behind.
pub(in super::super) struct Flat;

impl Profile for Flat {
    const FLAT: bool = true;

    #[inline]
    fn behind(&self, _: f64) -> f64 {
        0.0
    }
}

/// The pixels whose middle is at most half the size from the centre, and the one that holds it.
pub(in super::super) struct Facing<P>(pub P);

impl<P: Profile> Footprint for Facing<P> {
    #[inline]
    fn cover(&self, spot: &Spot, grid: Grid, mut take: impl FnMut(Fragment)) {
        let Spot { at, radius_px, .. } = *spot;
        let columns = closed_span(at.x - radius_px, at.x + radius_px, grid.width);
        let [center_column, center_row] = spot.center_pixel();
        let (radius, square) = (spot.radius(), radius_px * radius_px);
        let per_square = 1.0 / square;
        // Every pixel is tested: spans per row take a square root each and cost a third more, for
        // circles of 2 pixels and of 5.
        for row in closed_span(at.y - radius_px, at.y + radius_px, grid.height) {
            let dy = row as f64 + 0.5 - at.y;
            for column in columns.clone() {
                let dx = column as f64 + 0.5 - at.x;
                let from_center = dx * dx + dy * dy;
                if from_center <= square || (column == center_column && row == center_row) {
                    let r_squared = (from_center * per_square).min(1.0);
                    let behind = if P::FLAT { 0.0 } else { self.0.behind(r_squared) * radius };
                    let pixel = row * grid.width + column;
                    take(Fragment { pixel, distance: at.distance + behind, r_squared, radius });
                }
            }
        }
    }
}
