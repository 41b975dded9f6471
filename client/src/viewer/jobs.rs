//! What must be waited for besides the picture, off the window's thread.
//!
//! Each job is a thread of its own that ends with one answer: they are few, asked for by a hand, and wait
//! for hosts and disks. The answer is put down and the window is woken.

use std::{
    path::PathBuf,
    sync::mpsc::{Receiver, Sender, channel},
};

use lodestream_server::DatasetIndex;

use super::{picking::Picked, point_values::Known};
use crate::path::CameraPath;

/// What a job ends with.
#[derive(Debug)]
pub enum Answer {
    /// A server's list.
    List {
        /// The server's address.
        server: String,
        /// The list, or why there is none.
        index: Result<DatasetIndex, String>,
    },
    /// Position and attributes of a picked point.
    Values {
        /// Which pick they are of.
        pick: u64,
        /// The point, as it was picked.
        point: Picked,
        /// What is known of it, or why nothing is.
        known: Result<Known, String>,
    },
    /// A picture was written.
    Picture {
        /// The file.
        file: PathBuf,
        /// Whether it is one of an export.
        exported: bool,
        /// Whether it shows all that its view will show.
        is_complete: bool,
        /// Why it is not there, if so.
        outcome: Result<(), String>,
    },
    /// A path file was read.
    Path(Result<CameraPath, String>),
}

/// Starts jobs and hands out what they end with.
pub struct Jobs {
    sender: Sender<Answer>,
    receiver: Receiver<Answer>,
    wake: std::sync::Arc<dyn Fn() + Send + Sync>,
}

impl Jobs {
    /// Jobs that call `wake` when they are done.
    pub fn new(wake: std::sync::Arc<dyn Fn() + Send + Sync>) -> Self {
        let (sender, receiver) = channel();
        Self { sender, receiver, wake }
    }

    /// Starts one.
    pub fn start(&self, job: impl FnOnce() -> Answer + Send + 'static) {
        let (sender, wake) = (self.sender.clone(), self.wake.clone());
        let spawned = std::thread::Builder::new().name("job".into()).spawn(move || {
            // Nobody listens once the window is closed.
            let _ = sender.send(job());
            wake();
        });
        if let Err(error) = spawned {
            tracing::warn!("cannot start a thread: {error}");
        }
    }

    /// What has ended since the last call.
    pub fn answers(&self) -> Vec<Answer> {
        self.receiver.try_iter().collect()
    }
}
