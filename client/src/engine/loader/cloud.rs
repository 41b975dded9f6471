//! What the loader knows of a cloud.

use std::{collections::HashSet, sync::Arc};

use bytes::Bytes;
use lodestream_protocol::Boot;
use tokio::time::Instant;

use crate::source::Source;

use super::{super::piece::PieceId, flight::Delivered, pace::Pace};

/// One version of a cloud.
#[derive(Debug)]
pub struct Cloud {
    /// By which the caller knows it.
    pub number: usize,
    pub source: Source,
    pub boot: Option<Arc<Boot>>,
    /// The first bytes of the file, and how many of them will come in all.
    pub prefix: Bytes,
    pub prefix_end: u64,
    /// Pieces that were taken from it, ever.
    pub prefix_used: HashSet<PieceId>,
    /// Bytes of payloads and pages that have come.
    pub delivered: Arc<Delivered>,
    pub pace: Pace,
    /// Failed requests in a row.
    pub failures: u32,
    /// When that was last counted.
    pub failed_at: Option<Instant>,
    /// No request before then.
    pub not_before: Option<Instant>,
    /// Whether it is told to have failed.
    pub failed: bool,
    /// Whether it must be looked at anew before anything else is asked of it: it has failed, or it is no
    /// longer what it was.
    pub is_in_doubt: bool,
    /// How often it was looked at anew since something of it came.
    pub doubts: u32,
}

impl Cloud {
    /// One of which nothing is known.
    pub fn new(number: usize, source: Source) -> Self {
        Self {
            number,
            source,
            boot: None,
            prefix: Bytes::new(),
            prefix_end: 0,
            prefix_used: HashSet::new(),
            delivered: Arc::default(),
            pace: Pace::default(),
            failures: 0,
            failed_at: None,
            not_before: None,
            failed: false,
            is_in_doubt: false,
            doubts: 0,
        }
    }

    /// Bytes of the prefix that are still to come.
    pub fn prefix_left(&self) -> u64 {
        self.prefix_end.saturating_sub(self.prefix.len() as u64)
    }
}
