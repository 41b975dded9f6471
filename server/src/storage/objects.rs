//! An object store: S3, GCS, Azure, or anything that speaks HTTP.
//!
//! What an object is (its tag, its header) is remembered for a moment, so that a burst of requests
//! for one dataset asks the store once; a dataset that appears, is replaced or is removed is so after
//! [`FRESH`] at the latest. Every read names the tag of the object that the client began with: bytes
//! of two datasets never come together, and a read of one that was replaced fails.

use std::{
    future::Future,
    io,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use lodestream_preprocess::preview::MAX_PREVIEW_BYTES;
use lodestream_protocol::{Error as FormatError, HEADER_BYTES, Header};
use object_store::{
    Error as StoreError, GetOptions, GetRange, ObjectMeta, ObjectStore, parse_url_opts,
    path::{Path, PathPart},
};
use quick_cache::sync::Cache;
use tokio::{sync::Semaphore, task::JoinSet};

use super::{
    Identity, Listing, Object, SmallFile, Warmed,
    blocks::{BLOCK_BYTES, BlockCache},
    object::{ObjectState, fetch},
};
use crate::{
    config::ObjectPlace,
    error::{Error, Result},
    file::OpenError,
    metrics::StorageMetrics,
};

/// How long what was found out about an object, or the list of all, is believed.
const FRESH: Duration = Duration::from_secs(2);
/// Names whose state is remembered, those of nothing included.
const MAX_NAMES: usize = 10_000;
/// Requests to the store at a time; more would wait for its bandwidth just as well there.
const MAX_REQUESTS: usize = 64;
/// How long an answer is waited for in all, its repeated tries included.
const PATIENCE: Duration = Duration::from_secs(25);

/// What was found out about a name, and when.
#[derive(Debug, Clone)]
struct Known {
    at: Instant,
    state: std::result::Result<Arc<ObjectState>, OpenError>,
}

impl Known {
    /// Whether it is believed. What went wrong for now is so by those alone who waited for it.
    fn is_fresh(&self) -> bool {
        let is_settled = matches!(self.state, Ok(_) | Err(OpenError::Missing));
        is_settled && self.at.elapsed() < FRESH
    }
}

/// The datasets below a prefix of a bucket.
#[derive(Debug)]
pub(crate) struct Objects {
    store: Box<dyn ObjectStore>,
    prefix: Path,
    known: Cache<String, Known>,
    /// What was there when it was last asked for with success.
    last: Cache<String, Arc<ObjectState>>,
    blocks: BlockCache,
    requests: Semaphore,
    next_number: AtomicU64,
    listed: tokio::sync::Mutex<Option<(Instant, Listing)>>,
    metrics: StorageMetrics,
}

impl Objects {
    pub(super) fn open(
        place: &ObjectPlace,
        cache_bytes: u64,
        metrics: StorageMetrics,
    ) -> Result<Self> {
        // An error means that the process has chosen its provider already: just as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let failed = |reason: String| Error::Objects { url: place.url.clone(), reason };
        let url = place.url.parse().map_err(|e| failed(format!("not an address: {e}")))?;
        let options = place.options.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let (store, prefix) = parse_url_opts(&url, options).map_err(|e| failed(told(&e)))?;
        Ok(Self {
            store,
            prefix,
            known: Cache::new(MAX_NAMES),
            last: Cache::new(MAX_NAMES),
            blocks: BlockCache::new(cache_bytes),
            requests: Semaphore::new(MAX_REQUESTS),
            next_number: AtomicU64::new(0),
            listed: tokio::sync::Mutex::default(),
            metrics,
        })
    }

    /// Lists the prefix; the answer is kept for [`FRESH`].
    pub(super) async fn list(&self) -> io::Result<Listing> {
        let mut listed = self.listed.lock().await;
        if let Some((_, known)) = listed.as_ref().filter(|(at, _)| at.elapsed() < FRESH) {
            return Ok(known.clone());
        }
        let answer = self.request(self.store.list_with_delimiter(Some(&self.prefix))).await?;
        let names = answer.objects.iter().filter_map(|meta| meta.location.filename());
        let mut found = Listing::of(names.map(str::to_owned).collect());
        for meta in &answer.objects {
            let name = meta.location.filename().unwrap_or_default().to_owned();
            found.identities.insert(name, Identity::of_object(meta));
        }
        *listed = Some((Instant::now(), found.clone()));
        Ok(found)
    }

    /// Reads the first bytes of many datasets at a time, so that looking at them one by one, which
    /// comes next, has not to ask again.
    pub(crate) async fn warm(self: &Arc<Self>, file_names: &[String]) -> Warmed {
        const AT_A_TIME: usize = 16;
        let mut warmed = Warmed::new();
        let mut tasks = JoinSet::new();
        let mut left = file_names.iter();
        loop {
            for file_name in left.by_ref().take(AT_A_TIME - tasks.len()) {
                let (objects, file_name) = (Arc::clone(self), file_name.clone());
                tasks.spawn(async move {
                    let opened = objects.dataset(&file_name).await;
                    (file_name, opened)
                });
            }
            match tasks.join_next().await {
                Some(outcome) => warmed.extend(outcome),
                None => return warmed,
            }
        }
    }

    /// The dataset of that file name.
    pub(crate) async fn dataset(
        self: &Arc<Self>,
        file_name: &str,
    ) -> std::result::Result<Object, OpenError> {
        self.known.remove_if(file_name, |known| !known.is_fresh());
        let known = match self.known.get_value_or_guard_async(file_name).await {
            Ok(known) => known,
            Err(guard) => {
                let former = self.last.get(file_name);
                let known = Known { at: Instant::now(), state: self.look(file_name, former).await };
                match &known.state {
                    Ok(state) => self.last.insert(file_name.to_owned(), Arc::clone(state)),
                    Err(OpenError::Missing) => _ = self.last.remove(file_name),
                    // What was there before is remembered: its blocks are still good where the object
                    // turns out to be the same.
                    Err(OpenError::Unreadable(_) | OpenError::Unanswered) => {}
                }
                // Whoever waits for it is told the same: asked again for each of them, a store that
                // fails after a while keeps the last as long as all of them together.
                let _ = guard.insert(known.clone());
                known
            }
        };
        Ok(Object::new(Arc::clone(self), known.state?))
    }

    /// Asks the store what it has under this name; one request, which brings the first block too.
    async fn look(
        &self,
        file_name: &str,
        former: Option<Arc<ObjectState>>,
    ) -> std::result::Result<Arc<ObjectState>, OpenError> {
        let location = self.location(file_name)?;
        let options = GetOptions {
            if_none_match: former.as_ref().and_then(|former| former.meta.e_tag.clone()),
            range: Some(GetRange::Bounded(0..BLOCK_BYTES)),
            ..GetOptions::default()
        };
        let (meta, first) = match self.get(&location, options).await {
            Ok(got) => got,
            Err(Failure::Store(StoreError::NotModified { .. })) if former.is_some() => {
                return former.ok_or(OpenError::Missing);
            }
            Err(Failure::Store(StoreError::NotFound { .. })) => return Err(OpenError::Missing),
            Err(e) => {
                tell(file_name, &e);
                return Err(OpenError::Unanswered);
            }
        };
        let same =
            former.filter(|former| Identity::of_object(&former.meta) == Identity::of_object(&meta));
        if let Some(same) = same {
            return Ok(same);
        }
        let unreadable = |e: FormatError| OpenError::Unreadable(e.to_string());
        let header = Header::parse(&first[..first.len().min(HEADER_BYTES)]).map_err(unreadable)?;
        if meta.size < header.file_bytes {
            return Err(unreadable(FormatError::Truncated {
                what: "dataset",
                needed: header.file_bytes,
                available: meta.size,
            }));
        }
        let number = self.next_number.fetch_add(1, Ordering::Relaxed);
        if first.len() as u64 == BLOCK_BYTES.min(meta.size) {
            self.blocks.put(number, 0, first);
        }
        Ok(Arc::new(ObjectState { number, meta, header }))
    }

    /// A small file beside the datasets.
    pub(super) async fn small(&self, name: &str) -> std::result::Result<SmallFile, OpenError> {
        let location = self.location(name)?;
        let range = Some(GetRange::Bounded(0..MAX_PREVIEW_BYTES as u64));
        match self.get(&location, GetOptions { range, ..GetOptions::default() }).await {
            Ok((meta, bytes)) if meta.size == bytes.len() as u64 => Ok(SmallFile { bytes }),
            Ok(_) | Err(Failure::Store(StoreError::NotFound { .. })) => Err(OpenError::Missing),
            Err(e) => {
                tell(name, &e);
                Err(OpenError::Unanswered)
            }
        }
    }

    /// Where an object of that name lies: as it is, for stores have names of any letters.
    fn location(&self, name: &str) -> std::result::Result<Path, OpenError> {
        let name = PathPart::parse(name).map_err(|_| OpenError::Missing)?;
        Ok(self.prefix.clone().join(name))
    }

    /// A block that is in memory.
    pub(super) fn cached(&self, state: &ObjectState, block: u64) -> Option<bytes::Bytes> {
        let found = self.blocks.get(state.number, block);
        if found.is_some() {
            self.metrics.hits.inc();
        }
        found
    }

    /// A block, and in passing those up to `until` that are not here.
    pub(super) async fn block(
        &self,
        state: &ObjectState,
        block: u64,
        until: u64,
    ) -> io::Result<bytes::Bytes> {
        let fetch = async |range| {
            self.metrics.misses.inc();
            match self.get(&state.meta.location, state.ask(range)).await {
                Ok((_, bytes)) => Ok(bytes),
                Err(Failure::Store(StoreError::Precondition { .. })) => {
                    let name = state.meta.location.filename().unwrap_or_default();
                    self.known.remove(name);
                    Err(io::Error::other("the dataset was replaced in the store"))
                }
                Err(e) => Err(io::Error::other(e)),
            }
        };
        let bytes =
            self.blocks.get_or_fetch(state.number, block, until, state.meta.size, fetch).await;
        self.metrics.kept.set(i64::try_from(self.blocks.bytes()).unwrap_or(i64::MAX));
        bytes
    }

    async fn get(
        &self,
        location: &Path,
        options: GetOptions,
    ) -> std::result::Result<(ObjectMeta, bytes::Bytes), Failure> {
        let got = self.request(fetch(&*self.store, location, options)).await?;
        self.metrics.fetched.inc_by(got.1.len() as u64);
        Ok(got)
    }

    /// Waits for an answer, among no more than [`MAX_REQUESTS`], no longer than [`PATIENCE`].
    async fn request<T>(
        &self,
        answer: impl Future<Output = object_store::Result<T>>,
    ) -> std::result::Result<T, Failure> {
        let in_turn = async {
            let _turn = self.requests.acquire().await;
            answer.await
        };
        match tokio::time::timeout(PATIENCE, in_turn).await {
            Ok(outcome) => outcome.map_err(Failure::Store),
            Err(_) => Err(Failure::Silent),
        }
    }
}

/// Why the store did not answer as it should.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    #[error("the object store: {}", told(.0))]
    Store(StoreError),
    #[error("the object store is silent")]
    Silent,
}

impl From<Failure> for io::Error {
    fn from(failure: Failure) -> Self {
        Self::other(failure)
    }
}

/// What an error says, in one line.
fn told(error: &StoreError) -> String {
    error.to_string().lines().map(str::trim).collect::<Vec<_>>().join(" ")
}

/// Tells the log, once for all who wait for the answer: none of them does.
fn tell(name: &str, failure: &Failure) {
    tracing::warn!("{name:?}: {failure}");
}

#[cfg(test)]
mod tests {
    use std::{
        io::{BufRead, BufReader, Write},
        net::TcpListener,
        sync::atomic::AtomicUsize,
        thread,
    };

    use super::*;

    #[tokio::test]
    async fn all_who_wait_for_an_answer_are_told_of_a_failure_and_the_next_one_asks_again() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("port 0 is free");
        let url = format!("http://{}/", listener.local_addr().expect("bound"));
        let asked = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&asked);
        thread::spawn(move || {
            for stream in listener.incoming() {
                let mut stream = stream.expect("accepted");
                let lines = BufReader::new(stream.try_clone().expect("a socket")).lines();
                // Its last line is empty.
                lines.map_while(io::Result::ok).take_while(|line| !line.is_empty()).for_each(drop);
                count.fetch_add(1, Ordering::Relaxed);
                let answer =
                    b"HTTP/1.1 403 Forbidden\r\ncontent-length: 0\r\nconnection: close\r\n\r\n";
                stream.write_all(answer).expect("it is read");
            }
        });
        let options = vec![("allow_http".to_owned(), "true".to_owned())];
        let place = ObjectPlace { url, options };
        let objects = Objects::open(&place, 0, StorageMetrics::default()).expect("an address");
        let objects = Arc::new(objects);
        let open = async || objects.dataset("a.lods").await.map(|_| ());
        let told = Err(OpenError::Unanswered);
        assert_eq!(
            tokio::join!(open(), open(), open()),
            (told.clone(), told.clone(), told.clone())
        );
        assert_eq!(asked.load(Ordering::Relaxed), 1);
        assert_eq!(open().await, told);
        assert_eq!(asked.load(Ordering::Relaxed), 2);
    }
}
