//! What goes wrong with requests, by kind: for those who count it.

use std::fmt;

/// A kind of failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Fault {
    /// No connection stood.
    NoConnection,
    /// The host was silent for longer than it may be.
    Silent,
    /// The connection ended in the middle of an answer.
    BrokenOff,
    /// An answer with this status instead of 206 (but for those below).
    Status(u16),
    /// Status 200 and the whole file instead of a range.
    WholeFile,
    /// A range that was not asked for, or none, or another length than announced.
    WrongRange,
    /// A range that was compressed on its way.
    Compressed,
    /// Another file than the one that was opened.
    Replaced,
    /// Bytes that are not those that were written.
    Damaged,
    /// Anything else, such as a file that cannot be read.
    Other,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoConnection => "no connection",
            Self::Silent => "silent",
            Self::BrokenOff => "broken off",
            Self::Status(status) => return write!(f, "status {status}"),
            Self::WholeFile => "whole file for a range",
            Self::WrongRange => "wrong range",
            Self::Compressed => "compressed range",
            Self::Replaced => "file replaced",
            Self::Damaged => "damaged bytes",
            Self::Other => "other",
        })
    }
}
