//! How an input's coordinates become lattice coordinates.

use lodestream_protocol::Lattice;

use super::{InputCoordinates, decimal, world_of};
use crate::readers::Positions;

/// How one input's native coordinates become lattice coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Placement {
    /// `q = (factor * native + shift) / divisor`: whole numbers, for every point of the input.
    Exact {
        /// Lattice units per `divisor` native units.
        factor: [i64; 3],
        /// `divisor` times the lattice coordinate of native zero, relative to the root cube's corner.
        shift: [i64; 3],
        /// Above zero.
        divisor: [i64; 3],
    },
    /// The lattice point nearest to `native * scale + offset`.
    Nearest {
        /// World units per native unit.
        scale: [f64; 3],
        /// World coordinate of native zero.
        offset: [f64; 3],
        /// The lattice point is the number that the input means, and the native coordinate the f64
        /// nearest to that: there is nothing to measure.
        exact: bool,
    },
}

impl Placement {
    /// Lattice coordinates of native positions, relative to the root cube, and the largest
    /// rounding on an axis in world units. Positions inside the bounds that the placement was made
    /// for are inside the root cube.
    pub fn place(&self, lattice: &Lattice, positions: Positions) -> (Vec<[u32; 3]>, f64) {
        match (self, positions) {
            // In place: the same memory, arithmetic modulo 2^32 on values that fit.
            (Self::Exact { factor, shift, divisor: [1, 1, 1] }, Positions::Scaled(native)) => {
                let factor = factor.map(|f| f as u32);
                let shift = shift.map(|s| s as u32);
                let mut placed: Vec<[u32; 3]> = bytemuck::cast_vec(native);
                for p in &mut placed {
                    *p = std::array::from_fn(|a| {
                        p[a].wrapping_mul(factor[a]).wrapping_add(shift[a])
                    });
                }
                (placed, 0.0)
            }
            (Self::Exact { factor, shift, divisor }, Positions::Scaled(mut native)) => {
                for p in &mut native {
                    *p = std::array::from_fn(|a| {
                        let scaled = i64::from(p[a]).wrapping_mul(factor[a]).wrapping_add(shift[a]);
                        (scaled / divisor[a]) as i32
                    });
                }
                (bytemuck::cast_vec(native), 0.0)
            }
            (placement, Positions::Scaled(native)) => {
                placement.nearest(lattice, native.into_iter().map(|p| p.map(f64::from)))
            }
            (placement, Positions::Float(native)) => placement.nearest(lattice, native.into_iter()),
        }
    }

    /// The lattice points nearest to `native` ones.
    fn nearest(
        &self,
        lattice: &Lattice,
        native: impl Iterator<Item = [f64; 3]>,
    ) -> (Vec<[u32; 3]>, f64) {
        let (scale, offset, exact) = match *self {
            Self::Nearest { scale, offset, exact } => (scale, offset, exact),
            // Floating-point numbers have no exact placement; they are world coordinates.
            Self::Exact { .. } => ([1.0; 3], [0.0; 3], false),
        };
        let mut rounding: f64 = 0.0;
        let highest = (1i64 << lattice.side_bits) - 1;
        let placed = native.map(|p| {
            std::array::from_fn(|a| {
                let world = p[a] * scale[a] + offset[a];
                let steps = ((world - lattice.offset[a]) / lattice.scale).round() as i64;
                let back = steps as f64 * lattice.scale + lattice.offset[a];
                rounding = rounding.max((back - world).abs());
                steps.saturating_sub(lattice.origin[a]).clamp(0, highest) as u32
            })
        });
        let placed = placed.collect();
        (placed, if exact { 0.0 } else { rounding })
    }
}

/// How an input goes onto a lattice that is given: exactly, where all its points lie on it and inside
/// its cube.
pub fn placement_on(lattice: &Lattice, input: &InputCoordinates) -> Placement {
    let exact = decimal::placement(lattice, input);
    if let Some(placement) = exact.filter(|placement| is_inside(placement, lattice, input)) {
        return placement;
    }
    let (scale, offset) = world_of(&input.kind);
    Placement::Nearest { scale, offset, exact: false }
}

/// Whether the bounds of an input are in the lattice's cube, and no number on the way there overflows.
fn is_inside(placement: &Placement, lattice: &Lattice, input: &InputCoordinates) -> bool {
    let Placement::Exact { factor, shift, divisor } = placement else { return true };
    let side = 1i128 << lattice.side_bits;
    input.bounds.is_empty()
        || (0..3).all(|a| {
            [input.bounds.min[a], input.bounds.max[a]].into_iter().all(|native| {
                let scaled = i128::from(native as i64) * i128::from(factor[a]);
                let scaled = scaled + i128::from(shift[a]);
                i64::try_from(scaled).is_ok()
                    && (0..side).contains(&(scaled / i128::from(divisor[a])))
                    && scaled >= 0
            })
        })
}
