//! Numbers for people.

/// 1,234,567.
#[must_use]
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// 1.23 M: three digits.
#[must_use]
pub fn short(number: u64) -> String {
    let number = number as f64;
    for (unit, size) in [("G", 1e9), ("M", 1e6), ("k", 1e3)] {
        if number >= size {
            return format!("{} {unit}", three_digits(number / size));
        }
    }
    format!("{number}")
}

/// 12.3 MB: three digits.
#[must_use]
pub fn bytes(number: u64) -> String {
    let number = number as f64;
    for (unit, size) in [("GB", 1e9), ("MB", 1e6), ("kB", 1e3)] {
        if number >= size {
            return format!("{} {unit}", three_digits(number / size));
        }
    }
    format!("{number} B")
}

fn three_digits(number: f64) -> String {
    let decimals = match number {
        n if n < 9.995 => 2,
        n if n < 99.95 => 1,
        _ => 0,
    };
    format!("{number:.decimals$}")
}

/// A length with as many decimals as tell five digits of `whole`, of which it is a part or all.
#[must_use]
pub fn length(number: f64, whole: f64) -> String {
    let magnitude = whole.abs().max(1e-12).log10().floor();
    let decimals = (4.0 - magnitude).clamp(0.0, 9.0) as usize;
    format!("{number:.decimals$}")
}

/// A round number of 1, 2 or 5 times a power of ten, at most `most`.
#[must_use]
pub fn round_below(most: f64) -> f64 {
    let usable = if most.is_finite() && most > 0.0 { most } else { 1.0 };
    let power = 10f64.powf(usable.log10().floor());
    let steps = [5.0, 2.0, 1.0].into_iter().map(|step| step * power);
    steps.into_iter().find(|step| *step <= usable).unwrap_or(power)
}

/// As short as tells it exactly: 500, 0.05, 2e-7.
#[must_use]
pub fn round_text(number: f64) -> String {
    if (1e-4..1e7).contains(&number) {
        let decimals = (-number.log10().floor()).clamp(0.0, 9.0) as usize;
        format!("{number:.decimals$}")
    } else {
        format!("{number:e}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([7, 1_234, 99_960, 123_456_789].map(short), ["7", "1.23 k", "100 k", "123 M"]);
        assert_eq!(bytes(5_600_000), "5.60 MB");
        assert_eq!(length(12.3456789, 12.3456789), "12.346");
        assert_eq!(length(0.00123456, 0.00123456), "0.0012346");
        assert_eq!(length(-0.0001, 1.6942), "-0.0001");
        assert_eq!([0.05, 500.0, 2.0].map(round_text), ["0.05", "500", "2"]);
    }

    #[test]
    fn round_numbers_are_at_most_what_they_may_be() {
        for most in [0.0123, 0.9, 1.0, 4.9, 5.0, 99.0, 12_345.0, 1e-9, 3e8] {
            let round = round_below(most);
            assert!(round <= most * (1.0 + 1e-12) && round > 0.39 * most, "{most} {round}");
        }
        assert!(round_below(f64::NAN) > 0.0);
    }
}
