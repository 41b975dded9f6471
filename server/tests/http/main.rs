//! The server over real HTTP: a folder of real files, port 0, a real client.

mod access;
mod batch;
mod compression;
mod conditional;
mod file;
mod folder;
mod index;
mod names;
mod objects;
mod operation;
mod ranges;
mod shutdown;
mod store;
mod support;
mod tls;
mod two_ways;
