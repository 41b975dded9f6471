//! A line of the table: one algorithm on one case.

use serde::{Serialize, Serializer};

/// By how many times a shortcut must exceed the tolerance for its failure to count as plain to see.
const PLAIN_TO_SEE: f64 = 1000.0;

/// One algorithm on one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Of [`Algorithm::name`](super::Algorithm::name).
    pub algorithm: &'static str,
    /// What it was tried on.
    pub case: String,
    /// How far the result is from the reference; not finite where there is no result.
    #[serde(serialize_with = "number")]
    pub error: f64,
    /// What the error is measured in.
    pub unit: &'static str,
    /// Largest error that passes.
    #[serde(serialize_with = "number")]
    pub tolerance: f64,
    /// Why the tolerance is what it is.
    pub reason: &'static str,
    /// What the result is compared with.
    pub reference: &'static str,
    /// The usual shortcuts on the same case.
    pub naive: Vec<Naive>,
    /// Whether the error is within the tolerance.
    pub passed: bool,
}

/// A usual shortcut on the same case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Naive {
    /// What it does.
    pub name: &'static str,
    /// How far its result is from the reference; not finite where there is no result.
    #[serde(serialize_with = "number")]
    pub error: f64,
    /// Whether it fails where the algorithm holds, plain to see: a thousand times the tolerance, or
    /// anything where nothing is tolerated, or no result.
    pub fails: bool,
}

impl Row {
    /// A line without shortcuts; it has passed where `error` is at most `tolerance`.
    pub(super) fn new(
        case: impl Into<String>,
        (error, unit): (f64, &'static str),
        (tolerance, reason): (f64, &'static str),
        reference: &'static str,
    ) -> Self {
        Self {
            algorithm: "",
            case: case.into(),
            error,
            unit,
            tolerance,
            reason,
            reference,
            naive: Vec::new(),
            // A tolerance may be without bound where a condition is; an error may not.
            passed: error.is_finite() && error <= tolerance,
        }
    }

    /// Whether something holds: an error of 0 or 1 that tolerates nothing.
    pub(super) fn holds(
        case: impl Into<String>,
        holds: bool,
        reason: &'static str,
        reference: &'static str,
    ) -> Self {
        let error = if holds { 0.0 } else { 1.0 };
        Self::new(case, (error, "failures"), (0.0, reason), reference)
    }

    /// The same with a shortcut beside it.
    #[must_use]
    pub(super) fn beside(mut self, name: &'static str, error: f64) -> Self {
        let limit = PLAIN_TO_SEE * self.tolerance;
        let fails = self.passed && (error.is_nan() || error > limit);
        self.naive.push(Naive { name, error, fails });
        self
    }
}

/// JSON and CSV have no infinities: what is not finite becomes its name.
fn number<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if value.is_finite() {
        serializer.serialize_f64(*value)
    } else {
        serializer.serialize_str(&value.to_string())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_passes_nowhere() {
        let row = |error| Row::new("case", (error, "m"), (f64::INFINITY, "any"), "none");
        assert!(row(1e300).passed && !row(f64::NAN).passed && !row(f64::INFINITY).passed);
    }

    #[test]
    fn a_shortcut_fails_only_where_the_algorithm_holds() {
        let holds = Row::new("case", (1e-16, "m"), (1e-15, "because"), "exact");
        let fails = |row: &Row, error| row.clone().beside("shortcut", error).naive[0].fails;
        assert!(!fails(&holds, 1e-13) && fails(&holds, 1e-9) && fails(&holds, f64::NAN));
        let missed = Row::new("case", (1.0, "m"), (1e-15, "because"), "exact");
        assert!(!fails(&missed, f64::NAN));
    }

    #[test]
    fn what_is_no_number_is_written_by_name() {
        let row = Row::holds("case", true, "because", "exact").beside("shortcut", f64::NAN);
        let json = serde_json::to_string(&row).expect("serializes");
        assert!(json.contains("\"error\":\"NaN\""), "{json}");
    }
}
