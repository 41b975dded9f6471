//! `view`: a window on datasets.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use anyhow::Context;
use clap::Args;
use glam::DVec3;

use crate::{
    camera::Camera,
    commands::appearance,
    engine::ClipBox,
    path::PathSource,
    render::{ColorMode, GpuPath, Shading, Splat, SplatSize},
    source,
    viewer::{self, Look, Settings, Theme, ViewOptions, ViewRenderer},
};

/// Open a window on datasets, near and far
#[derive(Debug, Clone, Args)]
pub struct ViewArgs {
    /// Dataset files, folders of them, URLs, a server's address with a dataset's name, or without one for
    /// its list
    #[arg(value_name = "SOURCE")]
    pub sources: Vec<String>,
    /// Open a session; what else is given here counts instead of what it says
    #[arg(long, value_name = "FILE.json")]
    pub session: Option<PathBuf>,
    /// Where to look from: a camera file, as in 'shot'
    #[arg(long, value_name = "FILE.json")]
    pub camera: Option<PathBuf>,
    /// Play a camera path: a file or a generator, as in 'shot'
    #[arg(long, value_name = "FILE.json|GENERATOR")]
    pub path: Option<String>,
    /// Show only what lies in a box of the world
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = clip, allow_hyphen_values = true)]
    pub clip: Option<ClipBox>,
    /// Width and height of the window
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    pub size: Option<[u32; 2]>,
    /// Most points drawn at once, over all clouds
    #[arg(long, value_name = "POINTS", value_parser = clap::value_parser!(u64).range(1_000..=100_000_000))]
    pub budget: Option<u64>,
    /// Leave out what appears smaller: the radius around a node
    #[arg(long, value_name = "PIXELS", value_parser = min_node)]
    pub min_node: Option<f64>,
    /// Keep at most so much that is not drawn
    #[arg(long, value_name = "MEBIBYTES", value_parser = clap::value_parser!(u64).range(0..=65_536))]
    pub cache: Option<u64>,
    /// What draws
    #[arg(long, value_enum, default_value = "gpu")]
    pub renderer: ViewRenderer,
    /// Where pictures, sessions and exports go at first
    #[arg(long, value_name = "DIR", default_value = ".")]
    pub folder: PathBuf,
    /// Where settings are kept from one start to the next, instead of the usual place; '-' for nowhere
    #[arg(long, value_name = "FILE.json|-")]
    pub settings: Option<PathBuf>,
    /// Tell on standard output what happens, a line of JSON each: for scripts
    #[arg(long)]
    pub events: bool,
    /// What it looks like, where it is given.
    #[command(flatten)]
    pub look: LookArgs,
}

/// As in `shot`; what is not given is as it was last.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Appearance (what is not given is as it was last)")]
pub struct LookArgs {
    /// Light or dark
    #[arg(long, value_enum)]
    pub theme: Option<Theme>,
    /// What a point covers
    #[arg(long, value_name = "SPLAT", value_parser = appearance::splats())]
    pub splat: Option<Splat>,
    /// How large it is: 2px, 0.05w, level, level:1.5, adaptive, adaptive:1.5, own
    #[arg(long, value_name = "SIZE")]
    pub splat_size: Option<SplatSize>,
    /// No splat is smaller
    #[arg(long, value_name = "PIXELS")]
    pub min_splat: Option<f64>,
    /// No splat is larger
    #[arg(long, value_name = "PIXELS")]
    pub max_splat: Option<f64>,
    /// Where colours come from
    #[arg(long, value_name = "COLOR", value_parser = appearance::colors())]
    pub color: Option<ColorMode>,
    /// How light falls
    #[arg(long, value_name = "none|phong|edl|phong+edl")]
    pub shading: Option<Shading>,
    /// How dark eye-dome lighting is
    #[arg(long, value_name = "NUMBER")]
    pub edl_strength: Option<f64>,
    /// How far eye-dome lighting looks around
    #[arg(long, value_name = "PIXELS")]
    pub edl_radius: Option<f64>,
    /// How the GPU draws splats
    #[arg(long, value_name = "auto|raster|compute", default_value = "auto")]
    pub gpu_path: GpuPath,
}

impl LookArgs {
    /// The look, with what is given in it.
    #[must_use]
    pub fn upon(&self, look: Look) -> Look {
        let shading = self.shading;
        Look {
            splat: self.splat.unwrap_or(look.splat),
            splat_size: self.splat_size.unwrap_or(look.splat_size),
            min_splat_px: self.min_splat.unwrap_or(look.min_splat_px),
            max_splat_px: self.max_splat.unwrap_or(look.max_splat_px),
            color: self.color.unwrap_or(look.color),
            phong: shading.map_or(look.phong, |shading| shading.phong),
            eye_dome: shading.map_or(look.eye_dome, |shading| shading.eye_dome.is_some()),
            edl_strength: self.edl_strength.unwrap_or(look.edl_strength),
            edl_radius_px: self.edl_radius.unwrap_or(look.edl_radius_px),
        }
    }
}

/// Opens the window and runs until it is closed.
///
/// # Errors
/// Where a file that is named cannot be read, or the system gives no window. Datasets that cannot be read are told
/// of in the window.
pub fn run(args: ViewArgs) -> anyhow::Result<ExitCode> {
    viewer::run(options(args)?)?;
    Ok(ExitCode::SUCCESS)
}

fn options(args: ViewArgs) -> anyhow::Result<ViewOptions> {
    let settings_file = match &args.settings {
        Some(path) if path.as_os_str() == "-" => None,
        Some(path) => Some(path.clone()),
        None => Settings::usual_path(),
    };
    let (mut settings, settings_trouble) =
        settings_file.as_deref().map(Settings::open).unwrap_or_default();
    let look = args.look.upon(settings.look);
    look.check()?;
    settings.look = look;
    settings.theme = args.look.theme.unwrap_or(settings.theme);
    settings.window = args.size.unwrap_or(settings.window);
    settings.point_budget = args.budget.unwrap_or(settings.point_budget);
    settings.min_node_px = args.min_node.unwrap_or(settings.min_node_px);
    settings.cache_mib = args.cache.unwrap_or(settings.cache_mib);
    let camera = args.camera.as_deref().map(read_camera).transpose()?;
    let path = args.path.as_deref().map(PathSource::open).transpose()?;
    let mut options = ViewOptions {
        sources: Vec::new(),
        servers: Vec::new(),
        session: args.session,
        settings,
        settings_file,
        settings_trouble,
        point_budget: args.budget,
        min_node_px: args.min_node,
        camera,
        clip: args.clip,
        path,
        renderer: args.renderer,
        gpu_path: args.look.gpu_path,
        look: args.look,
        folder: args.folder,
        events: args.events,
    };
    for text in args.sources {
        let path = Path::new(&text);
        if path.is_dir() {
            let datasets = source::datasets_of_folder(path);
            anyhow::ensure!(
                !datasets.is_empty(),
                "{text}: there are no .lods files in this folder"
            );
            options.sources.extend(datasets);
        } else if path.is_file() && path.extension().is_some_and(|end| end == "json") {
            if let Some(other) = options.session.replace(path.to_owned()) {
                anyhow::bail!("{} and {text}: one session at a time", other.display());
            }
        } else if source::is_server(&text) {
            options.servers.push(text);
        } else {
            options.sources.push(text);
        }
    }
    Ok(options)
}

fn read_camera(path: &Path) -> anyhow::Result<Camera> {
    let name = || path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(name)?;
    Camera::from_json(&text).with_context(name)
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    let sides =
        sides.filter(|sides: &[u32; 2]| sides.iter().all(|side| (1..=16_384).contains(side)));
    sides.ok_or_else(|| "expected a size like 1280x800, each side 1 to 16384".into())
}

fn min_node(text: &str) -> Result<f64, String> {
    let px = text.parse().ok().filter(|px| Settings::MIN_NODE_PX.contains(px));
    px.ok_or_else(|| "expected 1 to 1000 pixels".into())
}

fn clip(text: &str) -> Result<ClipBox, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let corners = numbers.and_then(|n| <[f64; 6]>::try_from(n).ok());
    let corners = corners.filter(|n| n.iter().all(|c| c.is_finite()));
    let [ax, ay, az, bx, by, bz] =
        corners.ok_or("expected six numbers: the lowest corner's x,y,z, then the highest one's")?;
    let (a, b) = (DVec3::new(ax, ay, az), DVec3::new(bx, by, bz));
    Ok(ClipBox { min: a.min(b), max: a.max(b) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_sizes_are_read() {
        let read = clip("1,2,3, -1,5,9").expect("six numbers");
        assert_eq!((read.min, read.max), (DVec3::new(-1.0, 2.0, 3.0), DVec3::new(1.0, 5.0, 9.0)));
        for bad in ["", "1,2,3", "1,2,3,4,5,x", "1,2,3,4,5,inf"] {
            assert!(clip(bad).is_err(), "{bad}");
        }
        assert_eq!(size("1x1"), Ok([1, 1]));
        assert!(size("0x5").is_err() && size("99999x5").is_err());
        assert!(min_node("0").is_err() && min_node("nan").is_err() && min_node("40").is_ok());
    }

    #[test]
    fn what_is_given_counts_and_the_rest_is_as_it_was() {
        let was = Look { phong: true, edl_strength: 1.0, ..Look::default() };
        let args = LookArgs { splat: Some(Splat::Square), ..LookArgs::default() };
        let look = args.upon(was);
        assert_eq!(look, Look { splat: Splat::Square, ..was });
        let shading = "edl".parse().expect("a shading");
        let args = LookArgs { shading: Some(shading), ..LookArgs::default() };
        assert_eq!((args.upon(was).phong, args.upon(was).eye_dome), (false, true));
    }
}
