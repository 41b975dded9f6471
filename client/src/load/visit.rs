//! A visitor: a real engine that follows the timetable, and a record of what came of it when.

use std::{collections::HashMap, mem::take, time::Duration};

use lodestream_protocol::NodeKey;
use tokio::{
    sync::watch,
    time::{Instant, sleep_until},
};

use super::{
    awaited::Awaited,
    itinerary::{Itinerary, Stop},
    ledger::{Arrival, Ledger},
};
use crate::engine::{FramePlan, TaskedEngine};

/// How a visit ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ending {
    /// At the path's end.
    Complete,
    /// Because the run was over.
    Stopped,
    /// Because a source can no longer be read; says why.
    Failed(String),
}

/// What there is to follow, and for how long.
#[derive(Debug)]
pub struct Course<'a> {
    /// The timetable.
    pub itinerary: &'a Itinerary,
    /// Number of the stop to begin at.
    pub first: usize,
    /// Rounds to make, with what the ones before have loaded.
    pub rounds: u32,
    /// When the first view is due.
    pub begin: Instant,
}

/// Follows the course with `engine`; what happens is written into `ledger`.
pub async fn visit(
    mut engine: TaskedEngine,
    course: &Course<'_>,
    ledger: &Ledger,
    stopped: &mut watch::Receiver<bool>,
) -> Ending {
    ledger.add(|entries| entries.begun += 1);
    let mut log = Log::new(ledger, course.begin);
    let ending = follow(&mut engine, course, &mut log, stopped).await;
    log.end(&engine, &ending);
    ending
}

async fn follow(
    engine: &mut TaskedEngine,
    course: &Course<'_>,
    log: &mut Log<'_>,
    stopped: &mut watch::Receiver<bool>,
) -> Ending {
    for round in 0..course.rounds {
        let begin = course.begin + course.itinerary.duration() * round;
        for stop in course.itinerary.round(course.first) {
            let due = begin + stop.at;
            if let Some(ending) = work_until(due, engine, log, stopped).await {
                return ending;
            }
            log.set_view(engine, due, &stop);
        }
    }
    let end = course.begin + course.itinerary.duration() * course.rounds;
    work_until(end, engine, log, stopped).await.unwrap_or(Ending::Complete)
}

/// Lets the engine work; `None` once it is time.
async fn work_until(
    due: Instant,
    engine: &mut TaskedEngine,
    log: &mut Log<'_>,
    stopped: &mut watch::Receiver<bool>,
) -> Option<Ending> {
    loop {
        tokio::select! {
            // In this order, so that a server which keeps an engine busy does not keep the camera.
            biased;
            // A sender that is gone has stopped, too.
            _ = stopped.wait_for(|stopped| *stopped) => return Some(Ending::Stopped),
            () = sleep_until(due) => return None,
            plan = engine.next_plan() => {
                log.note_nodes(engine);
                let failure = engine.look_at_clouds(|clouds| {
                    clouds.iter().find_map(|cloud| cloud.failure.clone())
                });
                if let Some(why) = failure {
                    // What its engine has settled on is no picture of the dataset.
                    return Some(Ending::Failed(why));
                }
                log.note_picture(engine, &plan);
            }
        }
    }
}

/// What a visitor remembers.
struct Log<'a> {
    ledger: &'a Ledger,
    /// Number of the newest view.
    generation: u64,
    /// When the newest view was due.
    due: Instant,
    /// When the oldest view was due that no plan has answered yet.
    unanswered: Option<Instant>,
    awaited: Awaited,
    /// Bytes of nodes that were drawn, by cloud and node.
    used: HashMap<(usize, NodeKey), u64>,
    picture: Option<Picture>,
}

/// A picture that is coming in.
#[derive(Debug, Clone, Copy)]
struct Picture {
    due: Instant,
    is_cold: bool,
    generation: u64,
    bytes_before: u64,
    requests_before: u64,
    first: Option<Duration>,
    settled: Option<(Duration, u64, u64)>,
}

impl<'a> Log<'a> {
    fn new(ledger: &'a Ledger, begin: Instant) -> Self {
        Self {
            ledger,
            generation: 0,
            due: begin,
            unanswered: None,
            awaited: Awaited::default(),
            used: HashMap::new(),
            picture: None,
        }
    }

    /// Sets the view that is due.
    fn set_view(&mut self, engine: &TaskedEngine, due: Instant, stop: &Stop) {
        let generation = engine.set_view(stop.view);
        self.ledger.add_late(due.elapsed());
        if generation == self.generation {
            // What is seen already brings no news.
            return;
        }
        let is_cold = self.generation == 0;
        self.generation = generation;
        self.due = due;
        self.unanswered.get_or_insert(due);
        if is_cold || stop.is_jump {
            self.end_picture(due);
            let totals = engine.stats().since_start.totals;
            // What was asked for before the first view was asked for because of it.
            let (bytes_before, requests_before) =
                if is_cold { (0, 0) } else { (totals.bytes, totals.requests) };
            self.picture = Some(Picture {
                due,
                is_cold,
                generation,
                bytes_before,
                requests_before,
                first: None,
                settled: None,
            });
        }
    }

    /// A plan has come: what it wants.
    fn note_nodes(&mut self, engine: &TaskedEngine) {
        let now = Instant::now();
        let due = self.unanswered.take().unwrap_or(self.due);
        let (wanted, mut waits): (Vec<_>, _) = (engine.wanted().collect(), Vec::new());
        self.awaited.note(due, &wanted, engine.missing_pages(), now, &mut waits);
        self.ledger.add_nodes(&waits);
        for node in wanted.iter().filter(|node| node.is_there) {
            // More where it is drawn more exactly than before.
            let used = self.used.entry((node.cloud, node.key)).or_default();
            *used = node.bytes.max(*used);
        }
    }

    /// A plan has come: what it shows.
    fn note_picture(&mut self, engine: &TaskedEngine, plan: &FramePlan) {
        let Some(picture) = &mut self.picture else { return };
        if plan.view_generation < picture.generation || picture.settled.is_some() {
            return;
        }
        let wait = picture.due.elapsed();
        if plan.points > 0 {
            picture.first.get_or_insert(wait);
        }
        if plan.settled {
            let totals = engine.stats().since_start.totals;
            let bytes = totals.bytes - picture.bytes_before;
            picture.settled = Some((wait, bytes, totals.requests - picture.requests_before));
            // A picture of nothing is there at once.
            picture.first.get_or_insert(wait);
        }
    }

    fn end_picture(&mut self, now: Instant) {
        if let Some(picture) = self.picture.take() {
            let Picture { is_cold, first, settled, due, .. } = picture;
            let watched = now.saturating_duration_since(due);
            self.ledger.add_arrival(Arrival { is_cold, first, settled, watched });
        }
    }

    /// The visit is over.
    fn end(mut self, engine: &TaskedEngine, ending: &Ending) {
        let now = Instant::now();
        self.end_picture(now);
        let left: Vec<_> = take(&mut self.awaited).give_up(now).collect();
        self.ledger.add_nodes(&left);
        let stats = engine.stats();
        let totals = stats.since_start.totals;
        let index = engine.look_at_clouds(|clouds| {
            let boots = clouds.iter().filter_map(|cloud| cloud.boot.as_ref());
            boots.map(|boot| boot.header.index_bytes()).sum::<u64>()
        });
        let drawn: u64 = self.used.values().sum();
        let used = (drawn + index + totals.page_bytes).min(totals.bytes);
        self.ledger.add(|entries| {
            entries.add_totals(totals);
            entries.used_bytes += used;
            stats.problems.iter().for_each(|problem| entries.add_problem(problem.clone()));
            match ending {
                Ending::Complete => entries.complete += 1,
                Ending::Stopped => {}
                Ending::Failed(why) => {
                    entries.failed += 1;
                    entries.add_problem(why.clone());
                }
            }
        });
    }
}
