//! Which datasets a rule is about.

use std::{fmt, str::FromStr};

/// A dataset's name (`autzen`), or how names begin (`site-*`; `*` is every name).
///
/// Only a star at the end, so that what a pattern covers is seen at a glance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DatasetPattern {
    stem: String,
    is_prefix: bool,
}

impl DatasetPattern {
    /// Every dataset.
    #[must_use]
    pub const fn all() -> Self {
        Self { stem: String::new(), is_prefix: true }
    }

    /// Whether the rule is about the dataset of this name (without `.lods`).
    #[must_use]
    pub fn covers(&self, name: &str) -> bool {
        if self.is_prefix { name.starts_with(&self.stem) } else { name == self.stem }
    }
}

impl FromStr for DatasetPattern {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (stem, is_prefix) = match text.strip_suffix('*') {
            Some(stem) => (stem, true),
            None => (text, false),
        };
        let is_name = !stem.contains(['*', '/', '\\']) && !stem.contains(char::is_control);
        if !is_name || text.is_empty() || stem.ends_with(".lods") {
            let advice = "write a dataset's name without .lods, or the beginning of names and a *";
            return Err(format!("{text:?} names no datasets; {advice}"));
        }
        Ok(Self { stem: stem.to_owned(), is_prefix })
    }
}

impl fmt::Display for DatasetPattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.stem, if self.is_prefix { "*" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pattern(text: &str) -> DatasetPattern {
        text.parse().expect(text)
    }

    #[test]
    fn a_name_covers_itself_and_a_star_what_begins_alike() {
        assert!(pattern("a").covers("a") && !pattern("a").covers("ab"));
        assert!(pattern("a*").covers("a") && pattern("a*").covers("ab"));
        assert!(!pattern("a*").covers("b") && !pattern("a").covers("A"));
        assert!(pattern("*").covers("") && pattern("*") == DatasetPattern::all());
        assert_eq!(pattern("site-*").to_string(), "site-*");
    }

    #[test]
    fn what_could_be_mistaken_is_refused() {
        for text in ["", "a.lods", "*a", "a*b", "**", "a/b", "..\\a", "a\0", "a\n"] {
            assert!(text.parse::<DatasetPattern>().is_err(), "{text:?}");
        }
    }
}
