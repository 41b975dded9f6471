//! The address of a simulated scan: `sim:courtyard?points=2M&seed=1`.

use super::STEPS_PER_METRE;

/// Most points that may be asked for.
pub const MAX_POINTS: u64 = 1_000_000_000_000;

/// Largest coordinate that `offset` may name, in metres: with four decimals it stays exact in f64.
const MAX_OFFSET: f64 = 1e8;

/// What a `sim:` address asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct SimSpec {
    /// Points to deliver, exactly.
    pub points: u64,
    /// Seed of noise and jitter; the scene is the same for every seed.
    pub seed: u64,
    /// Whether points carry their true normals.
    pub normals: bool,
    /// Whether points carry the id of their true surface.
    pub surfaces: bool,
    /// Whether points carry the ellipse that the beam lit on their surface, as its half axes.
    pub axes: bool,
    /// Added to every coordinate, in steps of which a metre has
    /// [`STEPS_PER_METRE`](super::STEPS_PER_METRE).
    pub offset_steps: [i64; 3],
}

const USAGE: &str =
    "write sim:courtyard?points=2M&seed=1 (also: normals=0, surfaces=0, axes=1, offset=X,Y,Z)";

impl SimSpec {
    /// Reads an address.
    ///
    /// # Errors
    /// One line that says which part is wrong and what would be right.
    pub fn parse(address: &str) -> Result<Self, String> {
        let rest =
            address.strip_prefix("sim:").ok_or_else(|| format!("not a simulated scan; {USAGE}"))?;
        let (scene, query) = rest.split_once('?').unwrap_or((rest, ""));
        if scene != "courtyard" {
            return Err(format!("there is no scene {scene:?}; {USAGE}"));
        }
        let mut spec = Self {
            points: 2_000_000,
            seed: 1,
            normals: true,
            surfaces: true,
            axes: false,
            offset_steps: [0; 3],
        };
        let mut seen: Vec<&str> = Vec::new();
        for part in query.split('&').filter(|part| !part.is_empty()) {
            let (name, value) =
                part.split_once('=').ok_or_else(|| format!("{part:?} has no value; {USAGE}"))?;
            if seen.contains(&name) {
                return Err(format!("{name} is given twice; {USAGE}"));
            }
            seen.push(name);
            match name {
                "points" => spec.points = parse_count(value)?,
                "seed" => {
                    spec.seed = value.parse().map_err(|_| {
                        format!("seed={value} is not a whole number from 0 to {}", u64::MAX)
                    })?;
                }
                "normals" => spec.normals = parse_switch(name, value)?,
                "surfaces" => spec.surfaces = parse_switch(name, value)?,
                "axes" => spec.axes = parse_switch(name, value)?,
                "offset" => spec.offset_steps = parse_offset(value)?,
                _ => return Err(format!("there is no parameter {name:?}; {USAGE}")),
            }
        }
        Ok(spec)
    }
}

/// `12`, `1.5k`, `2M`, `1G`: suffixes are powers of 1000.
fn parse_count(text: &str) -> Result<u64, String> {
    let wrong = || format!("points={text} is not a count such as 65537, 300k, 2M, 1.5G");
    let (digits, unit) = match text.as_bytes().last() {
        Some(b'k') => (&text[..text.len() - 1], 1_000),
        Some(b'M') => (&text[..text.len() - 1], 1_000_000),
        Some(b'G') => (&text[..text.len() - 1], 1_000_000_000u64),
        _ => (text, 1),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all_digits = |s: &str| s.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !all_digits(whole) || !all_digits(fraction) || digits.ends_with('.') {
        return Err(wrong());
    }
    let too_many = || format!("points={text} is more than the {MAX_POINTS} that can be asked for");
    let mut points =
        whole.parse::<u64>().ok().and_then(|w| w.checked_mul(unit)).ok_or_else(too_many)?;
    let mut step = unit;
    for digit in fraction.bytes() {
        if step % 10 != 0 {
            return Err(format!("points={text} is not a whole number of points"));
        }
        step /= 10;
        points = points.checked_add(u64::from(digit - b'0') * step).ok_or_else(too_many)?;
    }
    match points {
        0 => Err(format!("points={text} asks for no point at all; ask for one or more")),
        1..=MAX_POINTS => Ok(points),
        _ => Err(too_many()),
    }
}

fn parse_switch(name: &str, text: &str) -> Result<bool, String> {
    match text {
        "1" => Ok(true),
        "0" => Ok(false),
        _ => Err(format!("{name}={text} is neither 0 nor 1")),
    }
}

fn parse_offset(text: &str) -> Result<[i64; 3], String> {
    let wrong = || {
        format!(
            "offset={text} is not three coordinates X,Y,Z of at most four decimals, each within ±{MAX_OFFSET:e} m"
        )
    };
    let parts: Vec<&str> = text.split(',').collect();
    let [x, y, z] = parts.as_slice() else { return Err(wrong()) };
    let steps = |part: &str| -> Option<i64> {
        let plain = part.bytes().all(|b| b.is_ascii_digit() || b"+-.".contains(&b));
        let decimals = part.split_once('.').map_or(0, |(_, fraction)| fraction.len());
        let value: f64 = part.parse().ok()?;
        // Within the limit a product with 10^4 is exact to far below one half.
        (plain && decimals <= 4 && value.abs() <= MAX_OFFSET)
            .then(|| (value * STEPS_PER_METRE as f64).round() as i64)
    };
    Ok([steps(x).ok_or_else(wrong)?, steps(y).ok_or_else(wrong)?, steps(z).ok_or_else(wrong)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_every_parameter() {
        let spec = SimSpec::parse(
            "sim:courtyard?points=1.25M&seed=7&normals=0&surfaces=0&axes=1&offset=500000,-5.5,0.0001",
        )
        .expect("a right address");
        let expected = SimSpec {
            points: 1_250_000,
            seed: 7,
            normals: false,
            surfaces: false,
            axes: true,
            offset_steps: [5_000_000_000, -55_000, 1],
        };
        assert_eq!(spec, expected);
    }

    #[test]
    fn fills_in_what_is_not_said() {
        let spec = SimSpec::parse("sim:courtyard").expect("a right address");
        assert_eq!(
            (spec.points, spec.seed, spec.normals, spec.surfaces, spec.axes),
            (2_000_000, 1, true, true, false)
        );
    }

    #[test]
    fn counts_take_decimal_suffixes() {
        for (text, count) in [
            ("1", 1),
            ("65537", 65537),
            ("3k", 3000),
            ("2M", 2_000_000),
            ("1G", 1_000_000_000),
            ("0.5k", 500),
        ] {
            assert_eq!(parse_count(text), Ok(count));
        }
    }

    #[test]
    fn refuses_what_it_does_not_understand_in_one_line() {
        for (address, word) in [
            ("courtyard", "not a simulated scan"),
            ("sim:castle", "no scene \"castle\""),
            ("sim:courtyard?points=0", "no point at all"),
            ("sim:courtyard?points=", "is not a count"),
            ("sim:courtyard?points=-3", "is not a count"),
            ("sim:courtyard?points=2X", "is not a count"),
            ("sim:courtyard?points=1.", "is not a count"),
            ("sim:courtyard?points=.5M", "is not a count"),
            ("sim:courtyard?points=1.5", "not a whole number"),
            ("sim:courtyard?points=1e6", "is not a count"),
            ("sim:courtyard?points=2T", "is not a count"),
            ("sim:courtyard?points=2000G", "more than"),
            ("sim:courtyard?points=99999999999999999999", "more than"),
            ("sim:courtyard?points=99999999999G", "more than"),
            ("sim:courtyard?seed=-1", "seed=-1"),
            ("sim:courtyard?normals=yes", "neither 0 nor 1"),
            ("sim:courtyard?offset=1,2", "three coordinates"),
            ("sim:courtyard?offset=1,2,nan", "three coordinates"),
            ("sim:courtyard?offset=1,2,3.00001", "three coordinates"),
            ("sim:courtyard?offset=1,2,1e3", "three coordinates"),
            ("sim:courtyard?offset=1,2,900000000", "three coordinates"),
            ("sim:courtyard?colour=1", "no parameter \"colour\""),
            ("sim:courtyard?points", "has no value"),
            ("sim:courtyard?seed=1&seed=2", "given twice"),
        ] {
            let line = SimSpec::parse(address).expect_err(address);
            assert!(line.contains(word), "{address}: {line}");
            assert!(!line.contains('\n'));
        }
    }
}
