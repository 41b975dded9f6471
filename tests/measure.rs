//! What the benches share.

use std::{env, ffi::OsString};

/// The command line of a bench: `[INPUT] [--runs N]`.
#[derive(Debug)]
pub struct Options {
    /// What to measure with.
    pub input: OsString,
    /// How often to measure, at least once.
    pub runs: usize,
}

impl Options {
    /// Reads the command line; `default_input` stands in where no input is named.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn parse(default_input: &str) -> Result<Self, String> {
        let mut options = Self { input: default_input.into(), runs: 5 };
        let mut arguments = env::args_os().skip(1);
        while let Some(argument) = arguments.next() {
            match argument.to_str() {
                // cargo says so to every bench.
                Some("--bench") => {}
                Some("--runs") => {
                    let runs = arguments.next().and_then(|runs| runs.to_str()?.parse().ok());
                    options.runs =
                        runs.filter(|&runs| runs > 0).ok_or("--runs needs a number above 0")?;
                }
                Some(option) if option.starts_with('-') => {
                    return Err(format!("unknown option {option}"));
                }
                _ => options.input = argument,
            }
        }
        Ok(options)
    }
}

/// Sorts `values` and returns the middle one, or the mean of the middle two; NaN where there are
/// none.
pub fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    match values.len() {
        0 => f64::NAN,
        odd if odd % 2 == 1 => values[middle],
        _ => f64::midpoint(values[middle - 1], values[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn median_is_the_middle_value_or_the_mean_of_the_middle_two() {
        assert_eq!(median(&mut [9.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [9.0, 1.0, 2.0, 4.0]), 3.0);
        assert!(median(&mut []).is_nan());
    }
}
