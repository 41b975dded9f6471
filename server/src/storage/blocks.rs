//! What was read from an object store, kept in memory.
//!
//! Blocks of fixed size: ranges that overlap share them, whatever their ends. A miss brings all that
//! is missing from there on, as far as the response will need, in one request; whoever wants a block
//! that is on its way waits for it rather than fetching it again.

use std::{io, ops::Range, time::Duration};

use bytes::Bytes;
use quick_cache::{
    OptionsBuilder, Weighter,
    sync::{Cache, GuardResult},
};

/// Size of a block. As large as the pieces that bodies are sent in, so that one is one.
pub(super) const BLOCK_BYTES: u64 = 256 << 10;
/// Most blocks of one request: 4 MiB. More only keeps the first of them waiting in memory. Small caches bring
/// as many as half of them holds: what is pushed out before it is sent would be fetched again.
const MAX_RUN: u64 = 16;
/// What the cache needs for a block besides its bytes, about.
const OVERHEAD_BYTES: u64 = 200;

/// A block: which object (by the number that it was given), and which block of it.
type Key = (u64, u64);

#[derive(Debug, Clone)]
struct ByBytes;

impl Weighter<Key, Bytes> for ByBytes {
    fn weight(&self, _: &Key, block: &Bytes) -> u64 {
        block.len() as u64 + OVERHEAD_BYTES
    }
}

/// A bounded cache of blocks; which are kept is decided by S3-FIFO, so that one long download does
/// not push out what many want.
#[derive(Debug)]
pub(super) struct BlockCache {
    blocks: Cache<Key, Bytes, ByBytes>,
    max_run: u64,
}

impl BlockCache {
    pub(super) fn new(capacity_bytes: u64) -> Self {
        // Each shard has its share of the memory, which must hold some blocks.
        let shards = (capacity_bytes / (16 * BLOCK_BYTES)).clamp(1, 32);
        let options = OptionsBuilder::new()
            .shards(shards as usize)
            .estimated_items_capacity((capacity_bytes / BLOCK_BYTES).max(1) as usize)
            .weight_capacity(capacity_bytes)
            .build()
            .expect("capacity and estimate are given");
        let blocks = Cache::with_options(
            options,
            ByBytes,
            Default::default(),
            quick_cache::sync::DefaultLifecycle::default(),
        );
        let max_run = (capacity_bytes / (2 * BLOCK_BYTES)).clamp(1, MAX_RUN);
        Self { blocks, max_run }
    }

    /// Bytes that are kept.
    pub(super) fn bytes(&self) -> u64 {
        self.blocks.weight()
    }

    /// A block, where it is here.
    pub(super) fn get(&self, object: u64, block: u64) -> Option<Bytes> {
        self.blocks.get(&(object, block))
    }

    /// Puts a block in that came by another way.
    pub(super) fn put(&self, object: u64, block: u64, bytes: Bytes) {
        self.blocks.insert((object, block), bytes);
    }

    /// A block, from here or by `fetch`, which is handed a range of bytes that begins with the block
    /// and ends no later than the block of `until` does, and brings exactly these.
    pub(super) async fn get_or_fetch<F>(
        &self,
        object: u64,
        block: u64,
        until: u64,
        length: u64,
        fetch: impl FnOnce(Range<u64>) -> F,
    ) -> io::Result<Bytes>
    where
        F: Future<Output = io::Result<Bytes>>,
    {
        let first = match self.blocks.get_value_or_guard_async(&(object, block)).await {
            Ok(bytes) => return Ok(bytes),
            Err(guard) => guard,
        };
        let mut guards = vec![first];
        let last = until.saturating_sub(1).max(block * BLOCK_BYTES) / BLOCK_BYTES;
        for next in (block + 1..=last).take(self.max_run as usize - 1) {
            match self.blocks.get_value_or_guard(&(object, next), Some(Duration::ZERO)) {
                GuardResult::Guard(guard) => guards.push(guard),
                GuardResult::Value(_) | GuardResult::Timeout => break,
            }
        }
        let start = block * BLOCK_BYTES;
        let end = (start + guards.len() as u64 * BLOCK_BYTES).min(length);
        let bytes = fetch(start..end).await?;
        if bytes.len() as u64 != end - start {
            let message = format!("{} bytes came instead of {}", bytes.len(), end - start);
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, message));
        }
        let mut blocks = bytes.chunks(BLOCK_BYTES as usize).map(|part| bytes.slice_ref(part));
        // A block of its own memory: one that stays does not keep its neighbours.
        let own = |shared: Bytes| {
            if guards_are_many(&bytes) { Bytes::copy_from_slice(&shared) } else { shared }
        };
        let mut wanted = None;
        for guard in guards {
            let Some(block) = blocks.next().map(own) else { break };
            wanted.get_or_insert_with(|| block.clone());
            // Refused only where the block was put in meanwhile.
            let _ = guard.insert(block);
        }
        wanted.ok_or_else(|| io::Error::other("an empty range"))
    }
}

fn guards_are_many(bytes: &Bytes) -> bool {
    bytes.len() as u64 > BLOCK_BYTES
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    const LENGTH: u64 = 10 * BLOCK_BYTES + 5;

    async fn serve(range: Range<u64>) -> io::Result<Bytes> {
        Ok((range.start..range.end).map(|at| (at / 1000) as u8).collect::<Vec<_>>().into())
    }

    #[tokio::test]
    async fn a_run_of_missing_blocks_is_one_request() {
        let cache = BlockCache::new(64 << 20);
        let asked = Mutex::new(Vec::new());
        let fetch = |range: Range<u64>| {
            asked.lock().expect("no panic").push(range.clone());
            serve(range)
        };
        let third = cache.get_or_fetch(1, 3, 4 * BLOCK_BYTES, LENGTH, fetch).await.expect("there");
        assert_eq!(third.len() as u64, BLOCK_BYTES);
        for block in 0..=10 {
            let got = cache.get_or_fetch(1, block, LENGTH, LENGTH, fetch).await.expect("there");
            let start = block * BLOCK_BYTES;
            let end = (start + BLOCK_BYTES).min(LENGTH);
            assert_eq!(got, serve(start..end).await.expect("made here"), "block {block}");
        }
        let b = BLOCK_BYTES;
        assert_eq!(*asked.lock().expect("no panic"), [3 * b..4 * b, 0..3 * b, 4 * b..LENGTH]);
    }

    #[tokio::test]
    async fn a_small_cache_brings_no_more_at_a_time_than_half_of_it_holds() {
        let asked = Mutex::new(Vec::new());
        let fetch = |range: Range<u64>| {
            asked.lock().expect("no panic").push(range.clone());
            serve(range)
        };
        for blocks in [0, 1, 4] {
            let cache = BlockCache::new(blocks * BLOCK_BYTES);
            let first = cache.get_or_fetch(1, 0, LENGTH, LENGTH, fetch).await.expect("there");
            assert_eq!(first.len() as u64, BLOCK_BYTES);
        }
        let b = BLOCK_BYTES;
        assert_eq!(*asked.lock().expect("no panic"), [0..b, 0..b, 0..2 * b]);
    }

    #[tokio::test]
    async fn who_comes_while_a_block_is_on_its_way_waits_for_it() {
        let cache = BlockCache::new(64 << 20);
        let (send, wait) = tokio::sync::oneshot::channel::<()>();
        let first = cache.get_or_fetch(1, 0, 1, LENGTH, async |range| {
            wait.await.expect("sent");
            serve(range).await
        });
        let never = async |_| -> io::Result<Bytes> { panic!("fetched twice") };
        let second = async {
            let block = cache.get_or_fetch(1, 0, 1, LENGTH, never);
            let release = async { send.send(()).expect("waited for") };
            tokio::join!(block, release).0
        };
        let (first, second) = tokio::join!(first, second);
        assert_eq!(first.expect("there"), second.expect("there"));
    }

    #[tokio::test]
    async fn a_failure_is_told_and_not_kept() {
        let cache = BlockCache::new(64 << 20);
        let fail = async |_| Err(io::Error::other("away"));
        assert!(cache.get_or_fetch(1, 0, 1, LENGTH, fail).await.is_err());
        let short = async |range: Range<u64>| serve(range.start..range.end - 1).await;
        assert!(cache.get_or_fetch(1, 0, 1, LENGTH, short).await.is_err());
        assert!(cache.get_or_fetch(1, 0, 1, LENGTH, serve).await.is_ok());
    }

    #[tokio::test]
    async fn memory_is_bounded() {
        let capacity = 8 << 20;
        let cache = BlockCache::new(capacity);
        for object in 0..20 {
            for block in 0..10 {
                cache.get_or_fetch(object, block, 0, LENGTH, serve).await.expect("there");
            }
        }
        assert!(cache.bytes() <= capacity && cache.bytes() > capacity / 2, "{}", cache.bytes());
    }
}
