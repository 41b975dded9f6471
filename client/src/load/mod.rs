//! The load test: many real engines follow a camera path, and a record of what each waited for.
//!
//! - `config.rs`: what is asked for, within bounds;
//! - `itinerary.rs`: the path as a timetable, which no server can hold up;
//! - `visit.rs`: one client; `awaited.rs`: what it waits for; `crowd.rs`: all of them on a few threads;
//! - `ledger.rs`: what they write down together; `waits.rs`: quantiles of what may never have come;
//! - `process.rs`: what the server takes of its machine;
//! - `knee.rs`, `ratio.rs`: what the runs come to side by side;
//! - `report.rs`, `page.rs`, `summary.rs`: what was found, for programs, for people, and for a terminal.

mod awaited;
mod config;
mod crowd;
mod itinerary;
mod knee;
mod ledger;
mod page;
mod process;
mod ratio;
mod report;
mod run;
mod summary;
mod visit;
mod waits;

pub use config::{Length, LoadConfig, MOST_CLIENTS, MOST_SECONDS};
pub use crowd::Standing;
pub use itinerary::{Itinerary, Stop};
pub use knee::Knee;
pub use page::page;
pub use process::ProcessReport;
pub use ratio::{Ratios, ratios};
pub use report::{
    ArrivalReport, ByteReport, FORMAT, IntervalReport, LoadReport, LookReport, RequestReport,
    RunReport, VERSION, Visits,
};
pub use run::run;
pub use summary::summary;
pub use waits::{WaitReport, Waits};
