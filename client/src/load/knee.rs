//! Where more clients bring less: the knee of throughput against latency.
//!
//! Power is throughput over latency; it is greatest at the knee (Kleinrock 1979). Before it, more clients
//! get more and wait no longer; beyond it, they mostly wait.

use serde::{Deserialize, Serialize};

use super::report::RunReport;
use crate::engine::Policy;

/// Numbers of clients of which one can stand out.
const LEAST_RUNS: usize = 3;

/// The knee of a policy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Knee {
    /// The policy.
    pub policy: Policy,
    /// How many clients have the most power.
    pub clients: usize,
    /// Whether more were tried: if not, the knee lies there or beyond.
    pub is_reached: bool,
    /// Nodes a second over seconds of median wait, by number of clients.
    pub power: Vec<(usize, f64)>,
}

/// The knee of each policy that was run with enough numbers of clients.
#[must_use]
pub fn knees(runs: &[RunReport]) -> Vec<Knee> {
    Policy::ALL.into_iter().filter_map(|policy| knee(runs, policy)).collect()
}

fn knee(runs: &[RunReport], policy: Policy) -> Option<Knee> {
    let of_policy = runs.iter().filter(|run| run.policy == policy);
    let mut power: Vec<(usize, f64)> = of_policy
        .map(|run| {
            // Where not even half came, there is none.
            let power =
                run.nodes.p50_ms.map_or(0.0, |ms| run.nodes_per_second / (ms / 1e3).max(1e-6));
            (run.clients, power)
        })
        .collect();
    power.sort_by_key(|(clients, _)| *clients);
    power.dedup_by_key(|(clients, _)| *clients);
    if power.len() < LEAST_RUNS {
        return None;
    }
    let &(clients, _) = power.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_reached = power.last().is_some_and(|&(most, _)| most > clients);
    Some(Knee { policy, clients, is_reached, power })
}
