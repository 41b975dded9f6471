//! Who may read what.
//!
//! Without rules everything may be read by everyone who reaches the server; [`Access::Open`] is
//! therefore refused on an address that others reach, unless the operator says `public`. With
//! rules, a dataset is read by whoever the rules name it for, and for everyone else it does not
//! exist: the answer, its words and the work behind it are those for a name that nobody ever gave
//! to a dataset, because the rules are asked before the folder is.
//!
//! Two ways to have a right, besides what is public: a bearer token, for programs that keep one,
//! and a signed address, for handing on (`signature.rs`). Tokens are never taken from an address:
//! those end up in logs, histories and referrers.

mod pattern;
mod rights;
mod secret;
mod signature;
mod token;

pub use pattern::DatasetPattern;
pub(crate) use rights::Rights;
pub use secret::Secret;
pub use signature::{LINK_FIELDS, Link, MIN_KEY_BYTES, sign};
pub use token::{TokenHash, TokenRule, new_token};

/// Who may read what.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Access {
    /// Everyone reads everything.
    #[default]
    Open,
    /// Only what the rules allow.
    Rules(AccessRules),
}

/// What is allowed; all else does not exist.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AccessRules {
    /// Datasets that everyone may read.
    pub public: Vec<DatasetPattern>,
    /// What the holder of a token may read.
    pub tokens: Vec<TokenRule>,
    /// Keys that signed addresses may be signed with; the first one signs, so that a new key can be
    /// put before an old one.
    pub signing_keys: Vec<Secret>,
}
