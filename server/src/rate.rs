//! How often one client may ask.
//!
//! A bucket of tokens for each client's address, refilled steadily. An IPv6 client commands a whole
//! /64, so that all of that is one client. Memory is bounded: the clients that were seen least
//! recently are forgotten, 64 bytes each, which gives them a full bucket if they come again. Who
//! commands more addresses than that is nobody whom a limit per client would stop.

use std::{
    net::{IpAddr, Ipv6Addr},
    num::NonZeroUsize,
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

use lru::LruCache;

use crate::config::RateLimit;

/// Clients remembered.
const MAX_CLIENTS: NonZeroUsize = NonZeroUsize::new(1 << 16).expect("not zero");

/// What is left to each client.
#[derive(Debug)]
pub(crate) struct RateLimiter {
    limit: RateLimit,
    buckets: Mutex<LruCache<IpAddr, Bucket>>,
}

#[derive(Debug, Clone, Copy)]
struct Bucket {
    tokens: f64,
    at: Instant,
}

impl RateLimiter {
    pub(crate) fn new(limit: RateLimit) -> Self {
        Self { limit, buckets: Mutex::new(LruCache::new(MAX_CLIENTS)) }
    }

    /// Takes one request's token; where there is none, how long until there is.
    pub(crate) fn take(&self, client: IpAddr, now: Instant) -> Result<(), Duration> {
        let full = f64::from(self.limit.burst.max(1));
        let mut buckets = self.buckets.lock().unwrap_or_else(PoisonError::into_inner);
        let fresh = || Bucket { tokens: full, at: now };
        let bucket = buckets.get_or_insert_mut(network(client), fresh);
        let passed = now.saturating_duration_since(bucket.at).as_secs_f64();
        bucket.tokens = (bucket.tokens + passed * self.limit.per_second).min(full);
        bucket.at = now;
        if bucket.tokens >= 1.0 {
            bucket.tokens -= 1.0;
            return Ok(());
        }
        let wait = (1.0 - bucket.tokens) / self.limit.per_second;
        Err(Duration::try_from_secs_f64(wait).unwrap_or(Duration::MAX))
    }
}

fn network(client: IpAddr) -> IpAddr {
    match client.to_canonical() {
        IpAddr::V6(address) => {
            IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & (u128::MAX << 64)))
        }
        v4 => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limiter() -> RateLimiter {
        RateLimiter::new(RateLimit { per_second: 2.0, burst: 3 })
    }

    fn v4(last: u8) -> IpAddr {
        IpAddr::from([192, 0, 2, last])
    }

    #[test]
    fn a_burst_is_followed_by_the_steady_rate() {
        let (limiter, start) = (limiter(), Instant::now());
        for _ in 0..3 {
            assert_eq!(limiter.take(v4(1), start), Ok(()));
        }
        assert_eq!(limiter.take(v4(1), start), Err(Duration::from_millis(500)));
        assert_eq!(limiter.take(v4(2), start), Ok(()), "others are not concerned");
        let later = start + Duration::from_millis(500);
        assert_eq!(limiter.take(v4(1), later), Ok(()));
        assert!(limiter.take(v4(1), later).is_err());
        let much_later = start + Duration::from_secs(1000);
        let taken = (0..10).filter(|_| limiter.take(v4(1), much_later).is_ok()).count();
        assert_eq!(taken, 3, "a pause saves up no more than a burst");
    }

    #[test]
    fn an_ipv6_network_is_one_client() {
        let (limiter, now) = (limiter(), Instant::now());
        let address = |host: u16| IpAddr::from([0x2001, 0xdb8, 0, 1, host, 0, 0, host]);
        assert_eq!((0..10).filter(|&h| limiter.take(address(h), now).is_ok()).count(), 3);
        let mapped: IpAddr = "::ffff:192.0.2.1".parse().expect("an address");
        assert_eq!(network(mapped), v4(1));
    }

    #[test]
    fn memory_is_bounded() {
        let (limiter, now) = (limiter(), Instant::now());
        for i in 0..70_000u32 {
            assert_eq!(limiter.take(IpAddr::from(i.to_be_bytes()), now), Ok(()));
        }
        let kept = limiter.buckets.lock().expect("no panic").len();
        assert_eq!(kept, MAX_CLIENTS.get());
    }
}
