//! Exact decimals: scales and offsets as the decimal numbers their writers meant.

/// `mantissa * 10^exponent`, the mantissa not divisible by ten (or zero).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Decimal {
    /// Integer part of the product.
    pub mantissa: i128,
    /// Power of ten.
    pub exponent: i32,
}

impl Decimal {
    /// The shortest decimal that reads back as `value`; `None` where it is not finite.
    pub fn of(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        // Rust prints the shortest digits that round-trip: `-1.2345e-3`.
        let text = format!("{value:e}");
        let (digits, exponent) = text.split_once('e')?;
        let exponent: i32 = exponent.parse().ok()?;
        let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
        let mantissa: i128 = format!("{whole}{fraction}").parse().ok()?;
        if mantissa == 0 {
            return Some(Self { mantissa: 0, exponent: 0 });
        }
        Some(Self { mantissa, exponent: exponent - i32::try_from(fraction.len()).ok()? })
    }

    /// `mantissa` at a smaller or equal exponent, where it fits.
    pub fn at_exponent(self, exponent: i32) -> Option<i128> {
        if self.mantissa == 0 {
            return Some(0);
        }
        let up = u32::try_from(self.exponent.checked_sub(exponent)?).ok()?;
        self.mantissa.checked_mul(10i128.checked_pow(up)?)
    }

    /// The nearest f64.
    pub fn to_f64(self) -> f64 {
        format!("{}e{}", self.mantissa, self.exponent).parse().unwrap_or(f64::NAN)
    }
}

/// Greatest common divisor; `gcd(0, b) = |b|`.
pub fn gcd(a: i128, b: i128) -> i128 {
    let (mut a, mut b) = (a.unsigned_abs(), b.unsigned_abs());
    while b != 0 {
        (a, b) = (b, a % b);
    }
    i128::try_from(a).unwrap_or(i128::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_decimal_reads_back_as_its_number(value in proptest::num::f64::NORMAL) {
            let decimal = Decimal::of(value).expect("finite");
            prop_assert_eq!(decimal.to_f64().to_bits(), value.to_bits());
        }
    }

    #[test]
    fn scales_are_what_their_writers_meant() {
        assert_eq!(Decimal::of(0.01), Some(Decimal { mantissa: 1, exponent: -2 }));
        assert_eq!(Decimal::of(635_577.79), Some(Decimal { mantissa: 63_557_779, exponent: -2 }));
        assert_eq!(Decimal::of(0.005).and_then(|d| d.at_exponent(-4)), Some(50));
        assert_eq!(gcd(50, 20), 10);
    }
}
