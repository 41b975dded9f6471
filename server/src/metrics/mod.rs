//! What the server tells Prometheus at `/metrics`.
//!
//! Every server has a registry of its own, none of the process's: a program may run several. Names
//! of datasets become labels only once a dataset of that name has been served, and no more than
//! [`MAX_DATASETS`] of them, so that no client can fill the memory with names.

mod process;

use std::{
    collections::HashSet,
    fmt::Write,
    sync::{PoisonError, RwLock},
    time::Duration,
};

use prometheus_client::{
    encoding::{EncodeLabelSet, EncodeLabelValue, LabelValueEncoder, text::encode},
    metrics::{
        counter::Counter,
        family::Family,
        gauge::Gauge,
        histogram::{Histogram, exponential_buckets},
    },
    registry::Registry,
};

use process::Process;

/// Datasets that have labels of their own; the rest share `(other)`, which is no dataset's name.
const MAX_DATASETS: usize = 1000;
const OTHER: &str = "(other)";

/// What a request asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    /// A dataset's file, whole or by range.
    File,
    /// Many nodes of a dataset.
    Batch,
    /// A dataset's picture.
    Preview,
    /// The list, as JSON or as a page, and its description.
    Index,
    /// Health, readiness, figures.
    Operation,
    /// Nothing that is there.
    Unknown,
}

impl Kind {
    /// By the route that took the request.
    pub(crate) fn of(route: Option<&str>) -> Self {
        match route {
            Some("/healthz" | "/readyz" | "/metrics") => Self::Operation,
            Some("/" | "/datasets" | "/openapi.json") => Self::Index,
            Some("/{file}" | "/datasets/{file}") => Self::File,
            Some("/datasets/{file}/preview.png") => Self::Preview,
            Some(route) if route.contains("{file}") => Self::Batch,
            _ => Self::Unknown,
        }
    }

    /// The word in figures and log.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::File => "file",
            Self::Batch => "batch",
            Self::Preview => "preview",
            Self::Index => "index",
            Self::Operation => "operation",
            Self::Unknown => "unknown",
        }
    }
}

impl EncodeLabelValue for Kind {
    fn encode(&self, encoder: &mut LabelValueEncoder) -> std::fmt::Result {
        encoder.write_str(self.name())
    }
}

/// Which dataset, asked for how.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Subject {
    dataset: String,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct Outcome {
    dataset: String,
    kind: Kind,
    status: u16,
}

/// The server's figures.
#[derive(Debug)]
pub(crate) struct Metrics {
    registry: Registry,
    named: RwLock<HashSet<String>>,
    requests: Family<Outcome, Counter>,
    bytes: Family<Subject, Counter>,
    first_byte: Family<Subject, Histogram>,
    last_byte: Family<Subject, Histogram>,
    broken: Family<Subject, Counter>,
    /// What an object store is asked.
    pub(crate) storage: StorageMetrics,
    /// Connections that stand.
    pub(crate) connections: Gauge,
    /// Connections taken since the start.
    pub(crate) accepted: Counter,
    /// Handshakes of TLS that failed.
    pub(crate) handshakes_failed: Counter,
    /// Requests refused because their client asked too often.
    pub(crate) rate_limited: Counter,
    /// Requests refused for lack of a right.
    pub(crate) denied: Counter,
}

/// What an object store is asked, and what is not asked of it.
#[derive(Debug, Clone, Default)]
pub(crate) struct StorageMetrics {
    /// Blocks that were in memory.
    pub(crate) hits: Counter,
    /// Requests for blocks that were not.
    pub(crate) misses: Counter,
    /// Bytes that came from the store.
    pub(crate) fetched: Counter,
    /// Bytes in memory.
    pub(crate) kept: Gauge,
}

impl StorageMetrics {
    fn register(&self, registry: &mut Registry) {
        registry.register("cache_hits", "Blocks that were in memory", self.hits.clone());
        registry.register("cache_misses", "Requests for blocks that were not", self.misses.clone());
        registry.register("cache_bytes", "Bytes in memory of an object store", self.kept.clone());
        registry.register("store_bytes", "Bytes that an object store sent", self.fetched.clone());
    }
}

/// One answered request.
#[derive(Debug)]
pub(crate) struct Answered<'a> {
    /// The dataset's name, where one was served.
    pub(crate) dataset: &'a str,
    pub(crate) kind: Kind,
    pub(crate) status: u16,
    pub(crate) bytes: u64,
    pub(crate) until_first_byte: Duration,
    pub(crate) until_last_byte: Duration,
    /// Whether all of the response was taken by the client's connection.
    pub(crate) is_whole: bool,
}

impl Metrics {
    pub(crate) fn new() -> Self {
        let mut registry = Registry::with_prefix("lodestream");
        // From 0.1 ms to 26 s.
        let times: fn() -> Histogram = || Histogram::new(exponential_buckets(1e-4, 4.0, 10));
        let metrics = Self {
            named: RwLock::default(),
            requests: Family::default(),
            bytes: Family::default(),
            first_byte: Family::new_with_constructor(times),
            last_byte: Family::new_with_constructor(times),
            broken: Family::default(),
            storage: StorageMetrics::default(),
            connections: Gauge::default(),
            accepted: Counter::default(),
            handshakes_failed: Counter::default(),
            rate_limited: Counter::default(),
            denied: Counter::default(),
            registry: Registry::default(),
        };
        let m = &metrics;
        registry.register("requests", "Requests answered", m.requests.clone());
        registry.register(
            "response_bytes",
            "Bytes of bodies handed to connections",
            m.bytes.clone(),
        );
        registry.register(
            "first_byte_seconds",
            "Time from a request's head until its response's head is ready",
            m.first_byte.clone(),
        );
        registry.register(
            "last_byte_seconds",
            "Time from a request's head until the end of its response is handed to the connection",
            m.last_byte.clone(),
        );
        registry.register(
            "responses_broken",
            "Responses that ended before their end, by client or by disk",
            m.broken.clone(),
        );
        registry.register("connections_open", "Connections that stand", m.connections.clone());
        registry.register("connections", "Connections taken", m.accepted.clone());
        registry.register(
            "tls_handshakes_failed",
            "TLS handshakes that came to nothing",
            m.handshakes_failed.clone(),
        );
        registry.register(
            "requests_rate_limited",
            "Requests refused because their client asked too often",
            m.rate_limited.clone(),
        );
        registry.register(
            "requests_denied",
            "Requests refused for want of a right",
            m.denied.clone(),
        );
        m.storage.register(&mut registry);
        registry.register_collector(Box::new(Process));
        Self { registry, ..metrics }
    }

    /// The figures, for Prometheus to read.
    pub(crate) fn render(&self) -> String {
        let mut text = String::new();
        // Writing to a string does not fail.
        let _ = encode(&mut text, &self.registry);
        text
    }

    /// Counts an answered request.
    pub(crate) fn count(&self, answered: &Answered) {
        let dataset = self.label(answered.dataset);
        let subject = Subject { dataset: dataset.clone(), kind: answered.kind };
        let outcome = Outcome { dataset, kind: answered.kind, status: answered.status };
        self.requests.get_or_create(&outcome).inc();
        self.bytes.get_or_create(&subject).inc_by(answered.bytes);
        let seconds = answered.until_first_byte.as_secs_f64();
        self.first_byte.get_or_create(&subject).observe(seconds);
        if answered.is_whole {
            let seconds = answered.until_last_byte.as_secs_f64();
            self.last_byte.get_or_create(&subject).observe(seconds);
        } else {
            self.broken.get_or_create(&subject).inc();
        }
    }

    fn label(&self, dataset: &str) -> String {
        let is_known = |named: &HashSet<String>| dataset.is_empty() || named.contains(dataset);
        if is_known(&self.named.read().unwrap_or_else(PoisonError::into_inner)) {
            return dataset.to_owned();
        }
        let mut named = self.named.write().unwrap_or_else(PoisonError::into_inner);
        if named.len() < MAX_DATASETS {
            named.insert(dataset.to_owned());
        }
        if is_known(&named) { dataset.to_owned() } else { OTHER.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answered(dataset: &str) -> Answered<'_> {
        Answered {
            dataset,
            kind: Kind::File,
            status: 206,
            bytes: 100,
            until_first_byte: Duration::from_millis(1),
            until_last_byte: Duration::from_millis(2),
            is_whole: true,
        }
    }

    #[test]
    fn requests_are_counted_by_dataset_kind_and_status() {
        let metrics = Metrics::new();
        metrics.count(&answered("a"));
        metrics.count(&answered("a"));
        metrics.count(&Answered { is_whole: false, ..answered("b") });
        let text = metrics.render();
        for line in [
            "lodestream_requests_total{dataset=\"a\",kind=\"file\",status=\"206\"} 2",
            "lodestream_response_bytes_total{dataset=\"a\",kind=\"file\"} 200",
            "lodestream_last_byte_seconds_count{dataset=\"a\",kind=\"file\"} 2",
            "lodestream_responses_broken_total{dataset=\"b\",kind=\"file\"} 1",
            "lodestream_connections_open 0",
        ] {
            assert!(text.contains(&format!("\n{line}\n")), "no {line} in {text}");
        }
    }

    #[test]
    fn names_beyond_the_bound_share_a_label() {
        let metrics = Metrics::new();
        for i in 0..MAX_DATASETS + 5 {
            metrics.count(&answered(&i.to_string()));
        }
        let text = metrics.render();
        assert!(text.contains(
            "lodestream_requests_total{dataset=\"(other)\",kind=\"file\",status=\"206\"} 5"
        ));
    }
}
