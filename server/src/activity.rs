//! Whether anything goes on on a connection of HTTP/2.
//!
//! Its client may answer every ping and yet ask for nothing, or ask for much and take none of it: a connection
//! and the buffers of its streams would be held for nothing. With HTTP/1.1 the limits on heads and on writes see
//! to that; here many streams share one of each, so that what the streams do is looked at.

use std::{
    pin::Pin,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, ready},
};

use axum::{body::Body, response::Response};
use bytes::Bytes;
use http_body::{Body as HttpBody, Frame, SizeHint};
use tokio::time::{Instant, sleep_until};

use crate::connection::ConnectionLimits;

/// What the streams of a connection do.
#[derive(Debug)]
pub(crate) struct Activity {
    /// Requests whose responses have not begun: the server's own affair.
    handled: AtomicUsize,
    /// Responses that are not sent whole.
    open: AtomicUsize,
    /// When a stream last did something.
    last: Mutex<Instant>,
}

impl Activity {
    pub(crate) fn new() -> Arc<Self> {
        let last = Mutex::new(Instant::now());
        Arc::new(Self { handled: AtomicUsize::new(0), open: AtomicUsize::new(0), last })
    }

    /// A request has come.
    pub(crate) fn begin(self: &Arc<Self>) -> Handling {
        self.handled.fetch_add(1, Ordering::Relaxed);
        Handling(Arc::clone(self))
    }

    /// Returns once nothing was asked for, or nothing taken of what was, for longer than is allowed.
    pub(crate) async fn end(&self, limits: ConnectionLimits) {
        loop {
            let now = Instant::now();
            let is_handling = self.handled.load(Ordering::Relaxed) > 0;
            let is_open = self.open.load(Ordering::Relaxed) > 0;
            let since = if is_handling { now } else { self.last() };
            let due = since + if is_open { limits.write_timeout } else { limits.head_timeout };
            if due <= now {
                return;
            }
            sleep_until(due).await;
        }
    }

    fn note(&self) {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    fn last(&self) -> Instant {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A request until its response begins, or it is given up.
#[derive(Debug)]
pub(crate) struct Handling(Arc<Activity>);

impl Handling {
    /// The response, whose body is looked at from here on.
    pub(crate) fn watch(self, response: Response) -> Response {
        self.0.open.fetch_add(1, Ordering::Relaxed);
        let activity = Arc::clone(&self.0);
        response.map(|body| Body::new(Watched { body, rest: Bytes::new(), activity }))
    }
}

impl Drop for Handling {
    fn drop(&mut self) {
        self.0.note();
        self.0.handled.fetch_sub(1, Ordering::Relaxed);
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
}

impl HttpBody for Watched {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        self.activity.note();
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
        self.activity.note();
        self.activity.open.fetch_sub(1, Ordering::Relaxed);
    }
}
