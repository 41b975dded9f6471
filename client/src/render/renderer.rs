//! The renderer that there is: the GPU's, or the CPU's in its place.

use crate::render::{
    CpuRenderer, Frame, GpuConfig, GpuRenderer, RenderError, RenderSettings, Scene,
};

/// Draws on the GPU as long as there is one, then on the CPU: the same pictures.
pub enum Renderer {
    /// With wgpu.
    Gpu {
        /// What draws.
        gpu: Box<GpuRenderer>,
        /// To open it anew, where it is lost.
        config: GpuConfig,
        /// Whether it has drawn anything yet.
        proven: bool,
    },
    /// On the CPU.
    Cpu(CpuRenderer),
}

impl Renderer {
    /// The GPU renderer; where there is no usable GPU, the CPU renderer, and `told` learns why.
    #[must_use]
    pub fn open(config: GpuConfig, told: &mut dyn FnMut(&RenderError)) -> Self {
        match GpuRenderer::new(config) {
            Ok(gpu) => Self::Gpu { gpu: Box::new(gpu), config, proven: false },
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
            Self::Gpu { gpu, .. } => format!("gpu: {}", gpu.adapter()),
            Self::Cpu(_) => "cpu".into(),
        }
    }

    /// Draws a scene. A GPU that fails after it has drawn (it was reset, unplugged, or ran out of
    /// memory) is opened anew; one that fails at once is given up, and this and all further frames
    /// are drawn on the CPU. `told` learns why.
    ///
    /// # Errors
    /// [`RenderError::Settings`] and [`RenderError::Scene`] where the input cannot be drawn.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        told: &mut dyn FnMut(&RenderError),
    ) -> Result<Frame, RenderError> {
        while let Self::Gpu { gpu, config, proven } = self {
            match gpu.render(scene, settings) {
                Err(e @ RenderError::Gpu(_)) => {
                    told(&e);
                    *self =
                        if *proven { Self::open(*config, told) } else { Self::Cpu(CpuRenderer) };
                }
                outcome => {
                    *proven = true;
                    return outcome;
                }
            }
        }
        CpuRenderer.render(scene, settings)
    }
}
