//! The CPU renderer, in f64: the truth that pictures are tested against, and what draws where there
//! is no GPU adapter.
//!
//! A point is projected once and offered to the pixels that it covers with an atomic minimum
//! (`canvas`), from all cores at once. Not a rasteriser with tiles: sorting points into tiles costs
//! more than the rare contention that it avoids.

mod canvas;
mod footprint;
mod truth;

pub use truth::TruthRenderer;

use crate::render::{Frame, FrameStatistics, RenderError, RenderSettings, Scene};

/// Draws on the CPU. Follows the rules of [`Splat`](crate::render::Splat) to the letter.
#[derive(Debug, Clone, Copy, Default)]
pub struct CpuRenderer;

impl CpuRenderer {
    /// Draws a scene.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn.
    pub fn render(&self, scene: &Scene, settings: &RenderSettings) -> Result<Frame, RenderError> {
        let mut renderer = TruthRenderer::new(settings, scene.clouds, scene.tree(), 1)?;
        let nodes = scene.ordered()?;
        let statistics = FrameStatistics::of(&nodes);
        for node in nodes {
            renderer.add_node(node.clone())?;
        }
        Ok(Frame { picture: renderer.finish(), statistics })
    }
}
