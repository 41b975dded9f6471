//! What the engine is told again and again: the newest counts.

use std::collections::BTreeSet;

use super::{clip::ClipBox, config::EngineConfig};

/// Settings that may change while the engine runs.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Settings {
    pub point_budget: u64,
    pub min_size_px: f64,
    pub cache_bytes: u64,
    /// What lies outside is neither loaded nor drawn.
    pub clip: Option<ClipBox>,
    /// Clouds that are neither loaded nor drawn.
    pub hidden: BTreeSet<usize>,
}

impl Settings {
    /// Those that the engine starts with.
    pub fn new(config: &EngineConfig) -> Self {
        Self {
            point_budget: config.point_budget,
            min_size_px: config.min_size_px,
            cache_bytes: config.cache_bytes,
            clip: None,
            hidden: BTreeSet::new(),
        }
    }
}
