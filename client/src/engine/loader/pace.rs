//! How much to have in flight: what keeps the link busy, and little more.
//!
//! Requests in flight share the link. Those that a busy link cannot carry yet do not make anything
//! come sooner, but what matters most later: it shares with them. So more is asked for when what is
//! still to come is what the link delivers in a round trip, and then as much again: first bytes arrive
//! when the last of the others have. (The bandwidth-delay product, estimated as BBR does: the
//! greatest recent rate, the least recent wait. Cardwell et al. 2016.)

use std::{collections::VecDeque, time::Duration};

/// Measurements that count.
const MEMORY: usize = 8;

/// In flight before anything is known.
const AT_FIRST_BYTES: u64 = 128 << 10;

/// Never less: what a slow link delivers while this machine decodes and decides.
const LEAST_BYTES: u64 = 32 << 10;

/// Rates are measured over more than that: less comes out of buffers at once.
const LEAST_MEASURED_BYTES: u64 = 32 << 10;

/// More than the product: what arrives is handled in bursts.
const MARGIN: f64 = 1.5;

/// What is known of a host's link.
#[derive(Debug, Default)]
pub struct Pace {
    /// Bytes per second.
    rates: VecDeque<f64>,
    /// From request to first byte.
    waits: VecDeque<Duration>,
}

impl Pace {
    /// A request's first byte came after `wait`; from then to its end, in `time`, the host delivered
    /// `bytes` for all requests.
    pub fn note(&mut self, wait: Duration, bytes: u64, time: Duration) {
        push(&mut self.waits, wait);
        if bytes >= LEAST_MEASURED_BYTES && !time.is_zero() {
            push(&mut self.rates, bytes as f64 / time.as_secs_f64());
        }
    }

    /// More is asked for once no more than this is still to come; then as much again.
    pub fn limit_bytes(&self) -> u64 {
        let rate = self.rates.iter().copied().fold(f64::NAN, f64::max);
        let Some(wait) = self.waits.iter().min() else { return AT_FIRST_BYTES };
        if rate.is_nan() {
            return AT_FIRST_BYTES;
        }
        // Casts from float saturate.
        ((MARGIN * rate * wait.as_secs_f64()) as u64).max(LEAST_BYTES)
    }
}

fn push<T>(values: &mut VecDeque<T>, value: T) {
    if values.len() == MEMORY {
        values.pop_front();
    }
    values.push_back(value);
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(milliseconds: u64) -> Duration {
        Duration::from_millis(milliseconds)
    }

    #[test]
    fn the_limit_is_what_the_link_delivers_in_a_round_trip() {
        let mut pace = Pace::default();
        assert_eq!(pace.limit_bytes(), AT_FIRST_BYTES);
        // 2.5 MB/s and 40 ms; some requests waited behind others.
        pace.note(ms(95), 250_000, ms(100));
        pace.note(ms(40), 100_000, ms(80));
        assert_eq!(pace.limit_bytes(), 150_000);
    }

    #[test]
    fn bursts_out_of_buffers_are_no_rate_and_the_past_is_forgotten() {
        let mut pace = Pace::default();
        pace.note(ms(40), 20_000, Duration::from_nanos(10));
        assert_eq!(pace.limit_bytes(), AT_FIRST_BYTES);
        pace.note(ms(40), 10_000_000, ms(100));
        for _ in 0..MEMORY {
            pace.note(ms(200), 100_000, ms(1000));
        }
        assert_eq!(pace.limit_bytes(), LEAST_BYTES);
    }
}
