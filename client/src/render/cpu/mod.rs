//! The CPU renderer, in f64: the truth that pictures are tested against, and what draws where there
//! is no GPU adapter.
//!
//! A point is projected once and each part of its splat (`footprint`) is offered to its sample
//! with an atomic minimum (`canvas`), from all cores at once. Not a rasteriser with tiles: sorting
//! points into tiles costs more than the rare contention that it avoids.

mod batch;
mod blend;
mod canvas;
mod eye_dome;
mod footprint;
mod paint;
mod resolve;
mod seen;
mod stage;
mod truth;

#[cfg(test)]
pub(super) mod tests;

pub use seen::Seen;
pub use truth::TruthRenderer;

use crate::render::{CloudColors, DrawNode, Frame, RenderError, RenderSettings, Scene};

/// Draws on the CPU. Follows the rules of [`Splat`](crate::render::Splat) to the letter.
#[derive(Debug, Clone, Copy, Default)]
pub struct CpuRenderer;

impl CpuRenderer {
    /// Draws a scene.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn.
    pub fn render(&self, scene: &Scene, settings: &RenderSettings) -> Result<Frame, RenderError> {
        self.render_colored(scene, settings, CloudColors::default())
    }

    /// Draws a scene, each cloud in colours of its own.
    ///
    /// # Errors
    /// As for [`render`](Self::render).
    pub fn render_colored(
        &self,
        scene: &Scene,
        settings: &RenderSettings,
        colors: CloudColors,
    ) -> Result<Frame, RenderError> {
        let renderer = TruthRenderer::new(settings, scene.clouds, scene.tree(), 1)?;
        let mut renderer = renderer.colored(colors).of_nodes_in_memory();
        let nodes = scene.ordered()?;
        for pass in 0..renderer.passes() {
            if pass > 0 {
                renderer.next_pass()?;
            }
            for node in &nodes {
                renderer.add_node(DrawNode::clone(node))?;
            }
        }
        renderer.finish()
    }
}
