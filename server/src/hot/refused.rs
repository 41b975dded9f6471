//! What the short way refuses by itself: what on the long way would be waited for once more.

use std::{fmt::Display, io::Write, time::SystemTime};

use axum::http::StatusCode;
use httpdate::HttpDate;

use crate::routes::{CROSS_ORIGIN_FIELDS, Refusal};

/// An answer that holds no part of a dataset.
#[derive(Debug)]
pub(super) struct Refused {
    pub(super) status: StatusCode,
    fields: String,
    pub(super) body: String,
}

impl Refused {
    /// The time for a response to begin is over.
    pub(super) const fn late() -> Self {
        Self { status: StatusCode::GATEWAY_TIMEOUT, fields: String::new(), body: String::new() }
    }

    /// Head and body, with the fields of the long way.
    pub(super) fn write(&self, reply: &mut Vec<u8>) {
        let Self { status, fields, body } = self;
        let (length, now) = (body.len(), HttpDate::from(SystemTime::now()));
        // Writing to memory does not fail.
        let _ = write!(
            reply,
            "HTTP/1.1 {status}\r\n{fields}content-length: {length}\r\n{CROSS_ORIGIN_FIELDS}\
             date: {now}\r\n\r\n{body}"
        );
    }
}

impl From<Refusal> for Refused {
    fn from(refusal: Refusal) -> Self {
        let (status, fields, body) = refusal.into_parts();
        let line = |(name, value): &(_, _)| format!("{}: {value}\r\n", name as &dyn Display);
        Self { status, fields: fields.iter().map(line).collect(), body }
    }
}
