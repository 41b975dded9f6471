//! A local file behind a made-up link.

use std::{
    collections::HashMap,
    sync::{
        Arc,
        atomic::{AtomicI64, Ordering},
    },
};

use bytes::Bytes;

use super::{FileSource, Link, SourceError};

/// A local dataset file whose bytes come as slowly as a [`Link`] lets them.
///
/// Reads on the thread that asks: on a simulated clock nothing may happen elsewhere.
#[derive(Debug, Clone)]
pub struct LinkedSource {
    file: FileSource,
    link: Arc<Link>,
    foreign: Option<Arc<ForeignSizes>>,
}

/// What ranges of a file would weigh in another encoding: they take as long to come as if they had it.
#[derive(Debug)]
pub struct ForeignSizes {
    /// By where a range begins.
    bytes: Arc<HashMap<u64, u64>>,
    extra: AtomicI64,
}

impl ForeignSizes {
    /// Of ranges that begin at these offsets; others weigh what they do.
    #[must_use]
    pub fn new(bytes: Arc<HashMap<u64, u64>>) -> Self {
        Self { bytes, extra: AtomicI64::new(0) }
    }

    /// Bytes that came by the link more than were handed on so far; negative where there were fewer.
    #[must_use]
    pub fn extra(&self) -> i64 {
        self.extra.load(Ordering::Relaxed)
    }
}

impl LinkedSource {
    pub(super) const fn new(
        file: FileSource,
        link: Arc<Link>,
        foreign: Option<Arc<ForeignSizes>>,
    ) -> Self {
        Self { file, link, foreign }
    }

    /// The file that lies there now, behind the same link.
    pub(super) fn renew(&self) -> Result<Self, SourceError> {
        Ok(Self { file: self.file.renew()?, ..self.clone() })
    }

    pub(super) fn describe(&self) -> String {
        format!("{} by {}", self.file.describe(), self.link.spec())
    }

    pub(super) fn len(&self) -> u64 {
        self.file.len()
    }

    pub(super) async fn stream_range(
        &self,
        offset: u64,
        len: u64,
        sink: &mut (dyn FnMut(Bytes) + Send),
    ) -> Result<(), SourceError> {
        let mut bytes = self.file.read_now(offset, len)?;
        let foreign = self.foreign.as_deref();
        let weight =
            foreign.and_then(|foreign| foreign.bytes.get(&offset)).map_or(len, |&w| w.max(1));
        let (mut come, mut handed_on) = (0, 0);
        self.link
            .carry(offset, weight, |arrived| {
                come += arrived;
                // In proportion; all of it with the last.
                let due = (u128::from(len) * u128::from(come) / u128::from(weight)) as u64;
                let piece = bytes.split_to((due - handed_on) as usize);
                handed_on = due;
                if let Some(foreign) = foreign {
                    let extra = arrived as i64 - piece.len() as i64;
                    foreign.extra.fetch_add(extra, Ordering::Relaxed);
                }
                if !piece.is_empty() {
                    sink(piece);
                }
            })
            .await;
        Ok(())
    }
}
