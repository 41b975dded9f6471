//! Reports: pages that a person reads, beside the tables that a program reads.
//!
//! - `page.rs`: one self-contained HTML page, the frame that all reports share;
//! - `machine.rs`: what figures hang on.

mod machine;
mod page;

pub use machine::machine;
pub use page::{Align, Cell, Page, Section, Table, Tone};
