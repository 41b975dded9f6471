//! The renderer that there is: the GPU's, or the CPU's in its place.

use crate::render::{CpuRenderer, Frame, GpuConfig, GpuRenderer, RenderError, RenderSettings, Scene};

/// Draws on the GPU as long as there is one, then on the CPU: the same pictures.
pub enum Renderer {
    /// With wgpu.
    Gpu(Box<GpuRenderer>),
    /// On the CPU.
    Cpu(CpuRenderer),
}

impl Renderer {
    /// The GPU renderer, keeping up to `resident_bytes` of nodes; where there is no usable GPU, the
    /// CPU renderer, and `told` learns why.
    #[must_use]
    pub fn open(resident_bytes: u64, told: &mut dyn FnMut(&RenderError)) -> Self {
        match GpuRenderer::new(GpuConfig { resident_bytes, ..GpuConfig::default() }) {
            Ok(gpu) => Self::Gpu(Box::new(gpu)),
            Err(e) => {
                told(&e);
                Self::Cpu(CpuRenderer)
            }
        }
    }

    /// What draws, for a user.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Gpu(gpu) => format!("gpu: {}", gpu.adapter()),
            Self::Cpu(_) => "cpu".into(),
        }
    }

    /// Draws a scene. Where the GPU fails, this and all further frames are drawn on the CPU, and
    /// `told` learns why.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        told: &mut dyn FnMut(&RenderError),
    ) -> Result<Frame, RenderError> {
        if let Self::Gpu(gpu) = self {
            match gpu.render(scene, settings) {
                Err(e @ RenderError::Gpu(_)) => told(&e),
                outcome => return outcome,
            }
        }
        *self = Self::Cpu(CpuRenderer);
        CpuRenderer.render(scene, settings)
    }
}
