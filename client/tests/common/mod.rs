//! What the client's tests share: small datasets, and a host that misbehaves on request.

pub mod dataset;
pub mod host;
