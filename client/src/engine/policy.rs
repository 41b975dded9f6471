//! Ways to fetch: ours, and those of the rivals, so that a gain is a ratio from one run.

use std::str::FromStr;

use lodestream_protocol::HEADER_BYTES;
use serde::{Deserialize, Serialize};

use super::{
    config::{Coalesce, EngineConfig, LoadOrder},
    priority::Priority,
};

/// How nodes are fetched. Tree, points, budget and renderer stay the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// As [`EngineConfig`] has it.
    #[default]
    Ours,
    /// As Potree 1.8 does in a browser: header, then hierarchy, then a range for every node, four at
    /// a time, never broken off; nodes down to a radius of 30 pixels.
    Potree,
    /// As Fraiss 2017 does (3.2.4, 3.2.6, 4.2): header, then hierarchy, then a queue, a node at a
    /// time in the order in which they were first wanted; nodes down to 10 pixels.
    Fraiss,
    /// As [`Potree`](Self::Potree), and each node weighs what PotreeConverter 2 makes of it with
    /// `--encoding BROTLI`. For evaluations: no such files are hosted.
    #[serde(rename = "potree-brotli")]
    PotreeBrotli,
}

impl Policy {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Ours, Self::Potree, Self::Fraiss, Self::PotreeBrotli];

    /// As it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ours => "ours",
            Self::Potree => "potree",
            Self::Fraiss => "fraiss",
            Self::PotreeBrotli => "potree-brotli",
        }
    }

    /// The settings that make an engine work so.
    #[must_use]
    pub fn apply(self, config: EngineConfig) -> EngineConfig {
        // No payloads with the first bytes.
        let apart = EngineConfig {
            cell_px: 0.0,
            coalesce: Coalesce::NONE,
            batches: false,
            paces: false,
            cancels: false,
            occlusion: false,
            priority: Priority::Fraiss,
            speculative_bytes: HEADER_BYTES as u64,
            ..config.clone()
        };
        match self {
            Self::Ours => config,
            Self::Potree | Self::PotreeBrotli => {
                let priority = Priority::Size;
                EngineConfig { requests_in_flight: 4, min_size_px: 30.0, priority, ..apart }
            }
            Self::Fraiss => EngineConfig {
                requests_in_flight: 1,
                min_size_px: 10.0,
                order: LoadOrder::Arrival,
                ..apart
            },
        }
    }
}

impl FromStr for Policy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|policy| policy.name() == text);
        found.ok_or_else(|| {
            format!("no policy {text:?}; there are ours, potree, fraiss and potree-brotli")
        })
    }
}
