//! What a load test is told.

use std::time::Duration;

use crate::{
    engine::{EngineConfig, Policy},
    path::PathSource,
    source::LinkSpec,
};

/// Most clients of a run.
pub const MOST_CLIENTS: usize = 10_000;

/// Longest run, in seconds.
pub const MOST_SECONDS: u64 = 3600;

/// A load test: a run for each policy and number of clients, one after the other.
#[derive(Debug, Clone)]
pub struct LoadConfig {
    /// Addresses of datasets that every client looks at together.
    pub sources: Vec<String>,
    /// What the cameras follow, and as it was named.
    pub path: PathSource,
    /// See [`path`](Self::path).
    pub path_name: String,
    /// Numbers of clients.
    pub clients: Vec<usize>,
    /// Ways to fetch.
    pub policies: Vec<Policy>,
    /// How long a run is.
    pub length: Length,
    /// Whether a client keeps what it has loaded when it begins the path anew.
    pub keeps: bool,
    /// Time over which the clients' beginnings are spread.
    pub ramp: Duration,
    /// Each client's own link; none is as fast as it comes.
    pub link: Option<LinkSpec>,
    /// While a camera moves.
    pub views_per_second: f64,
    /// Width and height of the picture that nodes are chosen for.
    pub size_px: [u32; 2],
    /// For [`Policy::Ours`]; what the others need is changed.
    pub engine: EngineConfig,
    /// Most requests of a run.
    pub most_requests: u64,
    /// The server's process, where it is not to be found by its port.
    pub server_pid: Option<u32>,
    /// Threads that the clients share.
    pub threads: usize,
    /// The command line that does the same.
    pub command: String,
}

/// How long a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Length {
    /// So long, however often the path is followed.
    Time(Duration),
    /// Until every client has followed the path so often; [`MOST_SECONDS`] at most.
    Rounds(u32),
}

impl LoadConfig {
    /// Refuses what is out of bounds.
    ///
    /// # Errors
    /// What is, and what would not be.
    pub fn check(&self) -> anyhow::Result<()> {
        let most = Duration::from_secs(MOST_SECONDS);
        for &clients in &self.clients {
            anyhow::ensure!(
                (1..=MOST_CLIENTS).contains(&clients),
                "{clients} clients: a run has 1 to {MOST_CLIENTS}"
            );
        }
        match self.length {
            Length::Time(time) => anyhow::ensure!(
                time >= Duration::from_secs(1) && time <= most,
                "{} s: a run takes 1 to {MOST_SECONDS} seconds",
                time.as_secs_f64()
            ),
            Length::Rounds(0) => anyhow::bail!("0 loops: a client makes at least one"),
            Length::Rounds(_) => {}
        }
        anyhow::ensure!(
            self.ramp <= most,
            "a ramp of {} s: clients begin within {MOST_SECONDS} seconds",
            self.ramp.as_secs_f64()
        );
        anyhow::ensure!(
            (0.1..=120.0).contains(&self.views_per_second),
            "{} views a second: a camera that moves is seen 0.1 to 120 times a second",
            self.views_per_second
        );
        anyhow::ensure!(self.engine.point_budget > 0, "a budget of 0 points asks for nothing");
        Ok(())
    }
}
