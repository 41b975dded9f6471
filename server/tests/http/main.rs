//! The server over real HTTP: a folder of real files, port 0, a real client.

mod batch;
mod compression;
mod conditional;
mod file;
mod folder;
mod names;
mod ranges;
mod shutdown;
mod support;
mod two_ways;
