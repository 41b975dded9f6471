//! Choosing the lattice that all inputs share, and putting coordinates on it.
//!
//! LAS coordinates are decimal integers times a scale; so are text and simulated coordinates with a
//! known number of decimals. The coarsest lattice that holds all of them exactly is found with
//! integer arithmetic (greatest common divisor of scales and offset differences). Binary floating
//! point coordinates get a power-of-two step far below the point spacing; the error is measured.

use lodestream_protocol::{Lattice, MAX_SIDE_BITS};

use crate::{
    error::{Error, Result},
    numbers::{Decimal, gcd},
    readers::CoordinateKind,
};

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
}

/// What is known of one input once it has been read.
#[derive(Debug, Clone, Copy)]
pub struct InputCoordinates {
    /// How its numbers are to be understood.
    pub kind: CoordinateKind,
    /// What it holds.
    pub bounds: NativeBounds,
}

/// How one input's native coordinates become lattice coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Placement {
    /// `q = factor * native + shift`: exact.
    Exact {
        /// Lattice units per native unit.
        factor: [i64; 3],
        /// Lattice coordinate of native zero, relative to the root cube's corner.
        shift: [i64; 3],
    },
    /// `q = round((native * scale + offset - lattice offset) / lattice scale)`: measured rounding.
    Rounded {
        /// World units per native unit.
        scale: [f64; 3],
        /// World coordinate of native zero.
        offset: [f64; 3],
    },
}

impl Placement {
    /// Lattice coordinates of a native position and the largest rounding on an axis, world units.
    /// Positions inside the bounds that the lattice was chosen for are inside the root cube.
    #[inline]
    pub fn place(&self, lattice: &Lattice, native: [f64; 3]) -> ([u32; 3], f64) {
        match self {
            Self::Exact { factor, shift } => {
                let q = std::array::from_fn(|a| (native[a] as i64 * factor[a] + shift[a]) as u32);
                (q, 0.0)
            }
            Self::Rounded { scale, offset } => {
                let mut rounding: f64 = 0.0;
                let q = std::array::from_fn(|a| {
                    let world = native[a] * scale[a] + offset[a];
                    let steps = ((world - lattice.offset[a]) / lattice.scale).round() as i64;
                    let back = steps as f64 * lattice.scale + lattice.offset[a];
                    rounding = rounding.max((back - world).abs());
                    let inside = steps - lattice.origin[a];
                    inside.clamp(0, (1i64 << lattice.side_bits) - 1) as u32
                });
                (q, rounding)
            }
        }
    }
}

/// The lattice for a set of inputs, and how each input is put on it.
#[derive(Debug, Clone)]
pub struct Choice {
    /// The lattice.
    pub lattice: Lattice,
    /// One per input, in order.
    pub placements: Vec<Placement>,
    /// Why coordinates are rounded, where they are.
    pub note: Option<String>,
}

/// Exact description of an input's own lattice, per axis.
#[derive(Debug, Clone, Copy)]
struct OwnLattice {
    scale: [Decimal; 3],
    offset: [Decimal; 3],
}

fn own_lattice(kind: &CoordinateKind) -> Option<OwnLattice> {
    let all = |values: [f64; 3]| -> Option<[Decimal; 3]> {
        let [x, y, z] = values.map(Decimal::of);
        Some([x?, y?, z?])
    };
    match *kind {
        CoordinateKind::Scaled { scale, offset } => {
            Some(OwnLattice { scale: all(scale)?, offset: all(offset)? })
        }
        CoordinateKind::Float { decimals, .. } => {
            let step = Decimal { mantissa: 1, exponent: -i32::from(decimals?) };
            let zero = Decimal { mantissa: 0, exponent: 0 };
            Some(OwnLattice { scale: [step; 3], offset: [zero; 3] })
        }
    }
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
    if filled.is_empty() {
        let lattice = Lattice { scale: 1.0, offset: [0.0; 3], origin: [0; 3], side_bits: 0 };
        let nothing = Placement::Exact { factor: [1; 3], shift: [0; 3] };
        return Ok(Choice { lattice, placements: vec![nothing; inputs.len()], note: None });
    }
    if step.is_none()
        && let Some(choice) = choose_exact(inputs, &filled)
    {
        return Ok(choice);
    }
    choose_rounded(inputs, &filled, points, step)
}

fn choose_exact(inputs: &[InputCoordinates], filled: &[&InputCoordinates]) -> Option<Choice> {
    let own: Vec<OwnLattice> =
        filled.iter().map(|i| own_lattice(&i.kind)).collect::<Option<_>>()?;
    let exponent =
        own.iter().flat_map(|o| o.scale.iter().chain(&o.offset)).map(|d| d.exponent).min()?;
    let first = own[0].offset;
    // Step of the common lattice, in units of 10^exponent.
    let mut common = 0i128;
    for o in &own {
        for a in 0..3 {
            common = gcd(common, o.scale[a].at_exponent(exponent)?);
            let apart =
                o.offset[a].at_exponent(exponent)?.checked_sub(first[a].at_exponent(exponent)?)?;
            common = gcd(common, apart);
        }
    }
    if common == 0 {
        return None;
    }
    let scale = Decimal { mantissa: common, exponent }.to_f64();
    // The root cube's corner is not known yet: its origin is zero for now.
    let offset: [f64; 3] = std::array::from_fn(|a| first[a].to_f64());
    let mut lattice = Lattice { scale, offset, origin: [0; 3], side_bits: 0 };
    // A float input with known decimals is rounded to the lattice point that it means.
    let is_float = |kind: &CoordinateKind| matches!(kind, CoordinateKind::Float { .. });
    let mut low = [i64::MAX; 3];
    let mut high = [i64::MIN; 3];
    for input in filled {
        let placement = placement_on(&lattice, input);
        for a in 0..3 {
            let place = |native: f64| -> Option<i64> {
                match placement {
                    Placement::Exact { factor, shift } => {
                        (native as i64).checked_mul(factor[a])?.checked_add(shift[a])
                    }
                    Placement::Rounded { .. } if is_float(&input.kind) => {
                        let steps = ((native - offset[a]) / scale).round();
                        (steps.abs() < 9e15).then_some(steps as i64)
                    }
                    Placement::Rounded { .. } => None,
                }
            };
            low[a] = low[a].min(place(input.bounds.min[a])?);
            high[a] = high[a].max(place(input.bounds.max[a])?);
        }
    }
    lattice.side_bits = side_bits_for(low, high)?;
    lattice.origin = low;
    if !lattice.is_valid() {
        return None;
    }
    let placements = inputs.iter().map(|input| placement_on(&lattice, input)).collect();
    Some(Choice { lattice, placements, note: None })
}

/// How an input goes onto a lattice that is given: exactly, where its own steps are whole multiples of
/// the lattice's.
pub fn placement_on(lattice: &Lattice, input: &InputCoordinates) -> Placement {
    let (scale, offset) = world_of(&input.kind);
    let rounded = Placement::Rounded { scale, offset };
    if matches!(input.kind, CoordinateKind::Float { .. }) {
        return rounded;
    }
    exact_placement(lattice, &input.kind).unwrap_or(rounded)
}

fn exact_placement(lattice: &Lattice, kind: &CoordinateKind) -> Option<Placement> {
    let own = own_lattice(kind)?;
    let step = Decimal::of(lattice.scale)?;
    let mut factor = [0; 3];
    let mut shift = [0; 3];
    for a in 0..3 {
        let zero = Decimal::of(lattice.offset[a])?;
        let parts = [own.scale[a], own.offset[a], step, zero];
        let exponent = parts.iter().map(|d| d.exponent).min()?;
        let [scale, offset, step, zero] = parts.map(|d| d.at_exponent(exponent));
        let (scale, step) = (scale?, step?);
        let apart = offset?.checked_sub(zero?)?;
        if step == 0 || scale % step != 0 || apart % step != 0 {
            return None;
        }
        factor[a] = i64::try_from(scale / step).ok()?;
        shift[a] = i64::try_from(apart / step).ok()?.checked_sub(lattice.origin[a])?;
    }
    Some(Placement::Exact { factor, shift })
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

fn choose_rounded(
    inputs: &[InputCoordinates],
    filled: &[&InputCoordinates],
    points: u64,
    step: Option<f64>,
) -> Result<Choice> {
    let mut bounds = NativeBounds::EMPTY;
    for input in filled {
        let (scale, offset) = world_of(&input.kind);
        let corner = |p: [f64; 3]| std::array::from_fn(|a| p[a] * scale[a] + offset[a]);
        bounds.grow(corner(input.bounds.min));
        bounds.grow(corner(input.bounds.max));
    }
    let extent = (0..3).map(|a| bounds.max[a] - bounds.min[a]).fold(0.0, f64::max);
    let reach = (0..3).map(|a| bounds.max[a].abs().max(bounds.min[a].abs())).fold(0.0, f64::max);
    if !extent.is_finite() || !reach.is_finite() {
        return Err(Error::Setup(format!(
            "coordinates reach from {:?} to {:?}: too far apart for 64-bit numbers",
            bounds.min, bounds.max
        )));
    }
    // Steps far below the spacing of `points` points on a surface: 1/1024 of extent / sqrt(points).
    let surface_bits = ((points.max(1) as f64).sqrt() * 1024.0).log2().ceil() as i32;
    let finest = extent.max(f64::MIN_POSITIVE).log2().ceil() as i32 - surface_bits.clamp(24, 31);
    // Coordinates themselves are no finer than an ulp of the farthest one.
    let ulp = if reach > 0.0 { reach.log2().floor() as i32 - 52 } else { -1022 };
    let scale = step.unwrap_or_else(|| f64::from(finest.max(ulp).max(-1000)).exp2());
    let offset: [f64; 3] = if step.is_some() { [0.0; 3] } else { bounds.min };
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
    let lattice = Lattice { scale, offset, origin, side_bits };
    let placements = inputs
        .iter()
        .map(|input| {
            let (scale, offset) = world_of(&input.kind);
            Placement::Rounded { scale, offset }
        })
        .collect();
    let note = format!("coordinates are rounded to multiples of {scale:e}");
    Ok(Choice { lattice, placements, note: Some(note) })
}
