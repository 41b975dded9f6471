//! Numbers in text: value and decimals in one pass over the bytes.
//!
//! Of a coordinate we want two things: the nearest f64, and how many decimals the text has, so that
//! a decimal lattice can hold it exactly. Parsers of the field give the first only, so the scan is
//! ours; where its digits and its power of ten are exact in an f64 (nearly always), one
//! multiplication or division rounds correctly (Clinger 1990, section 4: the fast path), and
//! everything else goes to the standard library's parser.

/// A number read from text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::readers) struct Number {
    /// The nearest f64.
    pub value: f64,
    /// Decimals that write the number exactly, without zeros at the end; 255 for 255 or more. Zero
    /// where the value is not finite.
    pub decimals: u8,
}

/// Largest power of ten that is exact in an f64.
const EXACT_POWERS: usize = 22;

const POWERS: [f64; EXACT_POWERS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Digits that always fit a u64.
const MANTISSA_DIGITS: usize = 19;

/// Exponents beyond this make any number of bytes we could hold zero or infinite.
const EXPONENT_LIMIT: i64 = 1 << 40;

/// Reads the number that `bytes` start with and tells how many bytes it took; `None` where they do
/// not start with a decimal number. Words (`nan`, `inf`) are left to [`parse`].
#[inline]
pub(in crate::readers) fn scan(bytes: &[u8]) -> Option<(Number, usize)> {
    let whole = usize::from(matches!(bytes.first(), Some(b'-' | b'+')));
    let mut mantissa = 0_u64;
    let mut at = digits(bytes, whole, &mut mantissa);
    let mut count = at - whole;
    let mut fraction = 0;
    if bytes.get(at) == Some(&b'.') {
        let start = at + 1;
        at = digits(bytes, start, &mut mantissa);
        fraction = at - start;
        count += fraction;
    }
    if count == 0 {
        return None;
    }
    let digits_end = at;
    let mut exponent = 0;
    if let Some(b'e' | b'E') = bytes.get(at) {
        let (value, length) = self::exponent(&bytes[at..]);
        exponent = value;
        at += length;
    }

    let power = exponent - i64::try_from(fraction).ok()?;
    let steps = usize::try_from(power.unsigned_abs()).unwrap_or(usize::MAX);
    let fits = count <= MANTISSA_DIGITS;
    let value = if fits && mantissa <= 1 << 53 && steps <= EXACT_POWERS {
        let magnitude = mantissa as f64;
        let magnitude =
            if power < 0 { magnitude / POWERS[steps] } else { magnitude * POWERS[steps] };
        if bytes[0] == b'-' { -magnitude } else { magnitude }
    } else {
        std::str::from_utf8(&bytes[..at]).ok()?.parse().ok()?
    };
    let last = &bytes[digits_end - fraction..digits_end];
    let zeros = last.iter().rev().take_while(|&&digit| digit == b'0').count();
    let zero = if fits { mantissa == 0 } else { is_zero(&bytes[whole..digits_end]) };
    let decimals = if zero { 0 } else { i64::try_from(fraction - zeros).ok()? - exponent };
    Some((Number { value, decimals: u8::try_from(decimals.max(0)).unwrap_or(u8::MAX) }, at))
}

/// Appends the digits from `at` on to `mantissa` (which wraps where there are too many); gives
/// where they end.
#[inline]
fn digits(bytes: &[u8], mut at: usize, mantissa: &mut u64) -> usize {
    while let Some(digit) = digit(bytes, at) {
        *mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
        at += 1;
    }
    at
}

fn is_zero(digits: &[u8]) -> bool {
    digits.iter().all(|digit| matches!(digit, b'0' | b'.'))
}

/// Reads a whole field: a decimal number, or a word for what is not one (`nan`, `-inf`, `1.#QNAN`).
pub(in crate::readers) fn parse(field: &[u8]) -> Option<Number> {
    match scan(field) {
        Some((number, taken)) if taken == field.len() => Some(number),
        _ => word(field).map(|value| Number { value, decimals: 0 }),
    }
}

/// What C's, Java's, Python's and Microsoft's printers write where there is no finite number.
fn word(field: &[u8]) -> Option<f64> {
    let word = field.strip_prefix(b"-").or(field.strip_prefix(b"+")).unwrap_or(field);
    let is_any = |words: &[&str]| words.iter().any(|w| word.eq_ignore_ascii_case(w.as_bytes()));
    if is_any(&["nan", "nan(ind)", "nan(snan)", "1.#qnan", "1.#snan", "1.#ind", "1.#nan"]) {
        Some(f64::NAN)
    } else if is_any(&["inf", "infinity", "1.#inf"]) {
        Some(if field.starts_with(b"-") { f64::NEG_INFINITY } else { f64::INFINITY })
    } else {
        None
    }
}

#[inline]
fn digit(bytes: &[u8], at: usize) -> Option<u8> {
    let digit = bytes.get(at)?.wrapping_sub(b'0');
    (digit < 10).then_some(digit)
}

/// The exponent after the `e` that `bytes` start with, and the length of both; (0, 0) where there
/// is none.
#[cold]
fn exponent(bytes: &[u8]) -> (i64, usize) {
    let negative = bytes.get(1) == Some(&b'-');
    let mut at = 1 + usize::from(matches!(bytes.get(1), Some(b'-' | b'+')));
    let first_digit = at;
    let mut exponent = 0_i64;
    while let Some(digit) = digit(bytes, at) {
        exponent = (exponent * 10 + i64::from(digit)).min(EXPONENT_LIMIT);
        at += 1;
    }
    if at == first_digit { (0, 0) } else { (if negative { -exponent } else { exponent }, at) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn number(text: &str) -> (f64, u8) {
        let number = parse(text.as_bytes()).expect("a number");
        (number.value, number.decimals)
    }

    #[test]
    fn counts_decimals_without_zeros_at_the_end() {
        assert_eq!(number("665187.522077"), (665_187.522_077, 6));
        assert_eq!(number("-1.500000"), (-1.5, 1));
        assert_eq!(number("3.000"), (3.0, 0));
        assert_eq!(number("+.25"), (0.25, 2));
        assert_eq!(number("7."), (7.0, 0));
        assert_eq!(number("-0.000"), (0.0, 0));
    }

    #[test]
    fn exponents_move_the_decimals() {
        assert_eq!(number("1e-5"), (1e-5, 5));
        assert_eq!(number("-1.25E-2"), (-0.0125, 4));
        assert_eq!(number("1.25e+1"), (12.5, 1));
        assert_eq!(number("5e2"), (500.0, 0));
        assert_eq!(number("0e-7"), (0.0, 0));
        assert_eq!(number("1e-400"), (0.0, 255));
        assert_eq!(number("1e99999999999999999999"), (f64::INFINITY, 0));
    }

    #[test]
    fn takes_the_longest_number_and_says_how_long_it_is() {
        assert_eq!(scan(b"12.5,7"), Some((Number { value: 12.5, decimals: 1 }, 4)));
        assert_eq!(scan(b"12e"), Some((Number { value: 12.0, decimals: 0 }, 2)));
        assert_eq!(scan(b"1-2"), Some((Number { value: 1.0, decimals: 0 }, 1)));
    }

    #[test]
    fn words_for_no_number_are_understood() {
        for text in ["nan", "NaN", "-nan", "-nan(ind)", "1.#QNAN", "-1.#IND"] {
            assert!(number(text).0.is_nan(), "{text}");
        }
        assert_eq!(number("-Infinity").0, f64::NEG_INFINITY);
        assert_eq!(number("1.#INF").0, f64::INFINITY);
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in ["", "-", ".", "e5", "x", "1,5", "0x10", "1.2.3", "--1", "1 2", "12e"] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_parser(text in r"[+-]?[0-9]{1,25}(\.[0-9]{0,25})?([eE][+-]?[0-9]{1,3})?") {
            let expected: f64 = text.parse().expect("the grammar is a subset of Rust's");
            prop_assert_eq!(number(&text).0.to_bits(), expected.to_bits());
        }

        #[test]
        fn round_trips_what_is_printed(value in proptest::num::f64::NORMAL) {
            prop_assert_eq!(number(&value.to_string()).0.to_bits(), value.to_bits());
            prop_assert_eq!(number(&format!("{value:e}")).0.to_bits(), value.to_bits());
        }

        #[test]
        fn decimals_are_those_of_the_decimal_lattice(steps in -1_000_000_000_i64..1_000_000_000, places in 0_usize..9) {
            let scale = 10_i64.pow(u32::try_from(places).expect("small"));
            let text = format!(
                "{}{}.{:0places$}", if steps < 0 { "-" } else { "" }, steps.abs() / scale, steps.abs() % scale
            );
            let (value, decimals) = number(&text);
            prop_assert!(usize::from(decimals) <= places);
            // Every step of that lattice is hit exactly.
            let lattice = 10_f64.powi(i32::from(decimals));
            prop_assert_eq!((value * lattice).round() / lattice, value);
        }

        #[test]
        fn never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = parse(&bytes);
        }
    }
}
