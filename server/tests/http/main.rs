//! The server over real HTTP: a folder of real files, port 0, a real client.

mod conditional;
mod folder;
mod names;
mod ranges;
mod shutdown;
mod support;
