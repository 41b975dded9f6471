//! Lattices for coordinates that none holds exactly.
//!
//! Decimal numbers that reach too far for their many decimals keep as many as fit: a user who does not
//! care for them says so by `--scale`. Binary floating-point numbers get a power-of-two step far below
//! the point spacing, and no coarser than single precision where that is what they are.

use lodestream_protocol::Lattice;

use super::{InputCoordinates, NativeBounds, side_bits_for, world_of};
use crate::{
    error::{Error, Result},
    numbers::Decimal,
    readers::CoordinateKind,
};

/// Steps that a root cube has room for, less one for the rounding at either end.
const MOST_STEPS: f64 = 4_294_967_294.0;

/// Steps from zero up to which an f64 surely tells one from the next.
const SURE_STEPS: f64 = 1e15;

/// A lattice with a cube for all `inputs`, which have points: `points` of them. `step` is its step in
/// world units where the user asks for one.
///
/// # Errors
/// [`Error::Setup`] where the coordinates reach too far for any lattice (or for the asked step).
pub fn lattice(inputs: &[&InputCoordinates], points: u64, step: Option<f64>) -> Result<Lattice> {
    let mut bounds = NativeBounds::EMPTY;
    let mut single_reach: f64 = 0.0;
    let mut all_decimal = true;
    for input in inputs {
        let (scale, offset) = world_of(&input.kind);
        let corner = |p: [f64; 3]| std::array::from_fn(|a| p[a] * scale[a] + offset[a]);
        let own = NativeBounds { min: corner(input.bounds.min), max: corner(input.bounds.max) };
        bounds.merge(&own);
        if let CoordinateKind::Float { decimals, single_precision } = input.kind {
            all_decimal &= decimals.is_some();
            if single_precision {
                single_reach = single_reach.max(own.reach());
            }
        }
    }
    let extent = (0..3).map(|a| bounds.max[a] - bounds.min[a]).fold(0.0, f64::max);
    let reach = bounds.reach();
    if !extent.is_finite() || !reach.is_finite() {
        return Err(Error::Setup(format!(
            "coordinates reach from {:?} to {:?}: too far apart for 64-bit numbers",
            bounds.min, bounds.max
        )));
    }
    let decimal = step.or_else(|| all_decimal.then(|| finest_power_of_ten(extent, reach)));
    let scale = decimal.unwrap_or_else(|| binary_step(extent, reach, single_reach, points));
    let offset: [f64; 3] = if decimal.is_some() { [0.0; 3] } else { bounds.min };
    let steps = |v: f64, a: usize| ((v - offset[a]) / scale).round();
    let fits = (0..3).all(|a| {
        steps(bounds.max[a], a) - steps(bounds.min[a], a) < 4_294_967_296.0
            && steps(bounds.max[a], a).abs() < 4e18
            && steps(bounds.min[a], a).abs() < 4e18
    });
    if !fits {
        return Err(Error::Setup(format!(
            "a step of {scale} is too fine for an extent of {extent}: at most 2^32 steps fit; \
             choose a larger --scale"
        )));
    }
    let origin: [i64; 3] = std::array::from_fn(|a| steps(bounds.min[a], a) as i64);
    let high: [i64; 3] = std::array::from_fn(|a| steps(bounds.max[a], a) as i64);
    let side_bits = side_bits_for(origin, high)
        .ok_or_else(|| Error::Setup("coordinates reach too far for any lattice".into()))?;
    Ok(Lattice { scale, offset, origin, side_bits })
}

/// The smallest power of ten of which an extent holds few enough, and a coordinate too.
fn finest_power_of_ten(extent: f64, reach: f64) -> f64 {
    let least = (extent / MOST_STEPS).max(reach / SURE_STEPS).max(f64::MIN_POSITIVE);
    // The logarithm may be off by an ulp.
    let mut exponent = least.log10().floor() as i32 - 1;
    let power = |exponent| Decimal { mantissa: 1, exponent }.to_f64();
    while power(exponent) < least {
        exponent += 1;
    }
    power(exponent)
}

/// A power of two far below the spacing of `points` points on a surface: 1/1024 of
/// extent / sqrt(points). No coarser than an ulp of the farthest single-precision coordinate, no
/// finer than one of the farthest coordinate.
fn binary_step(extent: f64, reach: f64, single_reach: f64, points: u64) -> f64 {
    let surface_bits = ((points.max(1) as f64).sqrt() * 1024.0).log2().ceil() as i32;
    let extent_bits = extent.max(f64::MIN_POSITIVE).log2().ceil() as i32;
    let mut finest = extent_bits - surface_bits.clamp(24, 31);
    if single_reach > 0.0 {
        let ulp = single_reach.log2().floor() as i32 - 23;
        finest = finest.min(ulp).max(extent_bits - 31);
    }
    let ulp = if reach > 0.0 { reach.log2().floor() as i32 - 52 } else { -1022 };
    f64::from(finest.max(ulp).max(-1000)).exp2()
}
