//! A file on any host that answers HTTP range requests.
//!
//! Every answer is checked before its body is read: the status, the range, the length, and that the
//! file is still the one that the first answer came from. A host that ignores ranges would send
//! whole files again and again; its 200 is recognised from the head and the connection is closed
//! without the body.

use std::{
    sync::{Arc, OnceLock},
    time::Duration,
};

use bytes::Bytes;
use reqwest::{
    Client, Response, StatusCode, Url,
    header::{self, HeaderMap},
};

use super::{Announced, Fault, SourceError, Wire, wire::Trip};

/// How long a host may be silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Timeouts {
    /// Until a connection stands.
    pub connect: Duration,
    /// Until the head of an answer or the next part of its body arrives. There is no limit for a
    /// whole answer: a slow link is no failure.
    pub silence: Duration,
}

impl Default for Timeouts {
    /// 10 s to connect, 15 s of silence.
    fn default() -> Self {
        Self { connect: Duration::from_secs(10), silence: Duration::from_secs(15) }
    }
}

/// A dataset file at a URL. Clones share connections.
#[derive(Debug, Clone)]
pub struct HttpSource {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    client: Client,
    url: Url,
    /// The URL without what may be secret.
    place: String,
    wire: Wire,
    /// Set by the first good answer.
    identity: OnceLock<Identity>,
}

/// What tells one version of a file from another.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Identity {
    etag: Option<String>,
    total: Option<u64>,
}

/// Which bytes to ask for.
#[derive(Debug, Clone, Copy)]
struct Ask {
    offset: u64,
    len: u64,
    /// Whether the answer may be shorter because the file ends.
    may_end: bool,
}

/// The bytes an answer announces: first, one past the last, and the length of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct ContentRange {
    start: u64,
    end: u64,
    total: Option<u64>,
}

impl HttpSource {
    /// A source at `url` with the default [`Timeouts`]. Nothing is asked yet.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the system cannot provide an HTTP client.
    pub fn new(url: Url) -> Result<Self, SourceError> {
        Self::with_timeouts(url, Timeouts::default())
    }

    /// A source at `url`. Nothing is asked yet.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the system cannot provide an HTTP client.
    pub fn with_timeouts(url: Url, timeouts: Timeouts) -> Result<Self, SourceError> {
        Self::by_wire(url, timeouts, Wire::default())
    }

    /// A source at `url` whose requests go through `wire`. Nothing is asked yet.
    ///
    /// # Errors
    /// [`SourceError::Permanent`] where the system cannot provide an HTTP client.
    pub fn by_wire(url: Url, timeouts: Timeouts, wire: Wire) -> Result<Self, SourceError> {
        // An error means that the process has chosen its provider already: just as good.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let place = without_secrets(&url);
        let mut builder = Client::builder()
            .user_agent(concat!("lodestream/", env!("CARGO_PKG_VERSION")))
            .tcp_nodelay(true)
            .connect_timeout(timeouts.connect)
            .read_timeout(timeouts.silence);
        if is_local(&url) {
            builder = builder.no_proxy();
        }
        if wire.meter.is_some() && url.scheme() == "http" {
            // Reading the system's certificates takes 6 ms of processor time: more than all else a
            // client does until its first picture, and there may be thousands.
            builder = builder.tls_certs_only([]);
        }
        let client = builder
            .build()
            .map_err(|e| SourceError::permanent(&place, format!("no HTTP client: {e}")))?;
        Ok(Self { inner: Arc::new(Inner { client, url, place, wire, identity: OnceLock::new() }) })
    }

    /// The URL, with whatever secrets it holds.
    #[must_use]
    pub fn url(&self) -> &Url {
        &self.inner.url
    }

    pub(super) fn describe(&self) -> String {
        self.inner.place.clone()
    }

    pub(super) async fn stream_range(
        &self,
        offset: u64,
        len: u64,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        let ask = Ask { offset, len, may_end: false };
        self.transfer(ask, &mut |piece, _| sink(piece)).await
    }

    pub(super) async fn stream_prefix(
        &self,
        len: u64,
        sink: &mut (dyn FnMut(Bytes, Announced) + Send),
    ) -> Result<(), SourceError> {
        self.transfer(Ask { offset: 0, len, may_end: true }, sink).await
    }

    /// Sends the request and hands on its answer, by the wire.
    async fn transfer(
        &self,
        ask: Ask,
        sink: &mut (dyn FnMut(Bytes, Announced) + Send),
    ) -> Result<(), SourceError> {
        let Some(mut trip) = self.inner.wire.depart(ask.offset).await else {
            return Err(self.permanent("no more requests may be sent"));
        };
        let outcome = match self.ask(ask).await {
            Ok((response, range)) => {
                trip.answered().await;
                let announced = Announced { len: range.end - range.start, total: range.total };
                self.read_body(response, announced, &mut trip, sink).await
            }
            Err(error) => Err(error),
        };
        trip.end(outcome.as_ref().map(|()| ()).map_err(SourceError::fault));
        outcome
    }

    pub(super) async fn size(&self) -> Result<u64, SourceError> {
        if self.inner.identity.get().is_none() {
            self.stream_prefix(1, &mut |_, _| {}).await?;
        }
        let total = self.inner.identity.get().and_then(|identity| identity.total);
        total.ok_or_else(|| self.permanent("the host does not tell the length of the file"))
    }

    /// Sends the request and checks the head of the answer.
    async fn ask(&self, ask: Ask) -> Result<(Response, ContentRange), SourceError> {
        let Some(last) = ask.len.checked_sub(1).and_then(|n| ask.offset.checked_add(n)) else {
            return Err(self.permanent(format!("{} bytes at {} are no range", ask.len, ask.offset)));
        };
        let response = self
            .inner
            .client
            .get(self.inner.url.clone())
            .header(header::RANGE, format!("bytes={}-{last}", ask.offset))
            .send()
            .await
            .map_err(|e| self.classify(&e))?;
        if response.status() != StatusCode::PARTIAL_CONTENT {
            return Err(self.refuse(&response, ask));
        }
        let range = self.check_range(response.headers(), ask)?;
        self.check_identity(response.headers(), range.total)?;
        if let Some(length) = response.content_length()
            && length != range.end - range.start
        {
            let announced = range.end - range.start;
            let wrong = format!("the answer is {length} bytes long but announces {announced}");
            return Err(self.transient(wrong).of(Fault::WrongRange));
        }
        Ok((response, range))
    }

    async fn read_body(
        &self,
        mut response: Response,
        announced: Announced,
        trip: &mut Trip<'_>,
        sink: &mut (dyn FnMut(Bytes, Announced) + Send),
    ) -> Result<(), SourceError> {
        let (expected, mut received) = (announced.len, 0);
        while let Some(piece) = response.chunk().await.map_err(|e| self.classify(&e))? {
            received += piece.len() as u64;
            if received > expected {
                let more = format!("more than the {expected} bytes asked for");
                return Err(self.transient(more).of(Fault::WrongRange));
            }
            trip.received(piece.len() as u64).await;
            sink(piece, announced);
        }
        if received < expected {
            let short = format!("the answer broke off after {received} of {expected} bytes");
            return Err(self.transient(short).of(Fault::BrokenOff));
        }
        Ok(())
    }

    fn check_range(&self, headers: &HeaderMap, ask: Ask) -> Result<ContentRange, SourceError> {
        let text = headers.get(header::CONTENT_RANGE).and_then(|v| v.to_str().ok());
        let encoding = headers.get(header::CONTENT_ENCODING);
        if encoding.is_some_and(|e| e != "identity") {
            let message = "the host compresses ranges; switch that off for .lods";
            return Err(self.permanent(message).of(Fault::Compressed));
        }
        let range = text.and_then(ContentRange::parse).ok_or_else(|| {
            let message = format!("the answer announces no usable range ({text:?})");
            self.transient(message).of(Fault::WrongRange)
        })?;
        let wanted = ask.offset + ask.len;
        let complete = range.end == wanted
            || ask.may_end && range.end < wanted && range.total.is_none_or(|t| t == range.end);
        if let Some(total) = range.total
            && total < wanted
            && !ask.may_end
        {
            let message = format!(
                "bytes {} to {wanted} are beyond the end of the file ({total} bytes): cut short",
                ask.offset
            );
            return Err(self.permanent(message).of(Fault::WrongRange));
        }
        if range.start != ask.offset || !complete {
            let message = format!(
                "asked for bytes {} to {wanted}, the answer announces {} to {}",
                ask.offset, range.start, range.end
            );
            return Err(self.transient(message).of(Fault::WrongRange));
        }
        Ok(range)
    }

    fn check_identity(&self, headers: &HeaderMap, total: Option<u64>) -> Result<(), SourceError> {
        let found = Identity { etag: etag(headers), total };
        let first = self.inner.identity.get_or_init(|| found.clone());
        if first.differs_from(&found) {
            return Err(self.changed());
        }
        Ok(())
    }

    /// The error for an answer that is not 206.
    fn refuse(&self, response: &Response, ask: Ask) -> SourceError {
        let status = response.status();
        let error = match status {
            StatusCode::OK => {
                let found = Identity { etag: etag(response.headers()), total: None };
                return match self.inner.identity.get() {
                    Some(first) if first.differs_from(&found) => self.changed(),
                    // It can answer ranges: this was a bad moment, or a proxy's error page.
                    Some(_) => self
                        .transient("answered a range request with 200 this time")
                        .of(Fault::WholeFile),
                    None => self
                        .permanent(
                            "the host answers range requests with the whole file (status 200); \
                             nothing was downloaded. Use a host or proxy that supports Range, such \
                             as `lodestream serve`",
                        )
                        .of(Fault::WholeFile),
                };
            }
            StatusCode::RANGE_NOT_SATISFIABLE => self.permanent(format!(
                "bytes {} to {} are beyond the end of the file: it is empty or cut short",
                ask.offset,
                ask.offset + ask.len
            )),
            StatusCode::NOT_FOUND | StatusCode::GONE => {
                self.permanent(format!("not found ({status}); check the address"))
            }
            StatusCode::UNAUTHORIZED | StatusCode::FORBIDDEN => {
                self.permanent(format!("access denied ({status})"))
            }
            StatusCode::REQUEST_TIMEOUT | StatusCode::TOO_EARLY | StatusCode::TOO_MANY_REQUESTS => {
                self.transient(format!("the host answered {status}"))
            }
            _ if status.is_server_error() => self.transient(format!("the host answered {status}")),
            _ => self.permanent(format!("the host answered {status}")),
        };
        error.of(Fault::Status(status.as_u16()))
    }

    fn classify(&self, error: &reqwest::Error) -> SourceError {
        if error.is_builder() || error.is_redirect() {
            return self.permanent(innermost(error));
        }
        let (what, fault) = match error.is_connect() {
            true => ("no connection: ", Fault::NoConnection),
            false => ("", Fault::BrokenOff),
        };
        if error.is_timeout() {
            let fault = if error.is_connect() { fault } else { Fault::Silent };
            return self.transient(format!("{what}the host is silent")).of(fault);
        }
        self.transient(format!("{what}{}", innermost(error))).of(fault)
    }

    fn changed(&self) -> SourceError {
        let message = "the file was replaced while it was in use; open it again";
        self.permanent(message).of(Fault::Replaced)
    }

    fn transient(&self, message: impl Into<String>) -> SourceError {
        SourceError::transient(&self.inner.place, message)
    }

    fn permanent(&self, message: impl Into<String>) -> SourceError {
        SourceError::permanent(&self.inner.place, message)
    }
}

impl Identity {
    /// Whether both tell, and tell different things.
    fn differs_from(&self, other: &Self) -> bool {
        let etags = self.etag.as_ref().zip(other.etag.as_ref());
        let totals = self.total.zip(other.total);
        etags.is_some_and(|(a, b)| a != b) || totals.is_some_and(|(a, b)| a != b)
    }
}

impl ContentRange {
    /// Parses `bytes FIRST-LAST/TOTAL`, where TOTAL may be `*`.
    fn parse(text: &str) -> Option<Self> {
        let (range, total) = text.trim().strip_prefix("bytes ")?.trim().split_once('/')?;
        let (first, last) = range.split_once('-')?;
        let (start, last): (u64, u64) = (first.trim().parse().ok()?, last.trim().parse().ok()?);
        let total = match total.trim() {
            "*" => None,
            total => Some(total.parse().ok()?),
        };
        let end = last.checked_add(1)?;
        (start < end && total.is_none_or(|t| end <= t)).then_some(Self { start, end, total })
    }
}

fn etag(headers: &HeaderMap) -> Option<String> {
    Some(headers.get(header::ETAG)?.to_str().ok()?.to_owned())
}

/// The cause at the bottom: `Connection refused`, where the top says `error sending request`.
fn innermost(error: &reqwest::Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}

/// Whether a URL names this machine by its loopback address.
#[must_use]
pub fn is_local(url: &Url) -> bool {
    let host = url.host_str().unwrap_or_default().trim_matches(['[', ']']);
    host == "localhost" || host.parse::<std::net::IpAddr>().is_ok_and(|ip| ip.is_loopback())
}

fn without_secrets(url: &Url) -> String {
    let mut shown = url.clone();
    shown.set_query(None);
    // Neither can fail for http URLs; if it did, the URL holds no credentials.
    let _ = shown.set_password(None);
    let _ = shown.set_username("");
    shown.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_ranges_that_contradict_themselves_are_refused() {
        let parse = ContentRange::parse;
        let good = ContentRange { start: 5, end: 10, total: Some(10) };
        assert_eq!(parse("bytes 5-9/10"), Some(good));
        assert_eq!(parse("bytes 5-9/*"), Some(ContentRange { total: None, ..good }));
        for bad in [
            "bytes 5-4/10",
            "bytes 5-10/10",
            "bytes */10",
            "items 5-9/10",
            "bytes 5-9",
            "bytes -5-9/10",
            "bytes 0-18446744073709551615/*",
        ] {
            assert_eq!(parse(bad), None, "{bad}");
        }
    }

    #[test]
    fn secrets_in_a_url_are_not_shown() {
        let url = Url::parse("https://me:pw@a.example/b.lods?signature=x").expect("a URL");
        let source = HttpSource::new(url).expect("a client");
        assert_eq!(source.describe(), "https://a.example/b.lods");
    }
}
