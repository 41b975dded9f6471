//! Draws a streaming plan with whatever the machine has: the GPU, or the CPU where there is none.

use std::sync::Arc;

use lodestream_protocol::{Boot, Manifest};

use crate::{
    engine::FramePlan,
    render::{CpuRenderer, DrawNode, Frame, GpuRenderer, RenderError, RenderSettings, Scene},
};

/// Node data kept on the GPU between frames.
const RESIDENT_BYTES: u64 = 1 << 30;

/// A renderer that was chosen once.
pub enum Painter {
    /// Draws with wgpu.
    Gpu(Box<GpuRenderer>),
    /// Draws in f64 on all cores.
    Cpu(CpuRenderer),
}

impl Painter {
    /// The GPU's.
    ///
    /// # Errors
    /// [`RenderError::NoGpu`] where there is no usable adapter.
    pub fn gpu() -> Result<Self, RenderError> {
        Ok(Self::Gpu(Box::new(GpuRenderer::new(RESIDENT_BYTES)?)))
    }

    /// The CPU's.
    #[must_use]
    pub const fn cpu() -> Self {
        Self::Cpu(CpuRenderer)
    }

    /// The GPU's if there is one, else the CPU's; `notice` hears why.
    pub fn best(notice: impl FnOnce(&str)) -> Self {
        Self::gpu().unwrap_or_else(|why| {
            notice(&format!("{why}; drawing on the CPU"));
            Self::cpu()
        })
    }

    /// What draws, for people.
    #[must_use]
    pub fn describe(&self) -> String {
        match self {
            Self::Gpu(gpu) => gpu.adapter().into(),
            Self::Cpu(_) => "CPU renderer".into(),
        }
    }

    /// Draws a plan over the clouds that it was made for.
    ///
    /// # Errors
    /// What the renderer says.
    pub fn paint(
        &mut self,
        boots: &[Arc<Boot>],
        plan: &FramePlan,
        settings: &RenderSettings,
    ) -> Result<Frame, RenderError> {
        let clouds: Vec<Arc<Manifest>> =
            boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
        let nodes: Vec<DrawNode> = plan
            .nodes
            .iter()
            .map(|node| DrawNode { cloud: node.cloud, points: Arc::clone(&node.points) })
            .collect();
        let scene = Scene { clouds: &clouds, nodes: &nodes };
        match self {
            Self::Gpu(gpu) => gpu.render(&scene, settings),
            Self::Cpu(cpu) => cpu.render(&scene, settings),
        }
    }
}
