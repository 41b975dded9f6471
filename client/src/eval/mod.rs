//! Error against run time: every method, budget and policy is a point on a curve.
//!
//! - `views.rs`: where pictures are taken from, by rule;
//! - `subject.rs`: a dataset and the truth of any view of it;
//! - `potree.rs`: a node in a rival's encoding, and what that weighs;
//! - `frame.rs`: milliseconds per frame and error;
//! - `stream.rs`: error over time while a view streams in;
//! - `along.rs`: error along a camera path, without waiting;
//! - `left_out.rs`: what a view does without, and what that saves;
//! - `curve.rs`: areas under curves, times to a quality, bytes at equal error, Pareto fronts;
//! - `run.rs`: all of it, for `lodestream eval`;
//! - `report.rs`, `page.rs`: what was found, for programs and for people; `compare.rs`: two of them.

mod along;
mod compare;
mod curve;
mod frame;
mod left_out;
mod page;
mod potree;
mod report;
mod run;
mod stream;
mod subject;
mod views;

pub use along::{Instant, PathRun, PathSample, instants};
pub use compare::{Difference, compare};
pub use curve::{Reached, Sample, area, bytes_at_equal_error, pareto, reached};
pub use frame::FrameRow;
pub use left_out::{Cost, NotStored, SavingRow};
pub use page::page;
pub use potree::payload as potree_payload;
pub use report::{BuildRow, Entrant, NoiseRow, Race, Report, SubjectReport};
pub use run::{EvalConfig, Exhibit, run};
pub use stream::{LEVELS, Stop, StreamRun, Streaming};
pub use subject::{Subject, Visitor};
pub use views::ViewSize;
