//! Opening a cloud: header, manifest and root page, with one request where possible.
//!
//! The cloud is open as soon as these have come; what comes behind them, the payloads of the top
//! nodes, is handed on as it comes.

use std::sync::Arc;

use bytes::{Bytes, BytesMut};
use lodestream_protocol::{Boot, Error, HEADER_BYTES, Header};
use tokio::sync::Semaphore;

use crate::source::{Announced, Backoff, Source, SourceError};

use super::super::{commons::Commons, shared::Shared};

/// What there is of a cloud's first bytes.
#[derive(Debug)]
pub struct Opening {
    /// What they say.
    pub boot: Arc<Boot>,
    /// The first bytes of the file, in which the payloads of the top nodes may lie.
    pub prefix: Bytes,
    /// How long the prefix will become.
    pub expected: u64,
}

impl Opening {
    /// The same, keeping what is equal in other engines once.
    pub fn shared(self, commons: &Commons) -> Self {
        let boot = commons.boot(self.boot);
        let is_whole = self.prefix.len() as u64 >= self.expected;
        let prefix = if is_whole { commons.prefix(&boot, self.prefix) } else { self.prefix };
        Self { boot, prefix, ..self }
    }
}

/// How a cloud is opened.
#[derive(Debug)]
pub struct Ask<'a> {
    /// The cloud's, for the caller.
    pub number: usize,
    /// Bytes that are asked for at first.
    pub speculative: u64,
    /// To be passed before the host is asked.
    pub gate: &'a Semaphore,
}

/// Opens `source`, trying again for as long as that may help. Whenever more of the first bytes has come,
/// it is told, and which source they are of: where the file is replaced meanwhile, that is another one.
///
/// # Errors
/// What is wrong for good, with the source's name.
pub async fn open(
    shared: &Shared,
    ask: Ask<'_>,
    mut source: Source,
    tell: impl Fn(&Source, Opening) + Send + Sync,
) -> Result<(), String> {
    let mut failures = 0;
    loop {
        let mut reader = Reader { boot: None, bytes: BytesMut::new(), announced: None };
        let told = |opening| tell(&source, opening);
        // Closed never; and who waits for another try keeps nobody from his first.
        let passed = ask.gate.acquire().await;
        let result = reader.read(shared, &source, ask.speculative, &told).await;
        drop(passed);
        let error = match result {
            Ok(()) => {
                shared.trouble(Some(ask.number), None);
                return Ok(());
            }
            Err(Failure::Format(error)) => return Err(format!("{}: {error}", source.describe())),
            Err(Failure::Source(error)) => error,
        };
        match error {
            // What has come is good; the rest is asked for as everything else is.
            SourceError::Transient { .. } if reader.end(&told) => {
                shared.trouble(Some(ask.number), None);
                return Ok(());
            }
            SourceError::Transient { .. } => {}
            SourceError::Replaced { .. } => source = source.renew().map_err(|e| e.to_string())?,
            SourceError::Permanent { .. } => return Err(error.to_string()),
        }
        failures += 1;
        shared.counters.retries.add(1);
        shared.trouble(Some(ask.number), Some(error.to_string()));
        tokio::time::sleep(Backoff::default().delay(failures)).await;
    }
}

enum Failure {
    Source(SourceError),
    Format(Error),
}

impl From<SourceError> for Failure {
    fn from(error: SourceError) -> Self {
        Self::Source(error)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self::Format(error)
    }
}

/// The first bytes, as they come.
struct Reader {
    boot: Option<Arc<Boot>>,
    bytes: BytesMut,
    announced: Option<Announced>,
}

impl Reader {
    async fn read(
        &mut self,
        shared: &Shared,
        source: &Source,
        speculative: u64,
        tell: &(impl Fn(Opening) + Send + Sync),
    ) -> Result<(), Failure> {
        shared.counters.requests.add(1);
        let mut failure = None;
        let asked = speculative.max(HEADER_BYTES as u64);
        let mut sink = |piece: Bytes, announced| {
            shared.counters.bytes.add(piece.len() as u64);
            self.bytes.extend_from_slice(&piece);
            self.announced = Some(announced);
            if failure.is_none() {
                failure = self.look(tell).err();
            }
        };
        source.stream_prefix(asked, &mut sink).await?;
        if let Some(error) = failure {
            return Err(error.into());
        }
        if self.boot.is_none() {
            // Says what is wrong with a file that has no header.
            let header = Header::parse(&self.bytes)?;
            let have = self.bytes.len() as u64;
            // The header's own check has bounded these sizes.
            shared.counters.requests.add(1);
            let rest = source.read_range(have, header.index_bytes().saturating_sub(have)).await?;
            shared.counters.bytes.add(rest.len() as u64);
            self.bytes.extend_from_slice(&rest);
            self.announced = None;
            self.look(tell)?;
        }
        Ok(())
    }

    /// Opens the cloud if its header, manifest and root page are there; tells what there is.
    fn look(&mut self, tell: &impl Fn(Opening)) -> Result<(), Error> {
        if self.boot.is_none() {
            if self.bytes.len() < HEADER_BYTES {
                return Ok(());
            }
            let header = Header::parse(&self.bytes)?;
            if let Some(total) = self.announced.and_then(|announced| announced.total)
                && total < header.file_bytes
            {
                let (needed, available) = (header.file_bytes, total);
                return Err(Error::Truncated { what: "dataset", needed, available });
            }
            if (self.bytes.len() as u64) < header.index_bytes() {
                return Ok(());
            }
            self.boot = Some(Arc::new(Boot::parse(&self.bytes)?));
        }
        let expected = self.announced.map_or(0, |announced| announced.len);
        self.tell(expected, tell);
        Ok(())
    }

    /// Nothing more comes. Returns whether the cloud is open all the same.
    fn end(&self, tell: &impl Fn(Opening)) -> bool {
        self.tell(0, tell);
        self.boot.is_some()
    }

    fn tell(&self, expected: u64, tell: &impl Fn(Opening)) {
        if let Some(boot) = &self.boot {
            let prefix = Bytes::copy_from_slice(&self.bytes);
            tell(Opening { boot: Arc::clone(boot), prefix, expected });
        }
    }
}
