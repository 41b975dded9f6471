//! The commands that need the client; the others are the server's.

pub mod appearance;
pub mod demo;
pub mod eval;
pub mod export;
pub mod shot;
pub mod stability;
pub mod view;
