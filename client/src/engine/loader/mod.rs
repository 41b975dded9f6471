//! The loader thread: turns demands into requests, and answers into events.
//!
//! Owned by the engine; owns an async runtime of one thread, which all requests run on; decoding
//! goes to the rayon pool. A demand replaces the one before: what is no longer wanted is forgotten
//! if it was queued, and broken off if it was in flight and not nearly done. Failures of a host
//! pause that host, failures of a piece pause that piece; neither ends anything.

mod coalesce;
mod cutter;
mod decode;
mod flight;
mod open;
mod pace;
mod pieces;

use std::{
    collections::{HashMap, HashSet},
    sync::{Arc, atomic::Ordering},
};

use bytes::Bytes;
use lodestream_protocol::{Boot, Error};
use tokio::{
    sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel},
    task::JoinSet,
    // Its clock can be a simulated one.
    time::Instant,
};

use crate::source::{Backoff, Source, SourceError};

use self::{
    coalesce::Wanted,
    decode::Decoded,
    flight::{Delivered, Flight, FlightId},
    open::Opening,
    pace::Pace,
    pieces::{PieceState, Pieces},
};
use super::{
    commons::Commons,
    config::{EngineConfig, LoadOrder},
    event::Event,
    inbox::Demand,
    piece::{Part, Piece, PieceId},
    shared::Shared,
};

/// No request is started while more decoded bytes than this wait for the traversal.
const MAX_BACKLOG_BYTES: u64 = 128 << 20;

/// A piece that arrived damaged this often is damaged at the source.
const MAX_DAMAGED: u32 = 3;

/// What the loader's tasks tell it. At most one message per piece and request is ever waiting.
#[derive(Debug)]
enum Message {
    /// More of a cloud's first bytes has come.
    Opening {
        cloud: usize,
        opening: Opening,
    },
    /// A cloud can never be opened.
    Unopened {
        cloud: usize,
        message: String,
    },
    /// The piece with that index among the flight's.
    Arrived {
        flight: FlightId,
        index: usize,
        bytes: Bytes,
    },
    /// A request has so little to come that the next may be sent.
    Nearing,
    Finished {
        flight: FlightId,
        result: Result<(), SourceError>,
    },
    Decoded {
        piece: PieceId,
        result: Result<Decoded, Error>,
    },
}

/// What the loader knows of a cloud.
#[derive(Debug)]
struct Cloud {
    source: Source,
    boot: Option<Arc<Boot>>,
    /// The first bytes of the file, and how many of them will come in all.
    prefix: Bytes,
    prefix_end: u64,
    /// Bytes of payloads and pages that have come.
    delivered: Arc<Delivered>,
    pace: Pace,
    /// Failed requests in a row.
    failures: u32,
    /// No request before then.
    not_before: Option<Instant>,
    failed: bool,
}

impl Cloud {
    /// Bytes of the prefix that are still to come.
    fn prefix_left(&self) -> u64 {
        self.prefix_end.saturating_sub(self.prefix.len() as u64)
    }
}

/// The thread's state.
pub(super) struct Loader {
    shared: Arc<Shared>,
    config: EngineConfig,
    clouds: Vec<Cloud>,
    demand: Vec<Piece>,
    /// When each wanted piece was first wanted, where pieces are loaded in that order.
    turns: HashMap<PieceId, u64>,
    next_turn: u64,
    pieces: Pieces,
    flights: HashMap<FlightId, Flight>,
    next_flight: FlightId,
    /// Decode at once, on this thread: simulated time must not pass meanwhile.
    decode_inline: bool,
    /// Where other engines may have the same index.
    commons: Option<Arc<Commons>>,
    sender: UnboundedSender<Message>,
    receiver: UnboundedReceiver<Message>,
}

impl Loader {
    pub fn new(shared: Arc<Shared>, config: EngineConfig, sources: Vec<Source>) -> Self {
        let (sender, receiver) = unbounded_channel();
        let clouds = sources.into_iter().map(|source| Cloud {
            source,
            boot: None,
            prefix: Bytes::new(),
            prefix_end: 0,
            delivered: Arc::default(),
            pace: Pace::default(),
            failures: 0,
            not_before: None,
            failed: false,
        });
        Self {
            shared,
            config,
            clouds: clouds.collect(),
            demand: Vec::new(),
            turns: HashMap::new(),
            next_turn: 0,
            pieces: Pieces::default(),
            flights: HashMap::new(),
            next_flight: 0,
            decode_inline: false,
            commons: None,
            sender,
            receiver,
        }
    }

    /// The same, decoding on its own thread.
    pub fn decoding_inline(self) -> Self {
        Self { decode_inline: true, ..self }
    }

    /// The same, keeping what is equal in other engines once.
    pub fn sharing(self, commons: Arc<Commons>) -> Self {
        Self { commons: Some(commons), ..self }
    }

    /// Runs until the inbox says to end.
    pub async fn run(mut self) {
        // Broken off when they are dropped, as flights are.
        let mut openings = JoinSet::new();
        for cloud in 0..self.clouds.len() {
            let (shared, sender) = (Arc::clone(&self.shared), self.sender.clone());
            let source = self.clouds[cloud].source.clone();
            let speculative = self.config.speculative_bytes;
            openings.spawn(async move {
                // The loader outlives its tasks, save when it shuts down.
                let tell = |opening| _ = sender.send(Message::Opening { cloud, opening });
                let result = open::open(&shared, cloud, &source, speculative, tell).await;
                if let Err(message) = result {
                    let _ = sender.send(Message::Unopened { cloud, message });
                }
            });
        }
        loop {
            let shared = Arc::clone(&self.shared);
            let retry = self.next_retry();
            // In this order, so that a simulated run repeats; all of them are looked at each time.
            tokio::select! {
                biased;
                mail = shared.loader.take() => {
                    if mail.shutdown {
                        return;
                    }
                    if let Some(demand) = mail.demand {
                        self.accept(demand);
                    }
                }
                // The loader holds a sender itself: there is always a next message.
                Some(message) = self.receiver.recv() => self.handle(message),
                () = sleep_until(retry) => {}
            }
            while let Ok(message) = self.receiver.try_recv() {
                self.handle(message);
            }
            self.dispatch();
        }
    }

    /// A new demand replaces the old one.
    fn accept(&mut self, demand: Demand) {
        self.demand = demand.pieces;
        let wanted: HashSet<_> = self.demand.iter().map(|piece| piece.id).collect();
        self.pieces.update(&wanted, demand.seen);
        if self.config.order == LoadOrder::Arrival {
            self.take_turns(&wanted);
        }
        if !self.config.cancels {
            return;
        }
        let pieces = &self.pieces;
        let stale = self.flights.extract_if(|id, flight| {
            let mut open = flight.pieces.iter().filter(|piece| pieces.is_loading(piece.id, *id));
            !open.any(|piece| wanted.contains(&piece.id)) && !flight.is_nearly_done()
        });
        let stale: Vec<_> = stale.collect();
        for (id, flight) in stale {
            self.shared.counters.cancelled.add(1);
            self.break_off(id, &flight);
        }
    }

    /// Puts the demand into the order in which its pieces were first wanted.
    fn take_turns(&mut self, wanted: &HashSet<PieceId>) {
        self.turns.retain(|id, _| wanted.contains(id));
        for piece in &self.demand {
            self.turns.entry(piece.id).or_insert_with(|| {
                self.next_turn += 1;
                self.next_turn
            });
        }
        self.demand.sort_by_key(|piece| self.turns.get(&piece.id).copied());
    }

    fn break_off(&mut self, id: FlightId, flight: &Flight) {
        flight.abort();
        for piece in &flight.pieces {
            if self.pieces.is_loading(piece.id, id) {
                self.pieces.clear(piece.id);
            }
        }
    }

    fn handle(&mut self, message: Message) {
        match message {
            Message::Opening { cloud, opening } => self.take_opening(cloud, opening),
            Message::Unopened { cloud, message } => self.fail_cloud(cloud, message),
            Message::Arrived { flight, index, bytes } => {
                let Some(flight_) = self.flights.get(&flight) else { return };
                let piece = flight_.pieces[index].clone();
                if self.pieces.is_loading(piece.id, flight) {
                    self.start_decoding(piece, bytes);
                }
            }
            // What may be sent is, after every message.
            Message::Nearing => {}
            Message::Finished { flight, result } => {
                // A flight that was broken off is no longer there.
                if let Some(ended) = self.flights.remove(&flight) {
                    self.finish(flight, &ended, result);
                }
            }
            Message::Decoded { piece, result } => self.deliver(piece, result),
        }
    }

    fn take_opening(&mut self, cloud: usize, opening: Opening) {
        let known = &mut self.clouds[cloud];
        let is_whole = opening.prefix.len() as u64 >= opening.expected;
        known.prefix = match &self.commons {
            Some(commons) if is_whole => commons.prefix(&opening.boot, opening.prefix),
            _ => opening.prefix,
        };
        known.prefix_end = opening.expected;
        if known.boot.is_none() {
            let boot = match &self.commons {
                Some(commons) => commons.boot(opening.boot),
                None => opening.boot,
            };
            known.boot = Some(Arc::clone(&boot));
            self.shared.traversal.post(Event::Opened { cloud, boot });
        }
    }

    fn start_decoding(&mut self, piece: Piece, bytes: Bytes) {
        let Some(boot) = self.clouds[piece.id.node.cloud].boot.clone() else { return };
        let size = decode::decoded_bytes(&piece, &boot.manifest);
        self.pieces.set(piece.id, PieceState::Decoding { bytes: size });
        if piece.id.part == Part::Page {
            self.shared.counters.page_bytes.add(piece.len);
        }
        let (shared, sender) = (Arc::clone(&self.shared), self.sender.clone());
        let payloads = self.config.payloads;
        let work = move || {
            let (result, nanos) = decode::decode(&piece, &boot, &bytes, payloads);
            shared.counters.decode_nanos.add(nanos);
            let _ = sender.send(Message::Decoded { piece: piece.id, result });
        };
        if self.decode_inline {
            work();
        } else {
            rayon::spawn(work);
        }
    }

    fn deliver(&mut self, id: PieceId, result: Result<Decoded, Error>) {
        if !matches!(self.pieces.get(id), Some(PieceState::Decoding { .. })) {
            return;
        }
        let cloud = &mut self.clouds[id.node.cloud];
        let event = match result {
            Ok(decoded) => {
                self.shared.counters.decoded_nodes.add(1);
                match (decoded, id.part) {
                    (Decoded::Group(content), Part::Group(group)) => {
                        Event::Group { node: id.node, group, content }
                    }
                    (Decoded::Page(page), _) => {
                        Event::Page { cloud: id.node.cloud, parent: id.node.key, page }
                    }
                    (Decoded::Group(_), Part::Page) => return,
                }
            }
            Err(error) => {
                self.shared.counters.damaged.add(1);
                // Should the damage be in the bytes at hand, the next try must not use them.
                cloud.prefix = Bytes::new();
                cloud.prefix_end = 0;
                let failures = self.pieces.count_damaged(id);
                if failures < MAX_DAMAGED {
                    let until = Instant::now() + Backoff::default().delay(failures);
                    self.pieces.set(id, PieceState::Failed { until });
                    return;
                }
                let place = cloud.source.describe();
                let message = format!("{place}: node {}: {error}; left out", id.node.key);
                Event::Lost { piece: id, message }
            }
        };
        let number = self.shared.traversal.post(event);
        self.pieces.deliver(id, number);
    }

    /// A request has ended, well or not.
    fn finish(&mut self, id: FlightId, flight: &Flight, result: Result<(), SourceError>) {
        let cloud = &mut self.clouds[flight.cloud];
        let error = match result {
            Ok(()) => {
                let delivered = cloud.delivered.bytes.load(Ordering::Relaxed);
                if let Some((wait, bytes, time)) = flight.measured(delivered) {
                    cloud.pace.note(wait, bytes, time);
                }
                cloud.not_before = None;
                if std::mem::take(&mut cloud.failures) > 0 {
                    self.shared.board.post(|news| news.clouds[flight.cloud].trouble = None);
                }
                return;
            }
            Err(error) => error,
        };
        if !error.is_transient() {
            self.fail_cloud(flight.cloud, error.to_string());
            self.break_off(id, flight);
            return;
        }
        self.shared.counters.retries.add(1);
        self.shared.board.post(|news| news.clouds[flight.cloud].trouble = Some(error.to_string()));
        cloud.failures = cloud.failures.saturating_add(1);
        cloud.not_before = Some(Instant::now() + Backoff::default().delay(cloud.failures));
        let missing = flight.pieces.iter().filter(|piece| self.pieces.is_loading(piece.id, id));
        let missing: Vec<_> = missing.map(|piece| piece.id).collect();
        for (index, id) in missing.into_iter().enumerate() {
            // The first that did not arrive is where it went wrong; the rest are bystanders.
            if index == 0 {
                let failures = self.pieces.count_broken(id);
                let until = Instant::now() + Backoff::default().delay(failures);
                self.pieces.set(id, PieceState::Failed { until });
            } else {
                self.pieces.clear(id);
            }
        }
    }

    /// Nothing more can be had from that cloud.
    fn fail_cloud(&mut self, cloud: usize, message: String) {
        if std::mem::replace(&mut self.clouds[cloud].failed, true) {
            return;
        }
        let flights: Vec<_> = self.flights.extract_if(|_, f| f.cloud == cloud).collect();
        for (id, flight) in flights {
            self.break_off(id, &flight);
        }
        self.shared.traversal.post(Event::CloudFailed { cloud, message });
    }

    /// Starts what may be started.
    fn dispatch(&mut self) {
        let now = Instant::now();
        self.take_from_prefixes(now);
        let free = self.config.requests_in_flight.max(1).saturating_sub(self.flights.len());
        if free > 0 && self.pieces.backlog_bytes() <= MAX_BACKLOG_BYTES {
            for run in self.runs(now).into_iter().take(free) {
                self.start_flight(run);
            }
            if self.config.paces {
                self.wait_for_turns();
            }
        }
        let queued = self.demand.iter().filter(|piece| self.pieces.get(piece.id).is_none()).count();
        self.shared.counters.queued.set(queued as u64);
        self.shared.counters.in_flight.set(self.flights.len() as u64);
    }

    /// Decodes wanted pieces whose bytes came with the first answer, and those without bytes.
    fn take_from_prefixes(&mut self, now: Instant) {
        let mut found = Vec::new();
        for piece in &self.demand {
            let cloud = &self.clouds[piece.id.node.cloud];
            let here = if piece.len == 0 {
                Some(Bytes::new())
            } else {
                let range =
                    usize::try_from(piece.offset).ok().zip(usize::try_from(piece.end()).ok());
                range
                    .filter(|&(start, end)| start < end && end <= cloud.prefix.len())
                    .map(|(start, end)| cloud.prefix.slice(start..end))
            };
            if let Some(bytes) = here
                && !cloud.failed
                && self.pieces.is_free(piece.id, now)
            {
                found.push((piece.clone(), bytes));
            }
        }
        for (piece, bytes) in found {
            self.start_decoding(piece, bytes);
        }
    }

    /// The requests that the demand comes to, most important first.
    fn runs(&self, now: Instant) -> Vec<Vec<Piece>> {
        let mut wanted: Vec<Vec<Wanted>> = vec![Vec::new(); self.clouds.len()];
        // What matters less does not ride along while what matters more waits.
        let clouds = 0..self.clouds.len();
        let mut allowed: Vec<_> = clouds.map(|cloud| self.allowance(cloud)).collect();
        for (rank, piece) in self.demand.iter().enumerate() {
            let cloud = &self.clouds[piece.id.node.cloud];
            let paused = cloud.not_before.is_some_and(|until| until > now);
            let on_its_way = piece.end() <= cloud.prefix_end;
            if !paused && !cloud.failed && !on_its_way && self.pieces.is_free(piece.id, now) {
                // The last may be longer: one piece at least.
                let allowed = &mut allowed[piece.id.node.cloud];
                if *allowed == 0 {
                    continue;
                }
                *allowed = allowed.saturating_sub(piece.len);
                let alone = self.pieces.needs_own_request(piece.id);
                let wanted = &mut wanted[piece.id.node.cloud];
                wanted.push(Wanted { rank, offset: piece.offset, len: piece.len, alone });
            }
        }
        let coalesced =
            wanted.into_iter().flat_map(|w| coalesce::coalesce(w, self.config.coalesce));
        let mut runs: Vec<_> = coalesced.collect();
        runs.sort_by_key(|run| run.rank());
        let pieces = runs
            .iter()
            .map(|run| run.parts.iter().map(|part| self.demand[part.rank].clone()).collect());
        pieces.collect()
    }

    /// Bytes that may be asked for of a cloud: none while those in flight keep its link busy.
    fn allowance(&self, cloud: usize) -> u64 {
        if !self.config.paces {
            return u64::MAX;
        }
        let flights = self.flights.values().filter(|flight| flight.cloud == cloud);
        let left: u64 = flights.map(Flight::left_bytes).sum();
        let left = left + self.clouds[cloud].prefix_left();
        let limit = self.clouds[cloud].pace.limit_bytes();
        if left > limit { 0 } else { 2 * limit - left }
    }

    /// Has it told when more may be asked for.
    fn wait_for_turns(&self) {
        for (index, cloud) in self.clouds.iter().enumerate() {
            let flights = self.flights.values().filter(|flight| flight.cloud == index);
            let left: u64 = flights.map(Flight::left_bytes).sum();
            let turn = left.saturating_sub(cloud.pace.limit_bytes());
            let delivered = cloud.delivered.bytes.load(Ordering::Relaxed);
            cloud.delivered.waited_for.store(delivered + turn, Ordering::Relaxed);
        }
    }

    fn start_flight(&mut self, pieces: Vec<Piece>) {
        let Some(first) = pieces.first() else { return };
        let cloud = &self.clouds[first.id.node.cloud];
        let (source, delivered) = (cloud.source.clone(), Arc::clone(&cloud.delivered));
        let id = self.next_flight;
        self.next_flight += 1;
        for piece in &pieces {
            self.pieces.set(piece.id, PieceState::Loading { flight: id });
        }
        let shared = Arc::clone(&self.shared);
        let sender = self.sender.clone();
        let flight = Flight::start(id, source, pieces, shared, sender, delivered);
        self.flights.insert(id, flight);
    }

    /// When something that waits after a failure may go on.
    fn next_retry(&self) -> Option<Instant> {
        let now = Instant::now();
        let pieces = self.demand.iter().filter_map(|piece| self.pieces.retry_at(piece.id));
        let wanted: HashSet<_> = self.demand.iter().map(|piece| piece.id.node.cloud).collect();
        let clouds = wanted.into_iter().filter_map(|cloud| self.clouds[cloud].not_before);
        // What is past waits for a free request, not for the clock.
        clouds.chain(pieces).filter(|&at| at > now).min()
    }
}

async fn sleep_until(at: Option<Instant>) {
    match at {
        Some(at) => tokio::time::sleep_until(at).await,
        None => std::future::pending().await,
    }
}
