//! What the loader makes of failures and of clouds that come and go, without a network.

use std::time::Duration;

use bytes::Bytes;
use lodestream_protocol::{NodeKey, PayloadRef};
use tokio::time::advance;

use super::*;
use crate::{
    engine::{
        inbox::Change,
        testing::{boot, manifest, node},
    },
    source::Fault,
};

/// A loader of that many clouds, which are open. Their file has nothing: what comes of requests is told by hand.
async fn loader(clouds: usize, config: EngineConfig) -> (tempfile::NamedTempFile, Loader) {
    let file = tempfile::NamedTempFile::new().expect("temporary file");
    let source = Source::parse(file.path().to_str().expect("readable path")).expect("a file");
    let shared = Arc::new(Shared::new(&config, vec![source.clone(); clouds]));
    let mut loader = Loader::new(Arc::clone(&shared), config);
    let mail = shared.loader.take().await;
    mail.changes.into_iter().for_each(|change| loader.change(change));
    for cloud in 0..clouds {
        let opening = opening_of(&loader, cloud);
        loader.take_opening(opening, source.clone(), version(1));
    }
    (file, loader)
}

fn opening_of(loader: &Loader, cloud: usize) -> OpeningId {
    let mut openings = loader.openings.iter();
    let found = openings.find(|(_, opening)| opening.cloud == cloud);
    *found.expect("it is being opened").0
}

/// The first bytes of a version of a dataset.
fn version(number: u8) -> Opening {
    let boot = Arc::new(boot([number; 16], manifest(), vec![node(NodeKey::ROOT)]));
    Opening { boot, prefix: Bytes::new(), expected: 0 }
}

/// One piece of many.
fn piece(octant: u8) -> Piece {
    let key = NodeKey::ROOT.child(octant).expect("below the root");
    let payloads = vec![PayloadRef { offset: 0, bytes: 10, crc: 0 }];
    let node = Arc::new(lodestream_protocol::Node { payloads, ..node(key) });
    Piece::group(0, &node, 0).expect("it has a payload")
}

/// Sends a request.
fn send(loader: &mut Loader, octant: u8) -> FlightId {
    loader.start_flight(vec![piece(octant)], false);
    loader.next_flight - 1
}

fn end(loader: &mut Loader, flight: FlightId, result: Result<(), SourceError>) {
    loader.handle(Message::Finished { flight, result });
}

fn broken_off() -> Result<(), SourceError> {
    let (place, message) = ("host".into(), "broken off".into());
    Err(SourceError::Transient { place, message, fault: Fault::BrokenOff })
}

fn refused() -> Result<(), SourceError> {
    let (place, message) = ("host".into(), "not found".into());
    Err(SourceError::Permanent { place, message, fault: Fault::Status(404) })
}

const SECOND: Duration = Duration::from_secs(1);

#[tokio::test(start_paused = true)]
async fn requests_that_were_on_their_way_together_are_one_failure_of_their_host() {
    let (_file, mut loader) = loader(1, EngineConfig::default()).await;
    let [first, second, good, last] = [0, 1, 2, 3].map(|octant| send(&mut loader, octant));
    advance(SECOND).await;
    end(&mut loader, first, broken_off());
    let paused = loader.clouds[&0].not_before;
    assert!(paused.is_some());
    advance(10 * SECOND).await;
    end(&mut loader, second, broken_off());
    assert_eq!((loader.clouds[&0].failures, loader.clouds[&0].not_before), (1, paused));
    // Nor does it say that the host is back.
    end(&mut loader, good, Ok(()));
    assert_eq!((loader.clouds[&0].failures, loader.clouds[&0].not_before), (1, paused));
    assert_eq!(loader.shared.counters.totals().retries, 2, "each is sent again");

    let next = send(&mut loader, 4);
    advance(SECOND).await;
    end(&mut loader, next, broken_off());
    assert_eq!(loader.clouds[&0].failures, 2, "that one was sent after the failure");
    end(&mut loader, last, broken_off());
    assert_eq!(loader.clouds[&0].failures, 2);

    advance(SECOND).await;
    let after = send(&mut loader, 5);
    end(&mut loader, after, Ok(()));
    assert_eq!((loader.clouds[&0].failures, loader.clouds[&0].not_before), (0, None));
}

#[tokio::test(start_paused = true)]
async fn what_may_be_tried_again_while_the_loader_dispatches_is_not_forgotten() {
    let config = EngineConfig { requests_in_flight: 1, ..EngineConfig::default() };
    let (_file, mut loader) = loader(1, config).await;
    let (piece, now) = (piece(0), Instant::now());
    let until = now + SECOND;
    loader.demand = vec![piece.clone()];
    loader.pieces.set(piece.id, PieceState::Failed { until });
    loader.dispatch();
    // A dispatch takes time: meanwhile it has become due.
    advance(2 * SECOND).await;
    assert_eq!(loader.next_retry(), Some(until), "wakes at once");
    // What is due, but finds no request free, waits for that and keeps no thread busy.
    send(&mut loader, 1);
    loader.dispatch();
    assert_eq!(loader.next_retry(), None);
    assert!(loader.pieces.is_free(piece.id, Instant::now()));
}

#[tokio::test(start_paused = true)]
async fn a_cloud_that_fails_while_its_first_bytes_come_is_opened_anew_once_they_have_ended() {
    let (_file, mut loader) = loader(1, EngineConfig::default()).await;
    let (opening, source) = (opening_of(&loader, 0), loader.clouds[&0].source.clone());
    let failed = |loader: &Loader| (loader.clouds[&0].failed, loader.clouds[&0].is_in_doubt);
    let flight = send(&mut loader, 0);
    end(&mut loader, flight, refused());
    assert_eq!(failed(&loader), (true, true));
    // They were on their way before: that they come does not say that the rest can be had.
    loader.take_opening(opening, source.clone(), version(1));
    assert_eq!(failed(&loader), (true, true));
    assert_eq!(opening_of(&loader, 0), opening, "one is enough");
    loader.end_opening(opening);
    let again = opening_of(&loader, 0);
    assert_ne!(again, opening);
    loader.take_opening(again, source, version(1));
    assert_eq!(failed(&loader), (false, false));
    // That failed after it was opened anew: the next says so.
    let flight = send(&mut loader, 1);
    end(&mut loader, flight, refused());
    loader.end_opening(again);
    assert_ne!(opening_of(&loader, 0), again);
}

#[tokio::test(start_paused = true)]
async fn a_cloud_that_fails_is_told_of_once_however_much_of_it_fails() {
    let (_file, mut loader) = loader(1, EngineConfig::default()).await;
    let opening = opening_of(&loader, 0);
    let [first, second] = [0, 1].map(|octant| send(&mut loader, octant));
    end(&mut loader, first, refused());
    end(&mut loader, second, refused());
    loader.fail_opening(opening, "not found".into());
    let mail = loader.shared.traversal.try_take().expect("there is news");
    let failures = mail.events.iter().filter(|e| matches!(e, Event::CloudFailed { .. }));
    assert_eq!(failures.count(), 1);
    assert!(loader.flights.is_empty(), "nothing more is waited for");
}

#[tokio::test(start_paused = true)]
async fn a_cloud_that_is_removed_takes_the_version_with_it_that_stands_in_its_place_and_no_other() {
    let (_file, mut loader) = loader(3, EngineConfig::default()).await;
    let source = loader.clouds[&0].source.clone();
    let openings = [0, 1].map(|cloud| opening_of(&loader, cloud));
    for id in openings {
        loader.take_opening(id, source.clone(), version(2));
    }
    let numbers = |loader: &Loader| -> Vec<_> {
        loader.clouds.iter().map(|(&cloud, known)| (cloud, known.number)).collect()
    };
    assert_eq!(numbers(&loader), [(2, 2), (3, 0), (4, 1)]);
    loader.change(Change::Remove { number: 0 });
    assert_eq!(numbers(&loader), [(2, 2), (4, 1)]);
    // What its opening still tells is of nothing; the other's goes on.
    loader.take_opening(openings[0], source.clone(), version(3));
    assert_eq!(numbers(&loader), [(2, 2), (4, 1)]);
    loader.take_opening(openings[1], source, version(3));
    assert_eq!(numbers(&loader), [(2, 2), (5, 1)]);
}
