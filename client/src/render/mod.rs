//! Drawing: from decoded nodes to pictures.
//!
//! The way through: a [`Scene`] (nodes of clouds) and [`RenderSettings`] go into one of the
//! renderers and a [`Frame`] comes out. `view` (from lattice to pixels), `color` (from attributes to
//! colours) and the rules of [`Splat`] (which pixels are covered) are shared; the [`GpuRenderer`]
//! follows them in f32 and WGSL, the [`CpuRenderer`] in f64. Both draw the same splats, so that one
//! is the other's test and its stand-in. [`TruthRenderer`] is the CPU renderer for all points of a
//! dataset, supersampled; how far two pictures are apart is told by [`metrics`](crate::metrics).

mod color;
mod cpu;
mod density;
mod gpu;
mod picture;
mod ramp;
mod renderer;
mod scene;
mod settings;
mod size;
mod surface;
mod tree;
pub(crate) mod view;

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use serde::Serialize;

pub use color::Coloring;
pub use cpu::{CpuRenderer, Seen, TruthRenderer};
pub use density::PointsPerPixel;
pub use gpu::{GpuConfig, GpuPath, GpuRenderer, shader_bytes};
pub use picture::Picture;
pub use renderer::Renderer;
pub use scene::{CloudColors, Scene};
pub use settings::{
    ColorMode, EyeDome, LARGEST_SIDE_PX, LARGEST_SPLAT_PX, RenderSettings, SMALLEST_SPLAT_PX,
    Shading, SizeLimits, Splat, SplatSize,
};
pub use tree::VisibleTree;

pub(crate) use color::NodeColor;
pub(crate) use ramp::Ramp;
pub(crate) use scene::Surroundings;
pub(crate) use surface::NodeSurface;

pub use crate::engine::DrawNode;

/// Why there is no picture. Variants follow what a caller does next.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The settings ask for the impossible: mend them.
    #[error("{0}")]
    Settings(String),
    /// The scene contradicts itself: a mistake in the program.
    #[error("{0}")]
    Scene(String),
    /// There is no usable GPU: draw on the CPU.
    #[error("no usable GPU: {0}")]
    NoGpu(String),
    /// The GPU failed while drawing: draw on the CPU, or with fewer points.
    #[error("the GPU failed: {0}")]
    Gpu(String),
    /// A picture could not be read.
    #[error("{path}: cannot read the picture: {why}")]
    Read {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// The picture could not be written.
    #[error("{path}: cannot write the picture: {why}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        why: String,
    },
}

/// What drawing a frame took.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct FrameStatistics {
    /// Nodes drawn.
    pub nodes: u64,
    /// Points in them.
    pub points: u64,
    /// Draw calls (GPU only).
    pub draw_calls: u64,
    /// Bytes of nodes sent to the GPU for this frame.
    pub uploaded_bytes: u64,
    /// Bytes of nodes on the GPU after this frame.
    pub resident_bytes: u64,
    /// Nodes that are not drawn yet: sending them to the GPU is left to later frames.
    pub waiting_nodes: u64,
    /// How splats got to pixels; `None` for the CPU.
    pub path: Option<GpuPath>,
}

/// A picture, and what it took.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// What is seen.
    pub picture: Picture,
    /// What it took.
    pub statistics: FrameStatistics,
    /// What was counted, where the colours are by [`ColorMode::Density`].
    pub points_per_pixel: Option<PointsPerPixel>,
}
