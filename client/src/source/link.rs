//! A network link that is made up: bandwidth, delay and loss, the same for every run.
//!
//! Requests share one bottleneck in turns of 16 KiB, as connections do in a router's queue. The first
//! request of a connection costs a round trip more (its handshake); connections are kept. A lost
//! packet holds up its own request for a round trip, in which the others go on. What is lost hangs
//! on the seed and the place in the file alone, not on when it is asked for.
//!
//! Not in it: slow start, header bytes, the host's own time, TLS.

use std::{
    str::FromStr,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use serde::Serialize;
use tokio::time::{Instant, sleep, sleep_until};

/// Bytes that a request sends in turn.
const TURN_BYTES: u64 = 16 << 10;

/// Bytes of payload in a packet.
const PACKET_BYTES: u64 = 1460;

/// A timer is late by less than this.
const TIMER_SLACK: Duration = Duration::from_millis(10);

/// What a link does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LinkSpec {
    /// Bits per second from the host; infinite where only delay counts.
    pub bits_per_second: f64,
    /// To the host and back.
    pub round_trip: Duration,
    /// Share of packets that are lost, 0 to below 1.
    pub loss: f64,
}

impl LinkSpec {
    /// The least time in which `bytes` can be had with two requests, one after the other.
    #[must_use]
    pub fn bound(&self, bytes: u64) -> Duration {
        2 * self.round_trip + self.transmission(bytes)
    }

    fn transmission(&self, bytes: u64) -> Duration {
        Duration::try_from_secs_f64(bytes as f64 * 8.0 / self.bits_per_second).unwrap_or_default()
    }
}

impl std::fmt::Display for LinkSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let milliseconds = self.round_trip.as_secs_f64() * 1e3;
        write!(f, "{}mbit/{milliseconds}ms", self.bits_per_second / 1e6)?;
        if self.loss > 0.0 {
            write!(f, "/{}%", self.loss * 100.0)?;
        }
        Ok(())
    }
}

impl FromStr for LinkSpec {
    type Err = String;

    /// `20mbit/40ms`, `4mbit/100ms/1%`.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "no link {text:?}: give bandwidth, round trip and, if any, loss, as in 20mbit/40ms \
                 or 4mbit/100ms/1%"
            )
        };
        let number = |part: Option<&str>, unit: &str| {
            let number: f64 = part?.trim().to_ascii_lowercase().strip_suffix(unit)?.parse().ok()?;
            (number.is_finite() && number >= 0.0).then_some(number)
        };
        let mut parts = text.split('/');
        let mbit = number(parts.next(), "mbit").filter(|&m| m > 0.0).ok_or_else(wrong)?;
        let milliseconds = number(parts.next(), "ms").ok_or_else(wrong)?;
        let percent = match parts.next() {
            Some(loss) => number(Some(loss), "%").filter(|&p| p < 100.0).ok_or_else(wrong)?,
            None => 0.0,
        };
        if parts.next().is_some() || milliseconds > 60_000.0 {
            return Err(wrong());
        }
        Ok(Self {
            bits_per_second: mbit * 1e6,
            round_trip: Duration::from_secs_f64(milliseconds / 1e3),
            loss: percent / 100.0,
        })
    }
}

/// A link. All sources that share it share its bandwidth.
#[derive(Debug)]
pub struct Link {
    spec: LinkSpec,
    seed: u64,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// When the bottleneck has sent what it was given so far.
    free_at: Option<Instant>,
    /// Open connections that no request uses.
    idle: usize,
}

impl Link {
    /// A link on which nothing has happened.
    #[must_use]
    pub fn new(spec: LinkSpec, seed: u64) -> Arc<Self> {
        Arc::new(Self { spec, seed, state: Mutex::default() })
    }

    /// What the link does.
    #[must_use]
    pub const fn spec(&self) -> LinkSpec {
        self.spec
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes as long as a request for `len` bytes from `offset` does; calls `arrived` with the bytes
    /// that came in each turn.
    pub(super) async fn carry(&self, offset: u64, len: u64, mut arrived: impl FnMut(u64) + Send) {
        let mut passage = self.connect(offset).await;
        // There and back: the propagation of both ways at once, which moves all turns alike.
        sleep(self.spec.round_trip).await;
        passage.begin();
        let mut done = 0;
        while done < len {
            let bytes = TURN_BYTES.min(len - done);
            passage.turn(bytes).await;
            arrived(bytes);
            done += bytes;
        }
        passage.end();
    }

    /// Takes a connection for a request for bytes from `offset`; a new one takes its handshake.
    async fn connect(&self, offset: u64) -> Passage<'_> {
        let warm = {
            let mut state = self.state();
            let warm = state.idle > 0;
            state.idle -= usize::from(warm);
            warm
        };
        if !warm {
            sleep(self.spec.round_trip).await;
        }
        Passage { link: self, offset, ready: Instant::now() }
    }

    /// A request to a real host: takes the way there. Call [`Passage::arrive`] when the host has
    /// answered.
    pub(super) async fn depart(&self, offset: u64) -> Passage<'_> {
        let passage = self.connect(offset).await;
        sleep(self.spec.round_trip / 2).await;
        passage
    }

    /// Bytes of a turn that have to be sent again.
    fn lost(&self, offset: u64, bytes: u64) -> u64 {
        if self.spec.loss <= 0.0 {
            return 0;
        }
        let packets = bytes.div_ceil(PACKET_BYTES);
        let lost = (0..packets).filter(|packet| {
            let mut random = fastrand::Rng::with_seed(
                self.seed ^ (offset / PACKET_BYTES + packet).wrapping_mul(0x9e37_79b9_7f4a_7c15),
            );
            random.f64() < self.spec.loss
        });
        lost.count() as u64 * PACKET_BYTES
    }
}

/// A request on its way over a link. One that is dropped takes its connection with it.
#[derive(Debug)]
pub(super) struct Passage<'a> {
    link: &'a Link,
    /// Of the next byte in the file.
    offset: u64,
    /// When the last turn had come. Exact, while the timer has steps: what it is late does not add up.
    ready: Instant,
}

impl Passage<'_> {
    fn begin(&mut self) {
        self.ready = Instant::now();
    }

    /// The host has answered: takes the way back.
    pub(super) async fn arrive(&mut self) {
        sleep(self.link.spec.round_trip / 2).await;
        self.begin();
    }

    /// A real host has delivered so many bytes: takes as long as the link needs for them.
    pub(super) async fn pass(&mut self, bytes: u64) {
        let now = Instant::now();
        // Less is the timer's lateness, more is the host's.
        if now.duration_since(self.ready) > TIMER_SLACK {
            self.ready = now;
        }
        let mut left = bytes;
        while left > 0 {
            let turn = TURN_BYTES.min(left);
            self.turn(turn).await;
            left -= turn;
        }
    }

    /// Waits for at most [`TURN_BYTES`].
    async fn turn(&mut self, bytes: u64) {
        let spec = self.link.spec;
        let lost = self.link.lost(self.offset, bytes);
        if lost > 0 {
            self.ready += spec.round_trip;
            sleep_until(self.ready).await;
        }
        let sent = spec.transmission(bytes + lost);
        let end = {
            let mut state = self.link.state();
            let end = state.free_at.map_or(self.ready, |free| free.max(self.ready)) + sent;
            state.free_at = Some(end);
            end
        };
        sleep_until(end).await;
        self.ready = end;
        self.offset += bytes;
    }

    /// The answer is complete: its connection is free for the next.
    pub(super) fn end(self) {
        self.link.state().idle += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spec(text: &str) -> LinkSpec {
        text.parse().expect(text)
    }

    #[test]
    fn links_are_read_and_written() {
        let link = spec("20mbit/40ms");
        assert_eq!((link.bits_per_second, link.round_trip.as_millis(), link.loss), (20e6, 40, 0.0));
        for text in ["20mbit/40ms", "4mbit/100ms/1%", "0.5mbit/0ms"] {
            assert_eq!(spec(text).to_string(), text);
        }
        for wrong in
            ["", "20", "20mbit", "0mbit/1ms", "1mbit/-1ms", "1mbit/1ms/100%", "1mbit/1ms/1%/x"]
        {
            let message = wrong.parse::<LinkSpec>().expect_err(wrong);
            assert!(message.contains("20mbit/40ms"), "{message}");
        }
    }

    /// Simulated milliseconds that requests of so many bytes take, sent together.
    fn together(link: &Arc<Link>, lens: &[u64]) -> Vec<f64> {
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_time().start_paused(true).build().expect("a runtime");
        runtime.block_on(async {
            let start = Instant::now();
            let requests: Vec<_> = lens
                .iter()
                .map(|&len| {
                    let link = Arc::clone(link);
                    tokio::spawn(async move {
                        let mut bytes = 0;
                        link.carry(0, len, |arrived| bytes += arrived).await;
                        assert_eq!(bytes, len);
                        start.elapsed().as_secs_f64() * 1e3
                    })
                })
                .collect();
            let mut times = Vec::new();
            for request in requests {
                times.push(request.await.expect("ended"));
            }
            times
        })
    }

    #[track_caller]
    fn assert_near(found: f64, expected: f64) {
        // The timer has steps of a millisecond.
        assert!((found - expected).abs() <= 2.0, "{found} ms, expected {expected} ms");
    }

    #[test]
    fn a_request_takes_a_round_trip_and_its_bytes_and_the_first_a_handshake() {
        // A megabit is 125,000 bytes: 62.5 ms at 16 Mbit/s.
        let link = Link::new(spec("16mbit/40ms"), 0);
        let mut runtime = tokio::runtime::Builder::new_current_thread();
        let runtime = runtime.enable_time().start_paused(true).build().expect("a runtime");
        let [cold, warm] = runtime.block_on(async {
            let mut times = [0.0; 2];
            for time in &mut times {
                let start = Instant::now();
                link.carry(0, 125_000, |_| {}).await;
                *time = start.elapsed().as_secs_f64() * 1e3;
            }
            times
        });
        assert_near(cold, 40.0 + 40.0 + 62.5);
        assert_near(warm, 40.0 + 62.5);
    }

    #[test]
    fn requests_share_the_bandwidth_and_nothing_is_gained_by_many() {
        let link = Link::new(spec("16mbit/40ms"), 0);
        let times = together(&link, &[125_000, 125_000, 16_384]);
        assert_near(times[1], 80.0 + (266_384.0 / 2000.0));
        // The short one waits for a turn of each, not for all they have.
        assert_near(times[2], 80.0 + 3.0 * 16_384.0 / 2000.0);
    }

    #[test]
    fn loss_costs_round_trips_and_is_the_same_every_time() {
        let [a, b] =
            [7, 7].map(|seed| together(&Link::new(spec("16mbit/40ms/2%"), seed), &[400_000])[0]);
        let without = together(&Link::new(spec("16mbit/40ms"), 7), &[400_000])[0];
        assert_eq!(a, b);
        assert!(a > without + 40.0, "{a} with loss, {without} without");
    }
}
