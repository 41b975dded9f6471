//! The desktop viewer: a window on datasets, near or far.
//!
//! The window's thread is the engine's caller (Fraiss 2017, 3.2: the render thread). It publishes the
//! newest camera, takes the newest plan, draws, and never waits for the network: what must be asked for besides
//! the picture (a server's list, all attributes of a point that was picked) is asked by short-lived helper threads
//! (`jobs.rs`). It draws on demand: input, a new plan or something that moves wakes it; at rest it sleeps.
//!
//! - `app.rs`: the event loop; `display.rs`: the window, the GPU, what shows pictures in it;
//! - `state.rs`: what the program knows; `frame.rs`: from a plan to a picture; `view.rs`: the part of the
//!   window that shows it, and what hands do there; `actions.rs`: what keys and buttons do;
//! - `navigation.rs`, `filter.rs`, `picking.rs`, `point_values.rs`, `measurement.rs`, `recording.rs`, `export.rs`:
//!   each one ability, none of which needs a window;
//! - `settings.rs`, `look.rs`, `session.rs`, `stored.rs`: what is kept in files;
//! - `panel/`: the sections of the panel at the side; `overlay/`: what is drawn upon the picture;
//! - `events.rs`: what scripts and tests are told.

mod actions;
mod app;
mod clouds;
mod crs;
mod display;
mod events;
mod export;
mod filter;
mod frame;
mod frame_times;
mod jobs;
mod look;
mod measurement;
mod messages;
pub mod navigation;
mod numbers;
mod open_dialog;
mod options;
mod overlay;
mod panel;
mod picking;
mod point_values;
mod recording;
mod session;
mod settings;
mod state;
mod stored;
mod theme;
mod view;

pub use app::run;
pub use look::Look;
pub use options::{ViewOptions, ViewRenderer};
pub use session::Session;
pub use settings::{Settings, Theme};
