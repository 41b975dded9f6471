//! Datasets hosted as operators host them: the real server behind a real proxy, over a real object
//! store, looked at with a real browser, with the files of `deploy/`.

#![cfg(unix)]

mod browser;
mod deploy;
mod nginx;
mod page;
mod process;
mod proxy;
mod replicas;
mod s3;
mod server;
