//! The streaming engine and its sources, over real files and real HTTP.

#[path = "../common/mod.rs"]
mod common;

mod batches;
mod clouds;
mod hosts;
mod jumps;
mod many;
mod picture;
mod precision;
mod priority;
mod refinement;
mod simulated;
mod soak;
mod sources;
mod tasked;
