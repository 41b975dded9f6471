//! How the GPU renderer works: nothing of what it draws.

use std::str::FromStr;

use serde::Serialize;

/// How the GPU renderer works.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GpuConfig {
    /// Nodes that stay on the GPU from frame to frame take at most so many bytes, except where one
    /// frame needs more.
    pub resident_bytes: u64,
    /// A frame sends at most so many bytes of nodes to the GPU (one node at least); the rest is left
    /// to the next frames, coarse nodes first, so that a frame takes no longer than usual.
    pub upload_bytes_per_frame: u64,
    /// How splats get to pixels.
    pub path: GpuPath,
    /// Take the adapter for one that has nothing but what every adapter has: for tests of how the
    /// renderer does without the rest.
    pub least_adapter: bool,
}

impl Default for GpuConfig {
    fn default() -> Self {
        Self {
            resident_bytes: 1 << 30,
            upload_bytes_per_frame: u64::MAX,
            path: GpuPath::Auto,
            least_adapter: false,
        }
    }
}

/// How splats get to pixels. The picture is the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Default)]
#[serde(rename_all = "lowercase")]
pub enum GpuPath {
    /// The faster of the two, by their times in earlier frames.
    #[default]
    Auto,
    /// The fixed-function rasteriser.
    Raster,
    /// A compute shader; blended splats and meshes, which it cannot, are rasterised.
    Compute,
}

impl FromStr for GpuPath {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "raster" => Ok(Self::Raster),
            "compute" => Ok(Self::Compute),
            _ => Err("expected auto, raster or compute".into()),
        }
    }
}
