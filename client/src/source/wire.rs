//! What a source's requests go through besides the network: a made-up link, and a meter.

use std::sync::Arc;

use tokio::time::Instant;

use super::{Fault, Link, Meter, link::Passage};

/// What requests go through. By default nothing.
#[derive(Debug, Clone, Default)]
pub struct Wire {
    /// As slow as this link.
    pub link: Option<Arc<Link>>,
    /// Counted by this meter.
    pub meter: Option<Arc<Meter>>,
}

/// A request on its way. One that is dropped before its end counts as broken off.
#[derive(Debug)]
pub(super) struct Trip<'a> {
    metered: Option<(&'a Meter, Instant)>,
    passage: Option<Passage<'a>>,
    is_over: bool,
}

impl Wire {
    /// Lets a request for bytes from `offset` go; `None` where the meter lets no more pass.
    pub(super) async fn depart(&self, offset: u64) -> Option<Trip<'_>> {
        let metered = match self.meter.as_deref() {
            Some(meter) => Some((meter, meter.depart()?)),
            None => None,
        };
        let mut trip = Trip { metered, passage: None, is_over: false };
        if let Some(link) = &self.link {
            trip.passage = Some(link.depart(offset).await);
        }
        Some(trip)
    }
}

impl Trip<'_> {
    /// The head of the answer has come.
    pub(super) async fn answered(&mut self) {
        if let Some(passage) = &mut self.passage {
            passage.arrive().await;
        }
        if let Some((meter, sent)) = self.metered {
            meter.answered(sent);
        }
    }

    /// So many bytes of the body have come.
    pub(super) async fn received(&mut self, bytes: u64) {
        if let Some(passage) = &mut self.passage {
            passage.pass(bytes).await;
        }
        if let Some((meter, _)) = self.metered {
            meter.received(bytes);
        }
    }

    /// The request has ended; well, where there is no fault.
    pub(super) fn end(mut self, fault: Option<Fault>) {
        self.is_over = true;
        if let Some((meter, sent)) = self.metered {
            meter.arrive(sent, Some(fault.map_or(Ok(()), Err)));
        }
        if let Some(passage) = self.passage.take()
            && fault.is_none()
        {
            passage.end();
        }
    }
}

impl Drop for Trip<'_> {
    fn drop(&mut self) {
        if let Some((meter, sent)) = self.metered
            && !self.is_over
        {
            meter.arrive(sent, None);
        }
    }
}
