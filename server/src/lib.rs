//! Hosts datasets over HTTP: the `*.lods` files of a folder, by byte range.
//!
//! Datasets never change once they are published, so the server keeps no state about them: every
//! request looks at the folder, and a dataset that appears, is replaced or is removed is so for the
//! very next request.
//!
//! | route | answers |
//! | --- | --- |
//! | `GET /` | the list of datasets as a small page |
//! | `GET /datasets` | the list as JSON: [`DatasetIndex`] |
//! | `GET`, `HEAD /datasets/NAME.lods`, `/NAME.lods` | the file, whole or by range; with `?v=` and its tag, this very content |
//! | `POST /datasets/NAME.lods/batch`, `/NAME.lods/batch` | many parts of the file by one request |
//! | `GET /healthz` | `ok` while the folder can be read |
//!
//! [`Server`] is bound, then run on the caller's runtime; [`spawn`] runs one on a thread of its
//! own. [`commands`] are those of the command line that need no GPU.

pub mod commands;

mod body;
mod buffers;
mod conditional;
mod config;
mod connection;
pub mod describe;
mod error;
mod file;
mod folder;
mod hot;
mod index;
mod multipart;
mod offload;
mod open_files;
mod private_copy;
mod range;
mod routes;
mod running;
mod server;

pub use config::ServeConfig;
pub use error::{Error, Result};
pub use index::{AttributeEntry, BoundsEntry, DatasetEntry, DatasetIndex, UnreadableEntry};
pub use running::{RunningServer, spawn};
pub use server::Server;
