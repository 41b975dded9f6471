//! Reports: pages that a person reads, beside the tables that a program reads.
//!
//! - `page.rs`: one self-contained HTML page, the frame that all reports share;
//! - `plot.rs`: curves and dots;
//! - `machine.rs`: what figures hang on.

mod machine;
mod page;
mod plot;

pub use machine::machine;
pub use page::{Align, Cell, Page, Section, Table, Tone};
pub use plot::{Mark, Plot, Scale, Series};
