//! What is told in the window, calmly: a line that goes away by itself.

use std::time::{Duration, Instant};

/// How long a line stays.
const STAYS: Duration = Duration::from_secs(8);

/// Most lines at a time.
const MOST: usize = 4;

/// How much a line matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weight {
    /// Done as asked.
    Note,
    /// Not as asked.
    Warning,
}

/// A line.
#[derive(Debug, Clone, PartialEq)]
pub struct Message {
    /// What is told.
    pub text: String,
    /// How much it matters.
    pub weight: Weight,
    until: Instant,
}

/// The lines that are shown.
#[derive(Debug, Clone, Default)]
pub struct Messages {
    lines: Vec<Message>,
}

impl Messages {
    /// Shows a line; one of the same text only stays longer.
    pub fn tell(&mut self, weight: Weight, text: impl Into<String>) {
        let (text, until) = (text.into(), Instant::now() + STAYS);
        self.lines.retain(|line| line.text != text);
        self.lines.push(Message { text, weight, until });
        if self.lines.len() > MOST {
            self.lines.remove(0);
        }
    }

    /// The lines that are still to be shown, and how long until the next one goes.
    pub fn current(&mut self) -> (&[Message], Option<Duration>) {
        let now = Instant::now();
        self.lines.retain(|line| line.until > now);
        let next = self.lines.iter().map(|line| line.until - now).min();
        (&self.lines, next)
    }

    /// Takes a line away.
    pub fn dismiss(&mut self, index: usize) {
        if index < self.lines.len() {
            self.lines.remove(index);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_do_not_pile_up() {
        let mut messages = Messages::default();
        (0..20).for_each(|n| messages.tell(Weight::Note, format!("line {n}")));
        (0..20).for_each(|_| messages.tell(Weight::Warning, "again"));
        let (lines, next) = messages.current();
        assert_eq!(lines.len(), MOST);
        assert_eq!(lines.iter().filter(|line| line.text == "again").count(), 1);
        assert!(next.is_some());
    }
}
