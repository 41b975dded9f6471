//! The options of a generator's line: `name=value` pairs joined by `&`.

use std::ops::RangeInclusive;

use crate::path::PathError;

/// What is not read yet of a line's options.
#[derive(Debug)]
pub(super) struct Options<'a> {
    /// Of the generator.
    name: &'a str,
    pairs: Vec<(&'a str, &'a str)>,
    /// Names that were asked for.
    known: Vec<&'static str>,
}

impl<'a> Options<'a> {
    /// Splits the text behind the `?`.
    pub fn split(name: &'a str, text: &'a str) -> Result<Self, PathError> {
        let mut pairs: Vec<(&str, &str)> = Vec::new();
        for part in text.split('&').filter(|part| !part.is_empty()) {
            let Some((option, value)) = part.split_once('=') else {
                return Err(PathError::Spec(format!(
                    "{name}: {part:?} has no value; write {name}?seconds=20"
                )));
            };
            if pairs.iter().any(|(seen, _)| *seen == option) {
                return Err(PathError::Spec(format!("{name}: {option} is given twice")));
            }
            pairs.push((option, value));
        }
        Ok(Self { name, pairs, known: Vec::new() })
    }

    fn take(&mut self, option: &'static str) -> Option<&'a str> {
        self.known.push(option);
        let index = self.pairs.iter().position(|(name, _)| *name == option)?;
        Some(self.pairs.remove(index).1)
    }

    fn wrong(&self, option: &str, value: &str, right: &str) -> PathError {
        PathError::Spec(format!("{}: {option}={value} is not {right}", self.name))
    }

    /// A number within a range.
    pub fn number(
        &mut self,
        option: &'static str,
        default: f64,
        range: RangeInclusive<f64>,
    ) -> Result<f64, PathError> {
        let Some(value) = self.take(option) else { return Ok(default) };
        value.parse().ok().filter(|number| range.contains(number)).ok_or_else(|| {
            let right = format!("a number from {} to {}", range.start(), range.end());
            self.wrong(option, value, &right)
        })
    }

    /// A whole number within a range.
    pub fn count(
        &mut self,
        option: &'static str,
        default: u64,
        range: RangeInclusive<u64>,
    ) -> Result<u64, PathError> {
        let Some(value) = self.take(option) else { return Ok(default) };
        value.parse().ok().filter(|number| range.contains(number)).ok_or_else(|| {
            let right = format!("a whole number from {} to {}", range.start(), range.end());
            self.wrong(option, value, &right)
        })
    }

    /// One of several words, the first of which is the default.
    pub fn choice<T: Copy>(
        &mut self,
        option: &'static str,
        choices: &[(&'static str, T)],
    ) -> Result<T, PathError> {
        let Some(value) = self.take(option) else { return Ok(choices[0].1) };
        choices.iter().find(|(word, _)| *word == value).map(|(_, choice)| *choice).ok_or_else(
            || {
                let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
                self.wrong(option, value, &words.join(" or "))
            },
        )
    }

    /// Nothing may be left that nobody asked for.
    pub fn finish(self) -> Result<(), PathError> {
        let Some((option, _)) = self.pairs.first() else { return Ok(()) };
        let (name, known) = (self.name, self.known.join(", "));
        Err(PathError::Spec(format!("{name} has no option {option:?}; it has {known}")))
    }
}
