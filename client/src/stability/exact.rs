//! The reference: floats of 512 bits.
//!
//! Sums, differences and products of the cases' numbers are exact in them; quotients, roots and
//! angles are right to some 150 digits.

use dashu_base::Abs;
use dashu_float::{FBig, round::mode::HalfEven};

/// A float of [`BITS`] bits.
pub(super) type Big = FBig<HalfEven, 2>;

/// Bits of a [`Big`].
const BITS: usize = 512;

/// A finite number, exactly.
pub(super) fn big(value: f64) -> Big {
    let exact = Big::try_from(value).expect("references are made of finite numbers");
    exact.with_precision(BITS).value()
}

/// A whole number, exactly.
pub(super) fn whole(value: i128) -> Big {
    Big::from(value).with_precision(BITS).value()
}

/// The number that decimal digits mean: `-12.5`.
pub(super) fn decimal(text: &str) -> Big {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let (integer, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let mantissa: i128 = format!("{integer}{fraction}").parse().expect("digits of a case");
    let ten_to = (0..fraction.len()).fold(whole(1), |power, _| power * whole(10));
    whole(sign * mantissa) / ten_to
}

/// The nearest f64.
pub(super) fn rounded(value: &Big) -> f64 {
    value.to_f64().value()
}

/// How far `found` is from `exact`; infinite where it is no number.
pub(super) fn apart(found: f64, exact: &Big) -> f64 {
    if found.is_finite() { rounded(&(big(found) - exact).abs()) } else { f64::INFINITY }
}

/// The same as a part of `exact`.
pub(super) fn relative(found: f64, exact: &Big) -> f64 {
    if !found.is_finite() {
        return f64::INFINITY;
    }
    let apart = (big(found) - exact).abs();
    if apart == whole(0) { 0.0 } else { rounded(&(apart / exact.clone().abs())) }
}

/// A vector.
pub(super) type Big3 = [Big; 3];

/// A vector of finite numbers, exactly.
pub(super) fn big3(v: impl Into<[f64; 3]>) -> Big3 {
    v.into().map(big)
}

/// Inner product.
pub(super) fn dot(a: &Big3, b: &Big3) -> Big {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

/// Outer product.
pub(super) fn cross(a: &Big3, b: &Big3) -> Big3 {
    [&a[1] * &b[2] - &a[2] * &b[1], &a[2] * &b[0] - &a[0] * &b[2], &a[0] * &b[1] - &a[1] * &b[0]]
}

/// Difference.
pub(super) fn minus(a: &Big3, b: &Big3) -> Big3 {
    std::array::from_fn(|i| &a[i] - &b[i])
}

/// Euclidean length.
pub(super) fn length(v: &Big3) -> Big {
    dot(v, v).sqrt()
}

/// The same direction, of length one.
pub(super) fn unit(v: &Big3) -> Big3 {
    let length = length(v);
    std::array::from_fn(|i| &v[i] / &length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_mean_what_they_say() {
        assert_eq!(decimal("-12.5"), big(-12.5));
        assert_eq!(decimal("7"), whole(7));
        // A tenth is no f64: the nearest one is off by 5.55e-18.
        assert!((apart(0.1, &decimal("0.1")) - 5.551_115_123_125_783e-18).abs() < 1e-33);
        assert_eq!(decimal("-0.001"), -(whole(1) / whole(1000)));
    }

    #[test]
    fn nothing_is_lost_between_very_different_sizes() {
        let sum = big(1e100) + big(1e-30);
        assert_eq!(rounded(&(sum - big(1e100))), 1e-30);
        assert_eq!(apart(f64::NAN, &whole(0)), f64::INFINITY);
    }

    #[test]
    fn vectors_are_those_of_geometry() {
        let v = big3([3.0, 4.0, 0.0]);
        assert_eq!(length(&v), whole(5));
        assert_eq!(cross(&v, &big3([0.0, 0.0, 1.0])), big3([4.0, -3.0, 0.0]));
        assert_eq!(minus(&v, &v), big3([0.0; 3]));
        assert_eq!(dot(&unit(&v), &v), whole(5));
    }
}
