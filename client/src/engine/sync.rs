//! The locks that hand-overs are made of. The test of the hand-overs puts a model checker's in their place.

pub use std::sync::{Condvar, Mutex, MutexGuard};

pub use tokio::sync::Notify;
