//! The streaming engine and its sources, over real files and real HTTP.

#[path = "../common/mod.rs"]
mod common;

mod hosts;
mod jumps;
mod picture;
mod refinement;
mod simulated;
mod sources;
mod tasked;
