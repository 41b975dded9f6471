//! A file on any host that answers HTTP range requests.
//!
//! Every answer is checked before its body is read: the status, the range, the length, and that the
//! file is still the one that the first answer came from. A host that ignores ranges would send
//! whole files again and again; its 200 is recognised from the head and the connection is closed
//! without the body.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, Ordering},
};

use bytes::Bytes;
use lodestream_protocol::{
    BATCH_REQUEST_TYPE, BATCH_TYPE, BatchDecoder, BatchPart, BatchRequest, MAX_BATCH_BYTES,
    MAX_BATCH_PARTS,
};
use reqwest::{
    Response, StatusCode, Url,
    header::{self, HeaderMap},
};

use super::{
    Announced, BatchLimits, Fault, SourceError, Wire,
    connector::{Connections, Connector, Timeouts},
    wire::Trip,
};

/// A dataset file at a URL. Clones share connections.
#[derive(Debug, Clone)]
pub struct HttpSource {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    connector: Arc<Connector>,
    url: Url,
    /// The URL without what may be secret.
    place: String,
    wire: Wire,
    /// Set by the first good answer.
    identity: OnceLock<Identity>,
    /// What the host offers, set by the first answer that tells.
    batches: OnceLock<Offer>,
    /// Something between here and the host lets no batches through.
    takes_no_batches: AtomicBool,
}

/// A host's offer to take requests for many parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Offer {
    content_id: [u8; 16],
    limits: BatchLimits,
}

/// What tells one version of a file from another.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Identity {
    etag: Option<String>,
    /// `Last-Modified`, for hosts that have no entity tags.
    modified: Option<String>,
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
    #[must_use]
    pub fn new(url: Url) -> Self {
        Self::with_timeouts(url, Timeouts::default())
    }

    /// A source at `url`. Nothing is asked yet.
    #[must_use]
    pub fn with_timeouts(url: Url, timeouts: Timeouts) -> Self {
        Self::by_wire(url, timeouts, Wire::default())
    }

    /// A source at `url` whose requests go through `wire`. Nothing is asked yet.
    #[must_use]
    pub fn by_wire(url: Url, timeouts: Timeouts, wire: Wire) -> Self {
        let connector = Connector::new(timeouts, &url);
        // There may be thousands that are measured, and each of them a client of its own.
        let needs_none = wire.meter.is_some() && url.scheme() == "http";
        let connector = if needs_none { connector.without_certificates() } else { connector };
        Self::through(Arc::new(connector), url, wire)
    }

    fn through(connector: Arc<Connector>, url: Url, wire: Wire) -> Self {
        let place = without_secrets(&url);
        let (identity, batches) = (OnceLock::new(), OnceLock::new());
        let takes_no_batches = AtomicBool::new(false);
        let inner = Inner { connector, url, place, wire, identity, batches, takes_no_batches };
        Self { inner: Arc::new(inner) }
    }

    /// A source of whatever lies at the URL now. Shares connections.
    pub(super) fn renew(&self) -> Self {
        let Inner { connector, url, wire, .. } = &*self.inner;
        Self::through(Arc::clone(connector), url.clone(), wire.clone())
    }

    /// The source, sharing connections with others.
    pub(super) fn sharing(&self, connections: &Connections) -> Self {
        let Inner { connector, url, wire, .. } = &*self.inner;
        Self::through(connections.shared(connector), url.clone(), wire.clone())
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
        let mut trip = self.depart(ask.offset).await?;
        let outcome = match self.ask(ask).await {
            Ok((response, range)) => {
                trip.answered().await;
                let announced = Announced { len: range.end - range.start, total: range.total };
                self.read_body(response, announced, &mut trip, sink).await
            }
            Err(error) => Err(error),
        };
        trip.end(outcome.as_ref().err().map(SourceError::fault));
        outcome
    }

    pub(super) fn batch_limits(&self) -> Option<BatchLimits> {
        let is_barred = self.inner.takes_no_batches.load(Ordering::Relaxed);
        self.inner.batches.get().filter(|_| !is_barred).map(|offer| offer.limits)
    }

    /// Without an offer, or where what lies between bars batches after all, the parts come one by one.
    pub(super) async fn stream_parts(
        &self,
        parts: &[BatchPart],
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        let offer = self.inner.batches.get().filter(|_| self.batch_limits().is_some());
        if let Some(offer) = offer {
            let request = BatchRequest { content_id: offer.content_id, parts: parts.to_vec() };
            let start = parts.first().map_or(0, |part| part.offset);
            let mut trip = self.depart(start).await?;
            let outcome = self.transfer_batch(request, &mut trip, sink).await;
            trip.end(outcome.as_ref().err().map(SourceError::fault));
            if outcome? {
                return Ok(());
            }
            self.inner.takes_no_batches.store(true, Ordering::Relaxed);
        }
        for part in parts {
            self.stream_range(part.offset, u64::from(part.bytes), sink).await?;
        }
        Ok(())
    }

    /// Sends the request and hands on its answer, by the wire; `false` where it is not of a host that takes
    /// batches.
    async fn transfer_batch(
        &self,
        request: BatchRequest,
        trip: &mut Trip<'_>,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<bool, SourceError> {
        let Some(response) = self.ask_for_batch(&request).await? else { return Ok(false) };
        trip.answered().await;
        self.read_batch(response, request, trip, sink).await?;
        Ok(true)
    }

    /// Lets a request for bytes from `offset` go.
    async fn depart(&self, offset: u64) -> Result<Trip<'_>, SourceError> {
        let trip = self.inner.wire.depart(offset).await;
        trip.ok_or_else(|| self.permanent("no more requests may be sent"))
    }

    /// `None` where the answer is not of a host that takes batches.
    async fn ask_for_batch(&self, request: &BatchRequest) -> Result<Option<Response>, SourceError> {
        let body = request.encode().map_err(|e| self.permanent(e.to_string()))?;
        let mut url = self.inner.url.clone();
        url.set_path(&format!("{}/batch", url.path()));
        let client = self.inner.connector.client().map_err(|why| self.permanent(why))?;
        let post = client.post(url).header(header::CONTENT_TYPE, BATCH_REQUEST_TYPE);
        let response = post.body(body).send().await.map_err(|e| self.classify(&e))?;
        let status = response.status();
        match status {
            StatusCode::OK => {
                let content_type = response.headers().get(header::CONTENT_TYPE);
                return Ok(content_type.is_some_and(|t| t == BATCH_TYPE).then_some(response));
            }
            // Either the file was replaced, or what lies between answers so whatever is there. What the ranges'
            // answers come from tells which: they are asked for next, and are not taken from another file.
            StatusCode::PRECONDITION_FAILED => return Ok(None),
            StatusCode::RANGE_NOT_SATISFIABLE => {
                let message = "a part is beyond the end of the file: cut short";
                return Err(self.permanent(message).of(Fault::Status(status.as_u16())));
            }
            StatusCode::REQUEST_TIMEOUT | StatusCode::TOO_EARLY | StatusCode::TOO_MANY_REQUESTS => {
            }
            StatusCode::NOT_IMPLEMENTED => return Ok(None),
            _ if status.is_server_error() => {}
            _ => return Ok(None),
        }
        let error = self.transient(format!("the host answered {status}"));
        Err(error.of(Fault::Status(status.as_u16())))
    }

    async fn read_batch(
        &self,
        mut response: Response,
        request: BatchRequest,
        trip: &mut Trip<'_>,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        let mut decoder = BatchDecoder::new(request);
        while let Some(mut piece) = response.chunk().await.map_err(|e| self.classify(&e))? {
            trip.received(piece.len() as u64).await;
            while !piece.is_empty() {
                let step = decoder
                    .step(&piece)
                    .map_err(|e| self.transient(e.to_string()).of(Fault::WrongRange))?;
                let bytes = piece.split_to(step.bytes);
                if step.is_payload {
                    sink(bytes);
                }
            }
        }
        if decoder.is_complete() {
            Ok(())
        } else {
            Err(self.transient("the answer broke off").of(Fault::BrokenOff))
        }
    }

    pub(super) async fn size(&self) -> Result<u64, SourceError> {
        if self.inner.identity.get().is_none() {
            self.stream_prefix(1, &mut |_, _| {}).await?;
        }
        let total = self.inner.identity.get().and_then(|identity| identity.total);
        total.ok_or_else(|| self.permanent("the host does not tell the length of the file"))
    }

    /// The whole of what lies there, at most so many bytes: for documents, not for datasets.
    pub(super) async fn read_document(&self, most: usize) -> Result<Vec<u8>, SourceError> {
        let client = self.inner.connector.client().map_err(|why| self.permanent(why))?;
        let sent = client.get(self.inner.url.clone()).send().await;
        let mut response = sent.map_err(|e| self.classify(&e))?;
        let status = response.status();
        if !status.is_success() {
            return Err(self.transient(format!("the host answered {status}")));
        }
        let mut bytes = Vec::new();
        while let Some(piece) = response.chunk().await.map_err(|e| self.classify(&e))? {
            if bytes.len() + piece.len() > most {
                return Err(self.permanent(format!("longer than {most} bytes")));
            }
            bytes.extend_from_slice(&piece);
        }
        Ok(bytes)
    }

    /// Sends the request and checks the head of the answer.
    async fn ask(&self, ask: Ask) -> Result<(Response, ContentRange), SourceError> {
        let Some(last) = ask.len.checked_sub(1).and_then(|n| ask.offset.checked_add(n)) else {
            return Err(self.permanent(format!("{} bytes at {} are no range", ask.len, ask.offset)));
        };
        let client = self.inner.connector.client().map_err(|why| self.permanent(why))?;
        let response = client
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
        let found = Identity::of(headers, total);
        let first = self.inner.identity.get_or_init(|| found.clone());
        if first.differs_from(&found) {
            return Err(self.changed());
        }
        if let Some(offer) = Offer::read(headers) {
            self.inner.batches.get_or_init(|| offer);
        }
        Ok(())
    }

    /// The error for an answer that is not 206.
    fn refuse(&self, response: &Response, ask: Ask) -> SourceError {
        let status = response.status();
        let error = match status {
            StatusCode::OK => {
                let found = Identity::of(response.headers(), None);
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
            StatusCode::RANGE_NOT_SATISFIABLE => {
                // Another file may stand there now, and be shorter.
                let found = Identity::of(response.headers(), total_of_unsatisfied(response));
                if self.inner.identity.get().is_some_and(|first| first.differs_from(&found)) {
                    return self.changed();
                }
                self.permanent(format!(
                    "bytes {} to {} are beyond the end of the file: it is empty or cut short",
                    ask.offset,
                    ask.offset + ask.len
                ))
            }
            StatusCode::NOT_FOUND | StatusCode::GONE => self.permanent(format!(
                "not found ({status}); check the address, and the token or link if it needs one"
            )),
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
        SourceError::Replaced { place: self.inner.place.clone() }
    }

    fn transient(&self, message: impl Into<String>) -> SourceError {
        SourceError::transient(&self.inner.place, message)
    }

    fn permanent(&self, message: impl Into<String>) -> SourceError {
        SourceError::permanent(&self.inner.place, message)
    }
}

/// The length of the file, by an answer that a range lies beyond it: `bytes */TOTAL`.
fn total_of_unsatisfied(response: &Response) -> Option<u64> {
    let text = response.headers().get(header::CONTENT_RANGE)?.to_str().ok()?;
    text.strip_prefix("bytes */")?.parse().ok()
}

impl Identity {
    fn of(headers: &HeaderMap, total: Option<u64>) -> Self {
        let text = |name| Some(headers.get(name)?.to_str().ok()?.to_owned());
        Self { etag: text(header::ETAG), modified: text(header::LAST_MODIFIED), total }
    }

    /// Whether both tell, and tell different things.
    fn differs_from(&self, other: &Self) -> bool {
        let totals = self.total.zip(other.total);
        // Where there are tags, they decide: copies of a file on several hosts have several dates.
        let names = match self.etag.as_ref().zip(other.etag.as_ref()) {
            Some(etags) => Some(etags),
            None => self.modified.as_ref().zip(other.modified.as_ref()),
        };
        names.is_some_and(|(a, b)| a != b) || totals.is_some_and(|(a, b)| a != b)
    }
}

impl Offer {
    /// `lodestream-batch: 1; parts=COUNT; bytes=COUNT`, beside an entity tag that is the content's
    /// identity.
    fn read(headers: &HeaderMap) -> Option<Self> {
        let offer = headers.get("lodestream-batch")?.to_str().ok()?;
        let mut fields = offer.split(';').map(str::trim);
        if fields.next()? != "1" {
            return None;
        }
        let mut limits = BatchLimits { parts: 1, bytes: 0 };
        for (name, value) in fields.filter_map(|field| field.split_once('=')) {
            match name {
                "parts" => limits.parts = value.parse().ok()?,
                "bytes" => limits.bytes = value.parse().ok()?,
                _ => {}
            }
        }
        let limits = BatchLimits {
            parts: limits.parts.min(MAX_BATCH_PARTS),
            bytes: limits.bytes.min(MAX_BATCH_BYTES),
        };
        let etag = headers.get(header::ETAG)?.to_str().ok()?;
        let digits = etag.strip_prefix('"')?.strip_suffix('"')?;
        let id = u128::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 32)?;
        Some(Self { content_id: id.to_be_bytes(), limits })
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

/// The cause at the bottom: `Connection refused`, where the top says `error sending request`.
fn innermost(error: &reqwest::Error) -> String {
    let mut cause: &dyn std::error::Error = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}

/// The address without what opens it: neither credentials nor a query, which may be signed.
pub(crate) fn without_secrets(url: &Url) -> String {
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
    fn an_offer_of_batches_counts_beside_the_identity_of_the_content_only() {
        let read = |offer: &str, etag: &str| {
            let fields = [("lodestream-batch", offer), ("etag", etag)];
            let field = |(name, value): (&'static str, &str)| {
                (header::HeaderName::from_static(name), value.parse().expect("a value"))
            };
            Offer::read(&fields.map(field).into_iter().collect())
        };
        let etag = "\"000102030405060708090a0b0c0d0e0f\"";
        let offer = read("1; parts=10; bytes=1000; more=x", etag).expect("an offer");
        assert_eq!(offer.limits, BatchLimits { parts: 10, bytes: 1000 });
        assert_eq!(offer.content_id[..3], [0, 1, 2]);
        let greedy = read("1; parts=99999999; bytes=99999999999", etag).expect("an offer");
        assert_eq!(greedy.limits, BatchLimits { parts: MAX_BATCH_PARTS, bytes: MAX_BATCH_BYTES });
        for (offer, etag) in [("2; parts=10", etag), ("", etag), ("1; parts=x", etag)] {
            assert_eq!(read(offer, etag), None, "{offer}");
        }
        assert_eq!(read("1; parts=10; bytes=1000", "\"x\""), None);
    }

    #[test]
    fn secrets_in_a_url_are_not_shown() {
        let url = Url::parse("https://me:pw@a.example/b.lods?signature=x").expect("a URL");
        let source = HttpSource::new(url);
        assert_eq!(source.describe(), "https://a.example/b.lods");
    }
}
