//! Clouds that are opened, once or again.
//!
//! A cloud that has failed for good, or whose file was replaced, is in doubt: its requests are broken off, and
//! its file is opened anew. Where that turns out to be the same dataset, all goes on. Where it is
//! another, that is another cloud, with an index of its own, under the same number: so nothing that was
//! asked for, is on its way, is being decoded or is known of the one can be taken for the other's.

use std::{sync::Arc, time::Duration};

use bytes::Bytes;
use tokio::{sync::Semaphore, task::AbortHandle};

use super::{
    super::{event::Event, inbox::Change},
    Loader, Message,
    cloud::Cloud,
    open::{self, Ask, Opening},
};
use crate::source::{Backoff, Source, SourceError};

/// Whoever no longer holds an opening does not want it.
impl Drop for OpeningTask {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// Identifies an opening.
pub type OpeningId = u64;

/// A cloud that was open and has failed is tried again in such steps.
const PATIENCE: Backoff = Backoff { first: Duration::from_secs(4), most: Duration::from_secs(60) };

/// Clouds of one host that are opened at a time. More would share its link, and what matters most would come
/// later.
const OPENINGS_PER_HOST: usize = 6;

/// Most first bytes that are kept of all clouds together, for nodes that are wanted again.
const MAX_PREFIX_BYTES: u64 = 32 << 20;

/// A task that opens a cloud.
#[derive(Debug)]
pub struct OpeningTask {
    /// The cloud that its news are about.
    pub cloud: usize,
    /// Whether its answer was on its way before the cloud failed: then it does not say that the cloud is back.
    is_outdated: bool,
    task: AbortHandle,
}

impl Loader {
    pub(super) fn change(&mut self, change: Change) {
        match change {
            Change::Add { cloud, number, source } => {
                let source = source.sharing(&self.connections);
                self.clouds.insert(cloud, Cloud::new(number, source));
                self.start_opening(cloud, false, Duration::ZERO);
            }
            Change::Remove { number } => {
                if let Some(cloud) = self.find(number) {
                    self.drop_cloud(cloud);
                }
            }
            Change::Reopen { number } => {
                if let Some(cloud) = self.find(number) {
                    self.doubt(cloud);
                }
            }
        }
    }

    /// The cloud of that number, if it is there.
    fn find(&self, number: usize) -> Option<usize> {
        self.clouds.iter().find(|(_, cloud)| cloud.number == number).map(|(&cloud, _)| cloud)
    }

    /// Forgets a cloud.
    fn drop_cloud(&mut self, cloud: usize) {
        self.stop_opening(cloud);
        self.break_off_all(cloud);
        self.pieces.forget(cloud);
        self.demand.retain(|piece| piece.id.node.cloud != cloud);
        self.clouds.remove(&cloud);
    }

    fn break_off_all(&mut self, cloud: usize) {
        let flights: Vec<_> = self.flights.extract_if(|_, f| f.cloud == cloud).collect();
        for (id, flight) in flights {
            self.break_off(id, &flight);
        }
    }

    /// Has a cloud opened anew, at once the first time.
    pub(super) fn doubt(&mut self, cloud: usize) {
        let Some(known) = self.clouds.get_mut(&cloud) else { return };
        known.is_in_doubt = true;
        let wait = match known.doubts {
            0 => Duration::ZERO,
            doubts => Backoff::default().delay(doubts),
        };
        known.doubts = known.doubts.saturating_add(1);
        self.break_off_all(cloud);
        self.stop_opening(cloud);
        self.start_opening(cloud, true, wait);
    }

    /// Nothing more can be had from that cloud, for now.
    pub(super) fn fail_cloud(&mut self, cloud: usize, message: String) {
        let Some(known) = self.clouds.get_mut(&cloud) else { return };
        known.is_in_doubt = true;
        if std::mem::replace(&mut known.failed, true) {
            return;
        }
        let was_open = known.boot.is_some();
        self.break_off_all(cloud);
        self.shared.traversal.post(Event::CloudFailed { cloud, message });
        if was_open {
            self.open_later(cloud);
        }
    }

    /// Has a cloud opened anew, in patience, unless it is being opened.
    fn open_later(&mut self, cloud: usize) {
        if !self.openings.values().any(|opening| opening.cloud == cloud) {
            self.start_opening(cloud, true, PATIENCE.delay(1));
        }
    }

    /// Opens a cloud in a task of its own, after `wait`; `again` where it was open before.
    fn start_opening(&mut self, cloud: usize, again: bool, wait: Duration) {
        let Some(known) = self.clouds.get(&cloud) else { return };
        let (number, source) = (known.number, known.source.clone());
        let is_patient = known.boot.is_some();
        let id = self.next_opening;
        self.next_opening += 1;
        let (shared, sender) = (Arc::clone(&self.shared), self.sender.clone());
        let gate = self.gates.entry(source.host().map(str::to_owned));
        let gate = gate.or_insert_with(|| Arc::new(Semaphore::new(OPENINGS_PER_HOST)));
        let gate = Arc::clone(gate);
        let speculative = self.config.speculative_bytes;
        let task = tokio::spawn(async move {
            // The loader outlives its tasks, save when it shuts down.
            let tell = |source: &Source, opening| {
                let source = source.clone();
                _ = sender.send(Message::Opening { id, source, opening });
            };
            if !wait.is_zero() {
                tokio::time::sleep(wait).await;
            }
            let mut failures = 0;
            loop {
                let source = if again { source.renew() } else { Ok(source.clone()) };
                let result = match source {
                    Ok(source) => {
                        let ask = Ask { number, speculative, gate: &gate };
                        open::open(&shared, ask, source, &tell).await
                    }
                    Err(error) => Err(error.to_string()),
                };
                let Err(message) = result else { break };
                let _ = sender.send(Message::Unopened { id, message });
                if !is_patient {
                    break;
                }
                failures += 1;
                tokio::time::sleep(PATIENCE.delay(failures)).await;
            }
            let _ = sender.send(Message::Ended { id });
        });
        let task = task.abort_handle();
        self.openings.insert(id, OpeningTask { cloud, is_outdated: false, task });
    }

    fn stop_opening(&mut self, cloud: usize) {
        self.openings.retain(|_, opening| opening.cloud != cloud);
    }

    pub(super) fn end_opening(&mut self, id: OpeningId) {
        let Some(cloud) = self.openings.remove(&id).map(|opening| opening.cloud) else { return };
        // What failed while its first bytes still came waited for them.
        if self.clouds.get(&cloud).is_some_and(|known| known.failed && known.boot.is_some()) {
            self.open_later(cloud);
        }
    }

    pub(super) fn fail_opening(&mut self, id: OpeningId, message: String) {
        if let Some(opening) = self.openings.get_mut(&id) {
            // What it will tell is of a new try.
            opening.is_outdated = false;
            let cloud = opening.cloud;
            self.fail_cloud(cloud, message);
        }
    }

    /// More of a cloud's first bytes has come.
    pub(super) fn take_opening(&mut self, id: OpeningId, source: Source, mut opening: Opening) {
        if let Some(commons) = &self.commons {
            opening = opening.shared(commons);
        }
        // One that was broken off is no longer there.
        let Some(&OpeningTask { cloud, is_outdated, .. }) = self.openings.get(&id) else { return };
        let Some(known) = self.clouds.get_mut(&cloud) else { return };
        let boot = &opening.boot;
        let cloud = match &known.boot {
            None => {
                self.shared.counters.useful_bytes.add(boot.header.index_bytes());
                self.shared.traversal.post(Event::Opened { cloud, boot: Arc::clone(boot) });
                cloud
            }
            Some(last) if last.header.content_id == boot.header.content_id => {
                if known.is_in_doubt && !is_outdated {
                    self.shared.traversal.post(Event::CloudIsBack { cloud });
                }
                cloud
            }
            Some(_) => self.replace(cloud, id, &opening),
        };
        let Some(known) = self.clouds.get_mut(&cloud) else { return };
        known.boot.get_or_insert(opening.boot);
        if !is_outdated {
            (known.failed, known.is_in_doubt) = (false, false);
        }
        known.source = source;
        known.prefix = opening.prefix;
        known.prefix_end = opening.expected;
        self.drop_prefixes(cloud);
    }

    /// Drops first bytes where there are too many, the oldest first, but for those that are coming.
    fn drop_prefixes(&mut self, newest: usize) {
        let mut bytes: u64 = self.clouds.values().map(|cloud| cloud.prefix.len() as u64).sum();
        for (&index, cloud) in &mut self.clouds {
            if bytes <= MAX_PREFIX_BYTES {
                return;
            }
            if index != newest && cloud.prefix_left() == 0 {
                bytes -= cloud.prefix.len() as u64;
                cloud.prefix = Bytes::new();
                cloud.prefix_end = 0;
            }
        }
    }

    /// Puts the dataset that is there now into the place of a cloud; returns its index.
    fn replace(&mut self, cloud: usize, id: OpeningId, opening: &Opening) -> usize {
        let by = self.shared.next_cloud();
        if let (Some(old), Some(opening)) = (self.clouds.get(&cloud), self.openings.get_mut(&id)) {
            let doubts = old.doubts;
            let new = Cloud { doubts, ..Cloud::new(old.number, old.source.clone()) };
            self.clouds.insert(by, new);
            (opening.cloud, opening.is_outdated) = (by, false);
        }
        self.drop_cloud(cloud);
        self.shared.counters.useful_bytes.add(opening.boot.header.index_bytes());
        let boot = Arc::clone(&opening.boot);
        self.shared.traversal.post(Event::Replaced { cloud, by, boot });
        by
    }

    /// A request to a cloud has failed in a way that repeating it does not help.
    pub(super) fn give_up(&mut self, cloud: usize, error: &SourceError) {
        if let SourceError::Replaced { .. } = error {
            let number = self.clouds.get(&cloud).map(|cloud| cloud.number);
            self.shared.trouble(number, Some(error.to_string()));
            self.doubt(cloud);
        } else {
            let openings = self.openings.values_mut().filter(|opening| opening.cloud == cloud);
            openings.for_each(|opening| opening.is_outdated = true);
            self.fail_cloud(cloud, error.to_string());
        }
    }
}
