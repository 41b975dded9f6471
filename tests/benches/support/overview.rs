//! What the benches of frames have in common: a dataset, its overview, and what that needs.

use std::{error::Error, path::Path, sync::Arc, time::Duration};

use glam::DVec3;
use lodestream_client::{
    camera::Camera,
    engine::{Engine, EngineConfig, FramePlan, View},
    source::Source,
};
use lodestream_protocol::Manifest;

#[path = "dataset.rs"]
mod dataset;

pub use dataset::dataset;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

pub const SIZE_PX: [u32; 2] = [1280, 720];

pub fn camera(clouds: &[Arc<Manifest>]) -> Camera {
    let bounds = clouds.iter().find_map(|cloud| cloud.bounds_world());
    let (min, max) = bounds.unwrap_or(([0.0; 3], [1.0; 3]));
    let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
    Camera::overview(DVec3::from(min), DVec3::from(max), aspect)
}

/// What the overview needs within a budget.
pub fn load(dataset: &Path, point_budget: u64) -> Result<(Vec<Arc<Manifest>>, Arc<FramePlan>)> {
    let source = Source::parse(dataset.to_str().ok_or("the file's name is no text")?)?;
    let attributes = ["color", "normal"].map(str::to_owned).to_vec();
    // However small nodes are in the picture: the budget is what counts.
    let config =
        EngineConfig { point_budget, attributes, min_size_px: 0.0, ..EngineConfig::default() };
    let engine = Engine::start(vec![source], config)?;
    let patience = Duration::from_secs(120);
    let boots = engine.wait_open(patience)?;
    let clouds: Vec<_> = boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
    engine.set_view(View { camera: camera(&clouds), size_px: SIZE_PX });
    Ok((clouds, engine.wait_settled(patience)?))
}
