//! All clients of a run, on a few threads.
//!
//! Every client is a task with an engine and connections of its own. They share the runtime, the indices of
//! the datasets (`Commons`), the meter of their requests and the book. Nothing waits for the server but
//! the engines: views are set by the clock, visitors come and go by the clock.

use std::{
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    time::Duration,
};

use anyhow::Context;
use tokio::{
    sync::watch,
    task::JoinSet,
    time::{Instant, MissedTickBehavior, interval, sleep, sleep_until},
};

use super::{
    config::{Length, LoadConfig, MOST_SECONDS},
    itinerary::Itinerary,
    ledger::{Entries, Ledger},
    process::{ProcessReport, Usage, Watched},
    visit::{Course, Ending, visit},
};
use crate::{
    engine::{Commons, EngineConfig, Payloads, Policy, TaskedEngine},
    source::{Counted, Link, Meter, Source, SourceError, Wire},
};

/// Stretches of time of a run that are told apart, at most.
const MOST_INTERVALS: u64 = 240;

/// Between two looks at processes and at the wish to end.
const LOOK: Duration = Duration::from_millis(250);

/// A visitor whose source has failed comes back after this time.
const PAUSE: Duration = Duration::from_secs(1);

/// How long clients may take to leave.
const LEAVE: Duration = Duration::from_secs(10);

/// How a run is going.
#[derive(Debug, Clone, Copy, Default)]
pub struct Standing {
    /// Since the start.
    pub elapsed: Duration,
    /// When it will be over, where that is known.
    pub length: Option<Duration>,
    /// Requests sent.
    pub requests: u64,
    /// Bytes received.
    pub bytes: u64,
    /// Requests on their way.
    pub in_flight: u64,
    /// Failures.
    pub faults: u64,
    /// Nodes that came.
    pub nodes: u64,
    /// Milliseconds within which 99 % of nodes come.
    pub p99_ms: Option<f64>,
    /// What the server takes, where that can be seen.
    pub server: Option<Usage>,
}

/// What a look at processes showed.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    /// Since the start.
    pub at: Duration,
    /// The server's, where that can be seen.
    pub server: Option<Usage>,
    /// This program's.
    pub own: Option<Usage>,
}

/// What came of a run.
#[derive(Debug)]
pub struct Outcome {
    /// How long it was.
    pub elapsed: Duration,
    /// Of the stretches that it is told in.
    pub interval: Duration,
    /// The clients' book.
    pub entries: Entries,
    /// Requests sent.
    pub requests: u64,
    /// Bytes received.
    pub bytes: u64,
    /// What became of them.
    pub counted: Counted,
    /// The server's processes, where they can be seen.
    pub server: Option<ProcessReport>,
    /// This process.
    pub own: Option<ProcessReport>,
    /// Looks at both.
    pub looks: Vec<Look>,
    /// Whether it was ended by the limit on requests.
    pub is_spent: bool,
    /// Whether it was broken off.
    pub is_interrupted: bool,
}

/// What the clients of a run have in common.
struct Crowd {
    sources: Vec<String>,
    itinerary: Arc<Itinerary>,
    clients: usize,
    engine: EngineConfig,
    link: Option<crate::source::LinkSpec>,
    keeps: bool,
    rounds: u32,
    ramp: Duration,
    start: Instant,
    commons: Arc<Commons>,
    meter: Arc<Meter>,
    ledger: Ledger,
}

/// Runs `clients` by `policy`. `tell` is told how it is going.
///
/// # Errors
/// Where the system gives no threads.
pub fn run(
    config: &LoadConfig,
    itinerary: &Arc<Itinerary>,
    policy: Policy,
    clients: usize,
    server: &[u32],
    cancel: &AtomicBool,
    tell: &(dyn Fn(&Standing) + Sync),
) -> anyhow::Result<Outcome> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(config.threads.max(1))
        .thread_name("client")
        .enable_all()
        .build()
        .context("cannot start the clients' threads")?;
    let outcome = runtime.block_on(async {
        let (interval, intervals) = intervals(config, itinerary);
        let start = Instant::now();
        let engine = EngineConfig {
            payloads: Payloads::Count,
            // There are no pictures to look behind.
            occlusion: false,
            ..policy.apply(config.engine.clone())
        };
        let (rounds, keeps) = match config.length {
            Length::Rounds(rounds) => (rounds, config.keeps),
            Length::Time(_) => (u32::MAX, config.keeps),
        };
        let crowd = Crowd {
            sources: config.sources.clone(),
            itinerary: Arc::clone(itinerary),
            clients,
            engine,
            link: config.link,
            keeps,
            rounds,
            ramp: config.ramp,
            start,
            commons: Arc::default(),
            meter: Arc::new(Meter::new(start, interval, config.most_requests)),
            ledger: Ledger::new(start, interval, intervals),
        };
        attend(Arc::new(crowd), config.length, server, interval, cancel, tell).await
    });
    // Does not wait for a name server that hangs.
    runtime.shutdown_background();
    Ok(outcome)
}

/// How long a run will be, and the stretches that it is told in.
fn intervals(config: &LoadConfig, itinerary: &Itinerary) -> (Duration, usize) {
    let most = Duration::from_secs(MOST_SECONDS);
    let expected = match config.length {
        Length::Time(time) => time,
        Length::Rounds(rounds) => {
            itinerary.duration().saturating_mul(rounds).saturating_add(config.ramp).min(most)
        }
    };
    let seconds = expected.as_secs_f64().ceil().max(1.0) as u64;
    let step = [1, 2, 5, 10, 15].into_iter().find(|step| seconds / step < MOST_INTERVALS);
    let step = step.unwrap_or(15);
    let count = usize::try_from(seconds.div_ceil(step) + 1).unwrap_or(1);
    (Duration::from_secs(step), count)
}

/// Lets the clients in, looks on, and lets them out.
async fn attend(
    crowd: Arc<Crowd>,
    length: Length,
    server: &[u32],
    stretch: Duration,
    cancel: &AtomicBool,
    tell: &(dyn Fn(&Standing) + Sync),
) -> Outcome {
    let (stop, stopped) = watch::channel(false);
    let mut server = Watched::new(server.to_vec());
    let mut own = Watched::new(vec![std::process::id()]);
    let mut seats = JoinSet::new();
    for number in 0..crowd.clients {
        seats.spawn(seat(Arc::clone(&crowd), number, stopped.clone()));
    }
    let length = match length {
        Length::Time(time) => time,
        Length::Rounds(_) => Duration::from_secs(MOST_SECONDS),
    };
    let end = crowd.start + length;
    let shown = (crowd.rounds == u32::MAX).then_some(length);
    let mut looks = Vec::new();
    let mut ticks = interval(LOOK);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut is_interrupted = false;
    loop {
        tokio::select! {
            biased;
            () = sleep_until(end) => {
                if shown.is_none() {
                    let why = format!("broken off after {MOST_SECONDS} s, the longest that a run may be");
                    crowd.ledger.add(|entries| entries.add_problem(why));
                }
                break;
            }
            _ = ticks.tick() => {
                let look = Look {
                    at: crowd.start.elapsed(),
                    server: server.as_mut().map(Watched::look),
                    own: own.as_mut().map(Watched::look),
                };
                looks.push(look);
                tell(&crowd.standing(look, shown));
                is_interrupted = cancel.load(Ordering::Relaxed);
                if is_interrupted || crowd.meter.is_spent() {
                    break;
                }
            }
            ended = seats.join_next() => if ended.is_none() { break },
        }
    }
    let elapsed = crowd.start.elapsed();
    for watched in [&mut server, &mut own].into_iter().flatten() {
        watched.look();
    }
    stop.send_replace(true);
    let left = async { while seats.join_next().await.is_some() {} };
    if tokio::time::timeout(LEAVE, left).await.is_err() {
        tracing::warn!("{} clients do not leave", seats.len());
        seats.shutdown().await;
    }
    Outcome {
        elapsed,
        interval: stretch,
        entries: crowd.ledger.read(),
        requests: crowd.meter.requests(),
        bytes: crowd.meter.bytes(),
        counted: crowd.meter.counted(),
        server: server.map(|watched| watched.report(elapsed.as_secs_f64())),
        own: own.map(|watched| watched.report(elapsed.as_secs_f64())),
        looks,
        is_spent: crowd.meter.is_spent(),
        is_interrupted,
    }
}

/// A place that visitors take one after the other.
async fn seat(crowd: Arc<Crowd>, number: usize, mut stopped: watch::Receiver<bool>) {
    let mut begin = crowd.start + crowd.ramp.mul_f64(number as f64 / crowd.clients as f64);
    let (mut left, mut turn) = (crowd.rounds, 0);
    while left > 0 {
        let rounds = if crowd.keeps { left } else { 1 };
        tokio::select! {
            biased;
            _ = stopped.wait_for(|stopped| *stopped) => return,
            () = sleep_until(begin) => {}
        }
        let sources = match crowd.sources() {
            Ok(sources) => sources,
            Err(error) => {
                crowd.ledger.add(|entries| {
                    entries.failed += 1;
                    entries.add_problem(error.to_string());
                });
                return;
            }
        };
        let engine = TaskedEngine::start(sources, crowd.engine.clone(), Arc::clone(&crowd.commons));
        // So that visitors who follow one another do not begin at the same place.
        let first = crowd.itinerary.offset(number + turn * crowd.clients);
        turn += 1;
        let course = Course { itinerary: &crowd.itinerary, first, rounds, begin };
        match visit(engine, &course, &crowd.ledger, &mut stopped).await {
            Ending::Stopped => return,
            Ending::Complete => {
                left -= rounds;
                begin += crowd.itinerary.duration();
            }
            Ending::Failed(_) if crowd.meter.is_spent() => return,
            Ending::Failed(_) => {
                // The round that was begun counts as well: a run ends though the host does not come back.
                let round = crowd.itinerary.duration().as_secs_f64().max(1e-3);
                let walked = (begin.elapsed().as_secs_f64() / round) as u32;
                left = left.saturating_sub(walked.min(rounds - 1) + 1);
                sleep(PAUSE.mul_f64(0.5 + fastrand::f64())).await;
                begin = Instant::now();
            }
        }
    }
}

impl Crowd {
    /// Connections and a link for one visitor.
    fn sources(&self) -> Result<Vec<Source>, SourceError> {
        let link = self.link.map(|spec| Link::new(spec, 0));
        let wire = Wire { link, meter: Some(Arc::clone(&self.meter)) };
        self.sources.iter().map(|text| Source::by_wire(text, wire.clone())).collect()
    }

    fn standing(&self, look: Look, length: Option<Duration>) -> Standing {
        let (nodes, p99_ms) =
            self.ledger.look(|entries| (entries.nodes.count(), entries.nodes.quantile_ms(0.99)));
        Standing {
            elapsed: look.at,
            length,
            requests: self.meter.requests(),
            bytes: self.meter.bytes(),
            in_flight: self.meter.in_flight(),
            faults: self.meter.faults(),
            nodes,
            p99_ms,
            server: look.server,
        }
    }
}
