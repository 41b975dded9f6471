//! Requests as a patient makes them, and everything about their answers, checked or not.
//!
//! Not by [`HttpSource`](crate::source::HttpSource), which refuses what it does not like: here that is
//! what is to be told.

use std::time::{Duration, Instant};

use bytes::{Bytes, BytesMut};
use reqwest::{
    Client, Method, StatusCode, Url, Version,
    header::{self, HeaderMap, HeaderName, HeaderValue},
};

/// Who asks, as far as browsers' rules are concerned.
pub const ORIGIN: &str = "https://viewer.example";

/// Most bytes of one body. What is longer is not read on.
const MOST_BODY_BYTES: u64 = 8 << 20;

/// Requests that a patient may be asked, and how long the whole may take.
const MOST_REQUESTS: u64 = 120;
const MOST_TIME: Duration = Duration::from_secs(90);

/// How long a host may be silent.
const SILENCE: Duration = Duration::from_secs(10);

/// Asks and counts.
#[derive(Debug)]
pub struct Probe {
    client: Client,
    url: Url,
    begin: Instant,
    requests: std::sync::atomic::AtomicU64,
    bytes: std::sync::atomic::AtomicU64,
}

/// An answer, as far as it came.
#[derive(Debug, Clone)]
pub struct Answer {
    /// Where it came from, after redirections.
    pub url: Url,
    /// The version of HTTP.
    pub version: Version,
    /// The status.
    pub status: StatusCode,
    /// The fields.
    pub headers: HeaderMap,
    /// What there is of the body.
    pub body: Bytes,
    /// Why there is no more of it, where it broke off.
    pub broken: Option<String>,
    /// From sending to the head.
    pub head: Duration,
    /// From sending to the end.
    pub whole: Duration,
}

impl Probe {
    /// A probe of the file at `url`.
    pub fn new(url: Url) -> anyhow::Result<Self> {
        // An error means that the process has chosen its provider already: just as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut builder = Client::builder()
            .user_agent(concat!("lodestream-doctor/", env!("CARGO_PKG_VERSION")))
            .tcp_nodelay(true)
            .connect_timeout(SILENCE)
            .read_timeout(SILENCE);
        if crate::source::is_local(&url) {
            builder = builder.no_proxy();
        }
        let client = builder.build()?;
        let zero = std::sync::atomic::AtomicU64::new;
        Ok(Self { client, url, begin: Instant::now(), requests: zero(0), bytes: zero(0) })
    }

    /// The address.
    pub const fn url(&self) -> &Url {
        &self.url
    }

    /// Requests and bytes so far.
    pub fn spent(&self) -> (u64, u64) {
        let order = std::sync::atomic::Ordering::Relaxed;
        (self.requests.load(order), self.bytes.load(order))
    }

    /// Asks for bytes `start` to `end` (one past the last).
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn range(&self, start: u64, end: u64) -> Result<Answer, String> {
        self.range_with(start, end, &[]).await
    }

    /// The same, breaking off what takes longer than `longest`.
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn range_within(
        &self,
        start: u64,
        end: u64,
        longest: Duration,
    ) -> Result<Answer, String> {
        let range = format!("bytes={start}-{}", end.saturating_sub(1));
        self.send(Method::GET, &[(header::RANGE, &range)], end - start, longest).await
    }

    /// The same, with more fields.
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn range_with(
        &self,
        start: u64,
        end: u64,
        fields: &[(HeaderName, &str)],
    ) -> Result<Answer, String> {
        let range = format!("bytes={start}-{}", end.saturating_sub(1));
        let mut all = vec![(header::RANGE, range.as_str())];
        all.extend(fields.iter().cloned());
        self.ask(Method::GET, &all, end - start).await
    }

    /// Asks with any method and fields; of the body at most `wanted` bytes and a few more are read.
    ///
    /// # Errors
    /// Why there is no answer.
    pub async fn ask(
        &self,
        method: Method,
        fields: &[(HeaderName, &str)],
        wanted: u64,
    ) -> Result<Answer, String> {
        self.send(method, fields, wanted, MOST_TIME).await
    }

    async fn send(
        &self,
        method: Method,
        fields: &[(HeaderName, &str)],
        wanted: u64,
        longest: Duration,
    ) -> Result<Answer, String> {
        let order = std::sync::atomic::Ordering::Relaxed;
        if self.requests.fetch_add(1, order) >= MOST_REQUESTS || self.begin.elapsed() > MOST_TIME {
            return Err("given up: that would take more requests or time than is fair".into());
        }
        let mut headers = HeaderMap::new();
        for (name, value) in fields {
            let value = HeaderValue::from_str(value).map_err(|e| e.to_string())?;
            headers.insert(name, value);
        }
        let sent = Instant::now();
        let request = self.client.request(method, self.url.clone()).headers(headers);
        let mut response = request.send().await.map_err(|e| innermost(&e))?;
        let head = sent.elapsed();
        let mut answer = Answer {
            url: response.url().clone(),
            version: response.version(),
            status: response.status(),
            headers: response.headers().clone(),
            body: Bytes::new(),
            broken: None,
            head,
            whole: head,
        };
        let most = wanted.min(MOST_BODY_BYTES);
        let mut body = BytesMut::new();
        loop {
            match response.chunk().await {
                Ok(Some(piece)) => {
                    self.bytes.fetch_add(piece.len() as u64, order);
                    body.extend_from_slice(&piece);
                    // One more tells that there is too much; the rest would tell no more.
                    if body.len() as u64 > most || sent.elapsed() > longest {
                        break;
                    }
                }
                Ok(None) => break,
                Err(error) => {
                    answer.broken = Some(innermost(&error));
                    break;
                }
            }
        }
        answer.body = body.freeze();
        answer.whole = sent.elapsed();
        Ok(answer)
    }
}

impl Answer {
    /// A field as text.
    #[must_use]
    pub fn field(&self, name: &HeaderName) -> Option<&str> {
        self.headers.get(name)?.to_str().ok()
    }

    /// What `Content-Range` says: first, one past the last, and the whole file's length.
    #[must_use]
    pub fn content_range(&self) -> Option<(u64, u64, Option<u64>)> {
        let text = self.field(&header::CONTENT_RANGE)?.trim().strip_prefix("bytes ")?;
        let (range, total) = text.split_once('/')?;
        let (first, last) = range.split_once('-')?;
        let (first, last) = (first.trim().parse().ok()?, last.trim().parse::<u64>().ok()?);
        Some((first, last.checked_add(1)?, total.trim().parse().ok()))
    }

    /// Whether it is the bytes `start` to `end`, whole and as they are.
    #[must_use]
    pub fn is_range(&self, start: u64, end: u64) -> bool {
        self.status == StatusCode::PARTIAL_CONTENT
            && self.broken.is_none()
            && self.content_range().is_some_and(|(first, last, _)| (first, last) == (start, end))
            && self.body.len() as u64 == end - start
            && self.field(&header::CONTENT_ENCODING).is_none_or(|e| e == "identity")
    }
}

/// The cause at the bottom: `Connection refused`, where the top says `error sending request`.
fn innermost(error: &reqwest::Error) -> String {
    if error.is_timeout() {
        return format!("silent for {} s", SILENCE.as_secs());
    }
    let mut cause: &dyn std::error::Error = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}
