//! What goes wrong in operation, under load: the server stays up, others are served, and nobody is
//! sent a byte that is not the file's.
#![cfg(unix)]

mod clients;
mod crowds;
#[path = "../http/file.rs"]
mod file;
mod files;
mod frames;
mod process;
