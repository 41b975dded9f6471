//! What is wrong between here and a dataset, and what to do about it.
//!
//! - `probe.rs`: requests as clients and browsers make them, within bounds;
//! - `ranges.rs`, `fields.rs`, `content.rs`, `speed.rs`: what to look at;
//! - `expiry.rs`: signed addresses;
//! - `examine.rs`: in which order, and when to stop;
//! - `finding.rs`: what was found.

mod content;
mod examine;
mod expiry;
mod fields;
mod finding;
mod probe;
mod ranges;
mod speed;

pub use examine::examine;
pub use finding::{Diagnosis, Finding, Verdict};
