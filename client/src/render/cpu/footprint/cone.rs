//! Splats whose tip faces the picture: of overlapping ones, that whose centre is nearest to a pixel
//! wins it, which draws the borders of their Voronoi cells. (Fraiss 2017, 3.3.4)

use super::facing::Profile;

/// Parts `r` from the centre lie `r` radii behind it.
pub(in super::super) struct Cone;

impl Profile for Cone {
    #[inline]
    fn behind(&self, r_squared: f64) -> f64 {
        r_squared.sqrt()
    }
}

/// Parts `r` from the centre lie `r²` radii behind it. (Fraiss 2017, listing 3.6)
pub(in super::super) struct Paraboloid;

impl Profile for Paraboloid {
    #[inline]
    fn behind(&self, r_squared: f64) -> f64 {
        r_squared
    }
}
