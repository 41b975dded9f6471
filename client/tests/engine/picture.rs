//! Engines, cameras, and plans that can be compared.

use std::{path::Path, sync::Arc, time::Duration};

use glam::DVec3;
use lodestream_client::{
    camera::Camera,
    engine::{Engine, EngineConfig, EngineError, View},
    source::{HttpSource, Meter, Source, Timeouts},
};
use tokio::time::Instant;

pub use crate::common::drawn::{Picture, picture};
use crate::common::host::Host;

/// Long enough for any machine; a test that waits this long has failed.
pub const LONG: Duration = Duration::from_secs(120);

/// A view of everything, from a corner of the room of the datasets.
pub fn overview(corner: [f64; 3]) -> View {
    let min = DVec3::from(corner);
    View { camera: Camera::overview(min, min + 65.0, 1.5), size_px: [960, 640] }
}

/// From the same place, in the opposite direction.
pub fn away(mut view: View) -> View {
    view.camera.target = 2.0 * view.camera.eye - view.camera.target;
    view
}

/// Small requests and no lower limit of size, so that there is something to fetch.
pub fn config() -> EngineConfig {
    let mut config =
        EngineConfig { point_budget: 60_000, min_size_px: 1.0, ..EngineConfig::default() };
    config.coalesce.gap_bytes = 200;
    config.coalesce.span_bytes = 20_000;
    config
}

pub fn file_source(path: &Path) -> Source {
    Source::parse(path.to_str().expect("readable path")).expect("opens")
}

/// A source that waits as long as any machine may take.
pub fn http_source(host: &Host) -> Source {
    source_with_patience(host, LONG)
}

/// A source that gives a silent host up after `patience`.
pub fn source_with_patience(host: &Host, patience: Duration) -> Source {
    let timeouts = Timeouts { connect: patience, silence: patience };
    let url = host.url().parse().expect("a URL");
    Source::Http(HttpSource::with_timeouts(url, timeouts))
}

/// Counts requests, and lets all pass.
pub fn meter() -> Arc<Meter> {
    Arc::new(Meter::new(Instant::now(), Duration::from_secs(1), u64::MAX))
}

/// What the local file settles on.
pub fn expected(bytes: &[u8], config: &EngineConfig, view: View) -> Picture {
    let (_folder, path) = crate::common::dataset::write(bytes);
    let engine = Engine::start(vec![file_source(&path)], config.clone()).expect("starts");
    engine.set_view(view);
    picture(&engine.wait_settled(LONG).expect("settles"))
}

/// The message of the error that the engine ends with.
pub fn failure(engine: &Engine) -> String {
    match engine.wait_settled(LONG) {
        Err(EngineError::Cloud(message)) => message,
        other => panic!("the source should have failed: {other:?}"),
    }
}
