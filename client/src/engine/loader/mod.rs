//! The loader thread: turns demands into requests, and answers into events.
//!
//! Owned by the engine; owns an async runtime of one thread, which all requests run on, and the threads that
//! decode. A demand replaces the one before: what is no longer wanted is forgotten
//! if it was queued, and broken off if it was in flight and not nearly done. Failures of a host
//! pause that host, failures of a piece pause that piece; neither ends anything. What ends a cloud ends
//! that cloud alone, until it can be opened again (`openings.rs`).

mod cloud;
mod coalesce;
mod cutter;
mod decode;
mod flight;
mod open;
mod openings;
mod pace;
mod pieces;
#[cfg(test)]
mod tests;

use std::{
    collections::{BTreeMap, BTreeSet, HashMap, HashSet},
    sync::{Arc, atomic::Ordering},
};

use bytes::Bytes;
use lodestream_protocol::Error;
use tokio::{
    sync::{
        Semaphore,
        mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel},
    },
    // Its clock can be a simulated one.
    time::Instant,
};

use crate::source::{Backoff, Connections, Source, SourceError};

use self::{
    cloud::Cloud,
    coalesce::{Run, Wanted},
    decode::Decoded,
    flight::{Flight, FlightId},
    open::Opening,
    openings::{OpeningId, OpeningTask},
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

/// No piece is asked for that is longer, or becomes larger: such are not what they seem.
const MAX_PIECE_BYTES: u64 = 256 << 20;
const MAX_DECODED_BYTES: u64 = 1 << 30;

/// A piece that arrived damaged this often is damaged at the source.
const MAX_DAMAGED: u32 = 3;

/// What the loader's tasks tell it. At most one message per piece and request is ever waiting.
#[derive(Debug)]
enum Message {
    /// More of a cloud's first bytes has come, from that source.
    Opening {
        id: OpeningId,
        source: Source,
        opening: Opening,
    },
    /// A cloud cannot be opened.
    Unopened {
        id: OpeningId,
        message: String,
    },
    /// Nothing more comes of an opening.
    Ended {
        id: OpeningId,
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

/// The thread's state.
pub(super) struct Loader {
    shared: Arc<Shared>,
    config: EngineConfig,
    /// By index. Those that were removed are not there, and neither is one that another version stands
    /// in the place of.
    clouds: BTreeMap<usize, Cloud>,
    openings: HashMap<OpeningId, OpeningTask>,
    next_opening: OpeningId,
    demand: Vec<Piece>,
    /// The pieces of the demand.
    wanted: HashSet<PieceId>,
    /// When each wanted piece was first wanted, where pieces are loaded in that order.
    turns: HashMap<PieceId, u64>,
    next_turn: u64,
    pieces: Pieces,
    flights: HashMap<FlightId, Flight>,
    next_flight: FlightId,
    /// When it was last looked at what may be started.
    dispatched_at: Instant,
    /// Where decoding goes; where there are none, it is done at once, on this thread: simulated time must not
    /// pass meanwhile.
    decoders: Option<rayon::ThreadPool>,
    connections: Connections,
    /// Who asks a host for first bytes passes its gate; `None` is for files.
    gates: HashMap<Option<String>, Arc<Semaphore>>,
    /// Where other engines may have the same index.
    commons: Option<Arc<Commons>>,
    sender: UnboundedSender<Message>,
    receiver: UnboundedReceiver<Message>,
}

impl Loader {
    pub fn new(shared: Arc<Shared>, config: EngineConfig) -> Self {
        let (sender, receiver) = unbounded_channel();
        Self {
            shared,
            config,
            clouds: BTreeMap::new(),
            openings: HashMap::new(),
            next_opening: 0,
            demand: Vec::new(),
            wanted: HashSet::new(),
            turns: HashMap::new(),
            next_turn: 0,
            pieces: Pieces::default(),
            flights: HashMap::new(),
            next_flight: 0,
            dispatched_at: Instant::now(),
            decoders: None,
            connections: Connections::default(),
            gates: HashMap::new(),
            commons: None,
            sender,
            receiver,
        }
    }

    /// The same, with threads that decode: not those that a renderer may use, behind whose backs what it
    /// asks for would wait for all that has come. One processor is left for who draws.
    ///
    /// # Errors
    /// Where the system gives no thread.
    pub fn with_decoders(self) -> std::io::Result<Self> {
        let processors = std::thread::available_parallelism().map_or(1, usize::from);
        let decoders = rayon::ThreadPoolBuilder::new()
            .num_threads(processors.saturating_sub(1).max(1))
            .thread_name(|index| format!("decoder {index}"))
            .build()
            .map_err(std::io::Error::other)?;
        Ok(Self { decoders: Some(decoders), ..self })
    }

    /// The same, keeping what is equal in other engines once.
    pub fn sharing(self, commons: Arc<Commons>) -> Self {
        Self { commons: Some(commons), ..self }
    }

    /// Runs until the inbox says to end.
    pub async fn run(mut self) {
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
                    mail.changes.into_iter().for_each(|change| self.change(change));
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
        // It may have been written before the traversal knew that a cloud is gone.
        self.demand.retain(|piece| self.clouds.contains_key(&piece.id.node.cloud));
        self.wanted = self.demand.iter().map(|piece| piece.id).collect();
        self.pieces.update(&self.wanted, demand.seen);
        self.refuse_unsound();
        if self.config.order == LoadOrder::Arrival {
            self.take_turns();
        }
        if !self.config.cancels {
            return;
        }
        let (pieces, wanted) = (&self.pieces, &self.wanted);
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

    /// Gives up wanted pieces that no sound dataset has, before anything is asked for or kept of them.
    fn refuse_unsound(&mut self) {
        let now = Instant::now();
        let why = |piece: &Piece| {
            let boot = self.clouds.get(&piece.id.node.cloud)?.boot.as_ref()?;
            let bytes = boot.header.file_bytes;
            if piece.offset.checked_add(piece.len).is_none_or(|end| end > bytes) {
                return Some(format!("it lies beyond the end of the file, at {bytes} bytes"));
            }
            let decoded = decode::decoded_bytes(piece, &boot.manifest);
            let is_large = piece.len > MAX_PIECE_BYTES || decoded > MAX_DECODED_BYTES;
            is_large.then(|| format!("it would take {decoded} bytes"))
        };
        let free = self.demand.iter().filter(|piece| self.pieces.is_free(piece.id, now));
        let unsound: Vec<_> = free.filter_map(|piece| Some((piece.id, why(piece)?))).collect();
        for (id, why) in unsound {
            let Some(cloud) = self.clouds.get(&id.node.cloud) else { continue };
            let message =
                format!("{}: node {}: {why}; left out", cloud.source.describe(), id.node.key);
            let number = self.shared.traversal.post(Event::Lost { piece: id, message });
            self.pieces.deliver(id, number);
        }
    }

    /// Puts the demand into the order in which its pieces were first wanted.
    fn take_turns(&mut self) {
        self.turns.retain(|id, _| self.wanted.contains(id));
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
            Message::Opening { id, source, opening } => self.take_opening(id, source, opening),
            Message::Unopened { id, message } => self.fail_opening(id, message),
            Message::Ended { id } => self.end_opening(id),
            Message::Arrived { flight, index, bytes } => {
                let Some(flight_) = self.flights.get(&flight) else { return };
                let piece = flight_.pieces[index].clone();
                if self.pieces.is_loading(piece.id, flight) {
                    if self.wanted.contains(&piece.id) {
                        self.shared.counters.useful_bytes.add(piece.len);
                    }
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

    fn start_decoding(&mut self, piece: Piece, bytes: Bytes) {
        let boot = self.clouds.get(&piece.id.node.cloud).and_then(|cloud| cloud.boot.clone());
        let Some(boot) = boot else { return };
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
        match &self.decoders {
            Some(decoders) => decoders.spawn(work),
            None => work(),
        }
    }

    fn deliver(&mut self, id: PieceId, result: Result<Decoded, Error>) {
        if !matches!(self.pieces.get(id), Some(PieceState::Decoding { .. })) {
            return;
        }
        let Some(cloud) = self.clouds.get_mut(&id.node.cloud) else { return };
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
        let Some(cloud) = self.clouds.get_mut(&flight.cloud) else { return };
        let error = match result {
            Ok(()) => {
                let delivered = cloud.delivered.bytes.load(Ordering::Relaxed);
                self.shared.counters.gap_bytes.add(flight.gap_bytes());
                if let Some((wait, bytes, time)) = flight.measured(delivered) {
                    cloud.pace.note(wait, bytes, time);
                }
                cloud.doubts = 0;
                // An answer that was on its way before the host failed says nothing of it.
                if cloud.failed_at.is_some_and(|at| flight.sent() <= at) {
                    return;
                }
                cloud.not_before = None;
                if std::mem::take(&mut cloud.failures) > 0 {
                    self.shared.trouble(Some(cloud.number), None);
                }
                return;
            }
            Err(error) => error,
        };
        if !error.is_transient() {
            self.break_off(id, flight);
            self.give_up(flight.cloud, &error);
            return;
        }
        self.shared.counters.retries.add(1);
        self.shared.trouble(Some(cloud.number), Some(error.to_string()));
        // Those that were on their way together fail together: once.
        if cloud.failed_at.is_none_or(|at| flight.sent() > at) {
            cloud.failures = cloud.failures.saturating_add(1);
            cloud.failed_at = Some(Instant::now());
            cloud.not_before = Some(Instant::now() + Backoff::default().delay(cloud.failures));
        }
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

    /// Starts what may be started.
    fn dispatch(&mut self) {
        let now = Instant::now();
        self.dispatched_at = now;
        self.take_from_prefixes(now);
        let free = self.config.requests_in_flight.max(1).saturating_sub(self.flights.len());
        // Most engines ask one host: they need not count.
        let has_room = free > 0
            || self.gates.len() > 1 && {
                let by_host = self.by_host();
                by_host.len() > 1
                    && by_host.values().any(|&count| count < self.share(by_host.len()))
            };
        if has_room && self.pieces.backlog_bytes() <= MAX_BACKLOG_BYTES {
            self.start_flights(self.runs(now));
            if self.config.paces {
                self.wait_for_turns();
            }
        }
        let queued = self.demand.iter().filter(|piece| self.pieces.get(piece.id).is_none()).count();
        self.shared.counters.queued.set(queued as u64);
        self.shared.counters.in_flight.set(self.flights.len() as u64);
    }

    /// Requests in flight by host: of all that are in flight, or that something is wanted of.
    fn by_host(&self) -> HashMap<Option<&str>, usize> {
        let host = |cloud: &usize| Some(self.clouds.get(cloud)?.source.host());
        let wanted: BTreeSet<usize> = self.demand.iter().map(|p| p.id.node.cloud).collect();
        let mut by_host: HashMap<_, _> = wanted.iter().filter_map(host).map(|h| (h, 0)).collect();
        for host in self.flights.values().filter_map(|flight| host(&flight.cloud)) {
            *by_host.entry(host).or_default() += 1;
        }
        by_host
    }

    /// Of so many hosts, what each may have in flight whatever the others have.
    fn share(&self, hosts: usize) -> usize {
        self.config.requests_in_flight.max(1).div_ceil(hosts.max(1))
    }

    /// Starts requests, most important first. Where several hosts are asked, each has its share of all that may be in flight
    /// at a time, so that one which does not answer keeps nothing from the others; what is left is for whoever wants more.
    fn start_flights(&mut self, runs: Vec<(Vec<Piece>, bool)>) {
        let mut by_host = self.by_host();
        let share = self.share(by_host.len());
        let mut starting = Vec::new();
        let mut more = Vec::new();
        for run in runs {
            let cloud = run.0.first().and_then(|piece| self.clouds.get(&piece.id.node.cloud));
            let Some(of_host) = cloud.and_then(|cloud| by_host.get_mut(&cloud.source.host()))
            else {
                continue;
            };
            if *of_host < share {
                *of_host += 1;
                starting.push(run);
            } else {
                more.push(run);
            }
        }
        let in_flight = self.flights.len() + starting.len();
        let free = self.config.requests_in_flight.max(1).saturating_sub(in_flight);
        for (pieces, is_batch) in starting.into_iter().chain(more.into_iter().take(free)) {
            self.start_flight(pieces, is_batch);
        }
    }

    /// Decodes wanted pieces whose bytes came with the first answer, and those without bytes.
    fn take_from_prefixes(&mut self, now: Instant) {
        let mut found = Vec::new();
        for piece in &self.demand {
            let Some(cloud) = self.clouds.get(&piece.id.node.cloud) else { continue };
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
                && !cloud.is_in_doubt
                && self.pieces.is_free(piece.id, now)
            {
                found.push((piece.clone(), bytes));
            }
        }
        for (piece, bytes) in found {
            let cloud = self.clouds.get_mut(&piece.id.node.cloud);
            if cloud.is_some_and(|cloud| cloud.prefix_used.insert(piece.id)) {
                self.shared.counters.useful_bytes.add(piece.len);
            }
            self.start_decoding(piece, bytes);
        }
    }

    /// The requests that the demand comes to, most important first: their pieces, and whether they name
    /// each.
    fn runs(&self, now: Instant) -> Vec<(Vec<Piece>, bool)> {
        let mut wanted: BTreeMap<usize, Vec<Wanted>> = BTreeMap::new();
        // What matters less does not ride along while what matters more waits.
        let mut allowed: HashMap<usize, u64> = HashMap::new();
        for (rank, piece) in self.demand.iter().enumerate() {
            let index = piece.id.node.cloud;
            let Some(cloud) = self.clouds.get(&index) else { continue };
            let paused = cloud.not_before.is_some_and(|until| until > now);
            let on_its_way = piece.end() <= cloud.prefix_end;
            if !paused && !cloud.is_in_doubt && !on_its_way && self.pieces.is_free(piece.id, now) {
                // The last may be longer: one piece at least.
                let allowed = allowed.entry(index).or_insert_with(|| self.allowance(index, cloud));
                if *allowed == 0 {
                    continue;
                }
                *allowed = allowed.saturating_sub(piece.len);
                let alone = self.pieces.needs_own_request(piece.id);
                let wanted = wanted.entry(index).or_default();
                wanted.push(Wanted { rank, offset: piece.offset, len: piece.len, alone });
            }
        }
        let requests = |(index, wanted): (usize, Vec<Wanted>)| {
            let limits = self.clouds.get(&index).and_then(|cloud| cloud.source.batch_limits());
            match limits.filter(|_| self.config.batches) {
                Some(limits) => coalesce::batch(wanted, limits, self.config.coalesce.span_bytes),
                None => coalesce::coalesce(wanted, self.config.coalesce),
            }
        };
        let mut runs: Vec<Run> = wanted.into_iter().flat_map(requests).collect();
        runs.sort_by_key(Run::rank);
        let pieces = |run: &Run| {
            let pieces = run.parts.iter().map(|part| self.demand[part.rank].clone());
            (pieces.collect(), run.is_batch)
        };
        runs.iter().map(pieces).collect()
    }

    /// Bytes that a cloud's requests in flight have still to bring.
    fn left_bytes(&self, cloud: usize) -> u64 {
        let flights = self.flights.values().filter(|flight| flight.cloud == cloud);
        flights.map(Flight::left_bytes).sum()
    }

    /// Bytes that may be asked for of a cloud: none while those in flight keep its link busy.
    fn allowance(&self, index: usize, cloud: &Cloud) -> u64 {
        if !self.config.paces {
            return u64::MAX;
        }
        let left = self.left_bytes(index) + cloud.prefix_left();
        let limit = cloud.pace.limit_bytes();
        if left > limit { 0 } else { 2 * limit - left }
    }

    /// Has it told when more may be asked for.
    fn wait_for_turns(&self) {
        for (index, cloud) in &self.clouds {
            let turn = self.left_bytes(*index).saturating_sub(cloud.pace.limit_bytes());
            let delivered = cloud.delivered.bytes.load(Ordering::Relaxed);
            cloud.delivered.waited_for.store(delivered + turn, Ordering::Relaxed);
        }
    }

    fn start_flight(&mut self, pieces: Vec<Piece>, is_batch: bool) {
        let Some(first) = pieces.first() else { return };
        let Some(cloud) = self.clouds.get(&first.id.node.cloud) else { return };
        let (source, delivered) = (cloud.source.clone(), Arc::clone(&cloud.delivered));
        let id = self.next_flight;
        self.next_flight += 1;
        for piece in &pieces {
            self.pieces.set(piece.id, PieceState::Loading { flight: id });
        }
        let shared = Arc::clone(&self.shared);
        let sender = self.sender.clone();
        let flight = Flight::start(id, source, pieces, is_batch, shared, sender, delivered);
        self.flights.insert(id, flight);
    }

    /// When something that waits after a failure may go on.
    fn next_retry(&self) -> Option<Instant> {
        let pieces = self.demand.iter().filter_map(|piece| self.pieces.retry_at(piece.id));
        let wanted: HashSet<_> = self.demand.iter().map(|piece| piece.id.node.cloud).collect();
        let clouds = wanted.into_iter().filter_map(|cloud| self.clouds.get(&cloud)?.not_before);
        // What was past when it was looked at waits for a free request, not for the clock.
        clouds.chain(pieces).filter(|&at| at > self.dispatched_at).min()
    }
}

async fn sleep_until(at: Option<Instant>) {
    match at {
        Some(at) => tokio::time::sleep_until(at).await,
        None => std::future::pending().await,
    }
}
