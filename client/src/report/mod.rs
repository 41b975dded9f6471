//! Reports: pages that a person reads, beside the tables that a program reads.
//!
//! - `page.rs`: one self-contained HTML page, the frame that all reports share.

mod page;

pub use page::{Align, Cell, Page, Section, Table, Tone};
