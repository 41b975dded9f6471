//! Lattices of inputs that declare decimal steps, in integers.

use lodestream_protocol::Lattice;

use super::{InputCoordinates, Placement};
use crate::{
    numbers::{Decimal, gcd},
    readers::CoordinateKind,
};

/// Lattice coordinates of floating-point inputs are surely the nearest integers up to here: the
/// number, the step and their quotient are each off by half an ulp at most.
const SURE_STEPS: f64 = 1e15;

/// The steps that an input declares: `offset + scale * n`, per axis.
#[derive(Debug, Clone, Copy)]
struct Declared {
    scale: [Decimal; 3],
    offset: [Decimal; 3],
}

impl Declared {
    /// `None` where the input declares none.
    fn by(kind: &CoordinateKind) -> Option<Self> {
        let all = |values: [f64; 3]| -> Option<[Decimal; 3]> {
            let [x, y, z] = values.map(Decimal::of);
            Some([x?, y?, z?])
        };
        match *kind {
            CoordinateKind::Scaled { scale, offset } => {
                Some(Self { scale: all(scale)?, offset: all(offset)? })
            }
            CoordinateKind::Float { decimals, .. } => {
                let step = Decimal { mantissa: 1, exponent: -i32::from(decimals?) };
                let zero = Decimal { mantissa: 0, exponent: 0 };
                Some(Self { scale: [step; 3], offset: [zero; 3] })
            }
        }
    }

    fn exponents(&self) -> impl Iterator<Item = i32> {
        self.scale.into_iter().chain(self.offset).map(|d| d.exponent)
    }
}

/// Where an input's integers lie on one axis: at `first` plus multiples of `stride`.
fn native_steps(input: &InputCoordinates, axis: usize) -> (i128, i128) {
    match (input.kind, input.steps.first) {
        (CoordinateKind::Scaled { .. }, Some(first)) => {
            (first[axis].into(), input.steps.step[axis].into())
        }
        _ => (0, 1),
    }
}

/// The coarsest lattice that holds all `inputs` (which have points) exactly, its cube still to be
/// found: `None` where one of them declares no steps, or the numbers are too large.
///
/// Its step is the greatest common divisor of what the inputs declare; where the points lie on whole
/// multiples of a larger power of ten, it is the largest such power.
pub fn common_lattice(inputs: &[&InputCoordinates]) -> Option<Lattice> {
    let declared: Vec<Declared> =
        inputs.iter().map(|i| Declared::by(&i.kind)).collect::<Option<_>>()?;
    let exponent = declared.iter().flat_map(Declared::exponents).min()?;
    // All that follows is in units of 10^exponent.
    let offset = |d: &Declared, a: usize| d.offset[a].at_exponent(exponent);
    let scale = |d: &Declared, a: usize| d.scale[a].at_exponent(exponent);
    let place = |i: usize, a: usize| -> Option<i128> {
        let (first, _) = native_steps(inputs[i], a);
        scale(&declared[i], a)?.checked_mul(first)?.checked_add(offset(&declared[i], a)?)
    };
    let (mut common, mut used) = (0, 0);
    for (i, d) in declared.iter().enumerate() {
        for a in 0..3 {
            let (_, stride) = native_steps(inputs[i], a);
            common = gcd(common, scale(d, a)?);
            common = gcd(common, offset(d, a)?.checked_sub(offset(&declared[0], a)?)?);
            used = gcd(used, scale(d, a)?.checked_mul(stride)?);
            used = gcd(used, place(i, a)?.checked_sub(place(0, a)?)?);
        }
    }
    if common == 0 {
        return None;
    }
    let step = common.max(power_of_ten_in(used));
    let mut corner = [0.0; 3];
    for (a, corner) in corner.iter_mut().enumerate() {
        let zero = offset(&declared[0], a)?;
        let beside = place(0, a)?.checked_sub(zero)?.rem_euclid(step);
        *corner = Decimal { mantissa: zero.checked_add(beside)?, exponent }.to_f64();
    }
    let scale = Decimal { mantissa: step, exponent }.to_f64();
    Some(Lattice { scale, offset: corner, origin: [0; 3], side_bits: 0 })
}

/// The largest power of ten that divides `n`; 0 for 0, which they all do.
fn power_of_ten_in(n: i128) -> i128 {
    if n == 0 {
        return 0;
    }
    let mut power = 1;
    while n % (power * 10) == 0 {
        power *= 10;
    }
    power
}

/// How an input goes onto `lattice` exactly, whatever its cube; `None` where it does not.
pub fn placement(lattice: &Lattice, input: &InputCoordinates) -> Option<Placement> {
    let declared = Declared::by(&input.kind)?;
    let step = Decimal::of(lattice.scale)?;
    let mut factor = [0; 3];
    let mut shift = [0; 3];
    let mut divisor = [0; 3];
    for a in 0..3 {
        let zero = Decimal::of(lattice.offset[a])?;
        let parts = [declared.scale[a], declared.offset[a], step, zero];
        let exponent = parts.iter().map(|d| d.exponent).min()?;
        let [scale, offset, step, zero] = parts.map(|d| d.at_exponent(exponent));
        let (scale, step) = (scale?, step?);
        let apart = offset?.checked_sub(zero?)?;
        let (first, stride) = native_steps(input, a);
        let on_it = |n: i128| step != 0 && n % step == 0;
        if !on_it(scale.checked_mul(first)?.checked_add(apart)?)
            || !on_it(scale.checked_mul(stride)?)
        {
            return None;
        }
        let apart = apart.checked_sub(i128::from(lattice.origin[a]).checked_mul(step)?)?;
        let common = gcd(gcd(scale, step), apart);
        factor[a] = i64::try_from(scale / common).ok()?;
        shift[a] = i64::try_from(apart / common).ok()?;
        divisor[a] = i64::try_from(step / common).ok()?;
    }
    match input.kind {
        CoordinateKind::Scaled { .. } => Some(Placement::Exact { factor, shift, divisor }),
        CoordinateKind::Float { .. } => {
            let sure =
                |v: f64, a: usize| ((v - lattice.offset[a]) / lattice.scale).abs() < SURE_STEPS;
            let (min, max) = (input.bounds.min, input.bounds.max);
            (0..3).all(|a| sure(min[a], a) && sure(max[a], a)).then_some(Placement::Nearest {
                scale: [1.0; 3],
                offset: [0.0; 3],
                exact: true,
            })
        }
    }
}
