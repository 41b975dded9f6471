//! Hosts datasets over HTTP: the `*.lods` files of a folder or an object store, by byte range.
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
//! | `GET /datasets/NAME.lods/preview.png` | a small picture, where the build has left one |
//! | `GET /openapi.json` | what of this is JSON, as OpenAPI |
//! | `GET /healthz`, `/readyz` | `ok` while the server lives; while it can do its work |
//! | `GET /metrics` | figures for Prometheus |
//!
//! [`Server`] is bound, then run on the caller's runtime; [`spawn`] runs one on a thread of its
//! own. [`commands`] are those of the command line that need no GPU.

pub mod access;
pub mod commands;

mod activity;
mod body;
mod buffers;
mod conditional;
mod config;
mod connection;
pub mod describe;
mod disk;
mod error;
mod file;
mod hot;
mod index;
mod metrics;
mod multipart;
mod observe;
mod offload;
mod open_files;
mod openapi;
mod peer;
mod private_copy;
mod range;
mod rate;
mod routes;
mod running;
mod server;
mod storage;
#[cfg(test)]
mod testing;
mod tls;
mod workers;

pub use config::{DataPlace, ObjectPlace, RateLimit, ServeConfig, TlsFiles};
pub use error::{Error, Result};
pub use index::{AttributeEntry, BoundsEntry, DatasetEntry, DatasetIndex, UnreadableEntry};
pub use running::{RunningServer, spawn};
pub use server::{Control, Server};
