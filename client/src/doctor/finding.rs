//! What was looked at, and how it is.

use serde::{Deserialize, Serialize};

/// How something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As it should be.
    Ok,
    /// It works, but not for everybody, or not as fast as it could.
    Warn,
    /// Clients cannot rely on it.
    Fail,
}

impl Verdict {
    /// As it is written, in four letters.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Warn => "warn",
            Self::Fail => "FAIL",
        }
    }
}

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// What was looked at: a short name that stays the same.
    pub check: String,
    /// How it is.
    pub verdict: Verdict,
    /// What was found, in a sentence.
    pub found: String,
    /// What to do about it, where there is anything.
    pub remedy: Option<String>,
}

impl Finding {
    /// All is well.
    pub(super) fn ok(check: &str, found: impl Into<String>) -> Self {
        Self { check: check.into(), verdict: Verdict::Ok, found: found.into(), remedy: None }
    }

    /// It could be better.
    pub(super) fn warn(check: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        let (found, remedy) = (found.into(), Some(remedy.into()));
        Self { check: check.into(), verdict: Verdict::Warn, found, remedy }
    }

    /// It does not work.
    pub(super) fn fail(check: &str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        let (found, remedy) = (found.into(), Some(remedy.into()));
        Self { check: check.into(), verdict: Verdict::Fail, found, remedy }
    }
}

/// All that was found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// The dataset's address, without secrets.
    pub url: String,
    /// The worst of all.
    pub verdict: Verdict,
    /// In the order in which it was looked at.
    pub findings: Vec<Finding>,
    /// Requests that it took.
    pub requests: u64,
    /// Bytes of bodies that it took.
    pub bytes: u64,
}

impl Diagnosis {
    /// The finding of a check, the worst where there are several.
    #[must_use]
    pub fn of(&self, check: &str) -> Option<&Finding> {
        self.findings.iter().filter(|f| f.check == check).max_by_key(|f| f.verdict)
    }

    /// For a terminal: a line for each finding, with what to do below it.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("{}\n", self.url);
        let width = self.findings.iter().map(|f| f.check.len()).max().unwrap_or(0);
        for finding in &self.findings {
            let (word, check) = (finding.verdict.word(), &finding.check);
            text += &format!("  {word:<4}  {check:<width$}  {}\n", finding.found);
            if let Some(remedy) = &finding.remedy {
                text += &format!("  {:<4}  {:<width$}  -> {remedy}\n", "", "");
            }
        }
        let count = |verdict| self.findings.iter().filter(|f| f.verdict == verdict).count();
        let (fails, warns) = (count(Verdict::Fail), count(Verdict::Warn));
        text += &match (fails, warns) {
            (0, 0) => "sound".to_owned(),
            (0, warns) => format!("works; {warns} to be looked at"),
            (fails, _) => format!("not sound: {fails} to be repaired"),
        };
        text += &format!(" ({} requests, {} bytes)\n", self.requests, self.bytes);
        text
    }
}
