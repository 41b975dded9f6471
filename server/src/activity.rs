//! Whether anything goes on on a connection of HTTP/2.
//!
//! Its client may answer every ping and yet ask for nothing, or ask for much and take none of it: a connection
//! and the buffers of its streams would be held for nothing. With HTTP/1.1 the limits on heads and on writes see
//! to that; here many streams share one of each, so that what the streams do is looked at.

use std::{
    collections::HashMap,
    pin::Pin,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    task::{Context, Poll, ready},
};

use axum::{body::Body, response::Response};
use bytes::Bytes;
use http_body::{Body as HttpBody, Frame, SizeHint};
use tokio::time::{Instant, sleep_until};

use crate::connection::ConnectionLimits;

/// What the streams of a connection do.
#[derive(Debug)]
pub(crate) struct Activity(Mutex<Streams>);

#[derive(Debug)]
struct Streams {
    /// Requests whose responses have not begun: the server's own affair.
    handled: usize,
    /// When something was last taken of each response that is not sent whole.
    open: HashMap<u64, Instant>,
    /// The next of these.
    next: u64,
    /// When a request last ended, or the connection began.
    last: Instant,
}

impl Activity {
    pub(crate) fn new() -> Arc<Self> {
        let (open, last) = (HashMap::new(), Instant::now());
        Arc::new(Self(Mutex::new(Streams { handled: 0, open, next: 0, last })))
    }

    /// A request has come.
    pub(crate) fn begin(self: &Arc<Self>) -> Handling {
        self.streams().handled += 1;
        Handling(Arc::clone(self))
    }

    /// Returns once nothing was asked for, or of a response nothing taken, for longer than is allowed.
    pub(crate) async fn end(&self, limits: ConnectionLimits) {
        loop {
            let now = Instant::now();
            let due = {
                let streams = self.streams();
                match streams.open.values().min() {
                    // Whatever the others do.
                    Some(stalled) => *stalled + limits.write_timeout,
                    None if streams.handled > 0 => now + limits.head_timeout,
                    None => streams.last + limits.head_timeout,
                }
            };
            if due <= now {
                return;
            }
            sleep_until(due).await;
        }
    }

    /// Counts stay whole whoever panics.
    fn streams(&self) -> MutexGuard<'_, Streams> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A request until its response begins, or it is given up.
#[derive(Debug)]
pub(crate) struct Handling(Arc<Activity>);

impl Handling {
    /// The response, whose body is looked at from here on.
    pub(crate) fn watch(self, response: Response) -> Response {
        let activity = Arc::clone(&self.0);
        let number = {
            let mut streams = activity.streams();
            streams.next += 1;
            let number = streams.next;
            streams.open.insert(number, Instant::now());
            number
        };
        response.map(|body| Body::new(Watched { body, rest: Bytes::new(), activity, number }))
    }
}

impl Drop for Handling {
    fn drop(&mut self) {
        let mut streams = self.0.streams();
        streams.handled -= 1;
        streams.last = Instant::now();
    }
}

/// Of a response that a stream takes at once: who takes less in the time for a write takes nothing.
const STEP_BYTES: usize = 16 << 10;

/// A body; each time the connection takes a step of it counts.
#[derive(Debug)]
struct Watched {
    body: Body,
    /// Of a frame that is longer than a step.
    rest: Bytes,
    activity: Arc<Activity>,
    number: u64,
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.activity.streams().open.insert(self.number, Instant::now());
        if self.rest.is_empty() {
            match ready!(Pin::new(&mut self.body).poll_frame(context)) {
                Some(Ok(frame)) => match frame.into_data() {
                    Ok(data) => self.rest = data,
                    Err(trailers) => return Poll::Ready(Some(Ok(trailers))),
                },
                end => return Poll::Ready(end),
            }
        }
        let step = self.rest.len().min(STEP_BYTES);
        Poll::Ready(Some(Ok(Frame::data(self.rest.split_to(step)))))
    }

    fn is_end_stream(&self) -> bool {
        self.rest.is_empty() && self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        let (body, rest) = (self.body.size_hint(), self.rest.len() as u64);
        let mut hint = SizeHint::new();
        hint.set_lower(body.lower() + rest);
        if let Some(upper) = body.upper() {
            hint.set_upper(upper + rest);
        }
        hint
    }
}

impl Drop for Watched {
    fn drop(&mut self) {
        let mut streams = self.activity.streams();
        streams.open.remove(&self.number);
        streams.last = Instant::now();
    }
}
