//! What the client's tests share: small datasets, and a host that misbehaves on request.

pub mod arrival;
pub mod dataset;
pub mod drawn;
pub mod host;
pub mod soak;
