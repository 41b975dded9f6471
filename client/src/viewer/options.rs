//! What the viewer is started with.

use std::path::PathBuf;

use clap::ValueEnum;

use super::settings::Settings;
use crate::{
    camera::Camera, commands::view::LookArgs, engine::ClipBox, path::PathSource, render::GpuPath,
};

/// What draws the points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ViewRenderer {
    /// The GPU, or the CPU where it cannot
    Gpu,
    /// The CPU, in double precision
    Cpu,
}

/// What the viewer is started with.
#[derive(Debug)]
pub struct ViewOptions {
    /// What is opened: as [`Source::parse`](crate::source::Source::parse) takes it.
    pub sources: Vec<String>,
    /// Servers whose lists are shown.
    pub servers: Vec<String>,
    /// A session to open; what else is given here counts instead of what it says.
    pub session: Option<PathBuf>,
    /// The settings, those that the command line gives in them.
    pub settings: Settings,
    /// Where settings are kept; nowhere, where there is none.
    pub settings_file: Option<PathBuf>,
    /// What was wrong with the settings' file.
    pub settings_trouble: Option<String>,
    /// The parts of the look that the command line gives.
    pub look: LookArgs,
    /// The budget, if the command line gives it.
    pub point_budget: Option<u64>,
    /// The smallest node, if the command line gives it.
    pub min_node_px: Option<f64>,
    /// Where from, at first.
    pub camera: Option<Camera>,
    /// What the view is limited to.
    pub clip: Option<ClipBox>,
    /// A path to play at once.
    pub path: Option<PathSource>,
    /// What draws.
    pub renderer: ViewRenderer,
    /// How the GPU draws.
    pub gpu_path: GpuPath,
    /// Where pictures and exports go.
    pub folder: PathBuf,
    /// Whether what happens is told on standard output.
    pub events: bool,
}
