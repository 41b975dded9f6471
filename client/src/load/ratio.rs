//! Other policies against ours.

use serde::{Deserialize, Serialize};

use super::report::RunReport;
use crate::engine::Policy;

/// How many times as much a policy takes as ours, with as many clients. None where one of them cannot
/// be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ratios {
    /// The other policy.
    pub policy: Policy,
    /// Of both runs.
    pub clients: usize,
    /// Median time to the first picture after a cold start.
    pub cold_first: Option<f64>,
    /// Median time until all is there after a cold start.
    pub cold_settled: Option<f64>,
    /// Bytes until then.
    pub cold_bytes: Option<f64>,
    /// Requests until then.
    pub cold_requests: Option<f64>,
    /// Median time to the first picture after a jump.
    pub jump_first: Option<f64>,
    /// Median time until all is there after a jump.
    pub jump_settled: Option<f64>,
    /// Bytes until then.
    pub jump_bytes: Option<f64>,
    /// Requests until then.
    pub jump_requests: Option<f64>,
    /// Median wait of a node.
    pub node_p50: Option<f64>,
    /// Wait within which 99 % of nodes come.
    pub node_p99: Option<f64>,
}

/// Every run of another policy against ours with as many clients.
#[must_use]
pub fn ratios(runs: &[RunReport]) -> Vec<Ratios> {
    let others = runs.iter().filter(|run| run.policy != Policy::Ours);
    let pairs = others.filter_map(|other| {
        let is_like = |run: &&RunReport| run.policy == Policy::Ours && run.clients == other.clients;
        Some((other, runs.iter().find(is_like)?))
    });
    pairs.map(|(other, ours)| between(other, ours)).collect()
}

fn between(other: &RunReport, ours: &RunReport) -> Ratios {
    let ratio = |of: &dyn Fn(&RunReport) -> Option<f64>| {
        let (other, ours) = (of(other)?, of(ours)?);
        (ours > 0.0).then(|| other / ours)
    };
    Ratios {
        policy: other.policy,
        clients: other.clients,
        cold_first: ratio(&|run| run.cold.first.p50_ms),
        cold_settled: ratio(&|run| run.cold.settled.p50_ms),
        cold_bytes: ratio(&|run| run.cold.bytes),
        cold_requests: ratio(&|run| run.cold.requests),
        jump_first: ratio(&|run| run.jumps.first.p50_ms),
        jump_settled: ratio(&|run| run.jumps.settled.p50_ms),
        jump_bytes: ratio(&|run| run.jumps.bytes),
        jump_requests: ratio(&|run| run.jumps.requests),
        node_p50: ratio(&|run| run.nodes.p50_ms),
        node_p99: ratio(&|run| run.nodes.p99_ms),
    }
}
