//! Choosing the lattice that all inputs share, and putting coordinates on it.
//!
//! LAS coordinates are decimal integers times a scale; so are text and simulated coordinates with a
//! known number of decimals. The coarsest lattice that holds all of them exactly is found with
//! integer arithmetic ([`decimal`]). Other coordinates are rounded, and the error is measured
//! ([`rounded`]).

mod decimal;
mod placement;
mod rounded;
mod steps;

use lodestream_protocol::{Lattice, MAX_SIDE_BITS};

pub use placement::{Placement, placement_on};
pub use steps::NativeSteps;

use crate::{error::Result, readers::CoordinateKind};

/// Native bounds of one input: integers or floats, as its reader delivers them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NativeBounds {
    /// Lowest coordinates (integers are exact in f64).
    pub min: [f64; 3],
    /// Highest coordinates.
    pub max: [f64; 3],
}

impl NativeBounds {
    /// Holds nothing.
    pub const EMPTY: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    /// Grows to hold `p`.
    pub fn grow(&mut self, p: [f64; 3]) {
        self.min = std::array::from_fn(|a| self.min[a].min(p[a]));
        self.max = std::array::from_fn(|a| self.max[a].max(p[a]));
    }

    /// Grows to hold all that `other` holds.
    pub fn merge(&mut self, other: &Self) {
        self.grow(other.min);
        self.grow(other.max);
    }

    fn is_empty(&self) -> bool {
        self.min[0] > self.max[0]
    }

    /// Largest distance from zero on an axis.
    fn reach(&self) -> f64 {
        self.min.iter().chain(&self.max).fold(0.0, |reach, c| reach.max(c.abs()))
    }
}

/// What is known of one input once it has been read.
#[derive(Debug, Clone, Copy)]
pub struct InputCoordinates {
    /// How its numbers are to be understood.
    pub kind: CoordinateKind,
    /// What it holds.
    pub bounds: NativeBounds,
    /// Where its coordinates lie, if they are integers.
    pub steps: NativeSteps,
}

/// The lattice for a set of inputs, and how each input is put on it.
#[derive(Debug, Clone)]
pub struct Choice {
    /// The lattice.
    pub lattice: Lattice,
    /// One per input, in order.
    pub placements: Vec<Placement>,
}

/// World units per native unit, and the world coordinate of native zero.
fn world_of(kind: &CoordinateKind) -> ([f64; 3], [f64; 3]) {
    match *kind {
        CoordinateKind::Scaled { scale, offset } => (scale, offset),
        CoordinateKind::Float { .. } => ([1.0; 3], [0.0; 3]),
    }
}

/// Chooses the lattice. `points` is the number of points over all inputs; `step` is the lattice step
/// in world units where the user asks for one.
///
/// # Errors
/// [`Error::Setup`] where the coordinates reach too far for any lattice (or for the asked step).
pub fn choose(inputs: &[InputCoordinates], points: u64, step: Option<f64>) -> Result<Choice> {
    let filled: Vec<&InputCoordinates> = inputs.iter().filter(|i| !i.bounds.is_empty()).collect();
    let exact = match step {
        None if filled.is_empty() => {
            Some(Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 0 })
        }
        None => decimal::common_lattice(&filled).and_then(|lattice| around(lattice, &filled)),
        Some(_) => None,
    };
    let lattice = match exact {
        Some(lattice) => lattice,
        None => rounded::lattice(&filled, points, step)?,
    };
    Ok(Choice {
        lattice,
        placements: inputs.iter().map(|input| placement_on(&lattice, input)).collect(),
    })
}

/// `lattice` with the smallest cube that holds all `inputs`, which it holds exactly; `None` where
/// there is no such cube.
fn around(mut lattice: Lattice, inputs: &[&InputCoordinates]) -> Option<Lattice> {
    let mut low = [i64::MAX; 3];
    let mut high = [i64::MIN; 3];
    for input in inputs {
        let placement = decimal::placement(&lattice, input)?;
        for a in 0..3 {
            let place = |native: f64| -> Option<i64> {
                match placement {
                    Placement::Exact { factor, shift, divisor } => {
                        let scaled =
                            (native as i64).checked_mul(factor[a])?.checked_add(shift[a])?;
                        scaled.checked_div(divisor[a])
                    }
                    Placement::Nearest { .. } => {
                        Some(((native - lattice.offset[a]) / lattice.scale).round() as i64)
                    }
                }
            };
            low[a] = low[a].min(place(input.bounds.min[a])?);
            high[a] = high[a].max(place(input.bounds.max[a])?);
        }
    }
    lattice.side_bits = side_bits_for(low, high)?;
    lattice.origin = low;
    lattice.is_valid().then_some(lattice)
}

/// Bits of the smallest power-of-two cube from `low` that holds `high`.
fn side_bits_for(low: [i64; 3], high: [i64; 3]) -> Option<u8> {
    let mut side_bits = 0;
    for a in 0..3 {
        let extent = u64::try_from(high[a].checked_sub(low[a])?).ok()?;
        side_bits = side_bits.max((u64::BITS - extent.leading_zeros()) as u8);
    }
    (side_bits <= MAX_SIDE_BITS).then_some(side_bits)
}

#[cfg(test)]
mod tests;
