//! A picture of every splat, size, shading and colour, and how alike the renderers draw it
//!
//! `./dev bench pictures [INPUT]`. INPUT is a dataset or anything that `lodestream build` takes;
//! without one, a simulated courtyard of 4 million points with the ellipses of its beam. Prints for
//! every way to draw the structural similarity (SSIM) of the rasteriser's and the compute path's
//! picture to the CPU's of the same nodes, and of the CPU's to the truth: all points, supersampled.
//! Writes contact sheets of the GPU's pictures into the folder `pictures/` of the target folder.

use std::{
    env,
    error::Error,
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
    time::Duration,
};

use font8x8::UnicodeFonts;
use glam::DVec3;
use image::{RgbImage, imageops};
use lodestream_client::{
    camera::{Camera, Projection},
    engine::{DrawNode, Engine, EngineConfig, FramePlan, View},
    metrics::ssim,
    render::{
        ColorMode, CpuRenderer, GpuConfig, GpuPath, GpuRenderer, Picture, RenderSettings, Scene,
        Shading, Splat, SplatSize, TruthRenderer, VisibleTree,
    },
    source::Source,
};
use lodestream_preprocess::{FileSource, sim};
use lodestream_protocol::{Dataset, Manifest};
use lodestream_tests::{Options, program};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const DEFAULT_INPUT: &str = "sim:courtyard?points=4M&seed=1&axes=1";

/// Of the pictures; tiles are half as wide and high.
const SIZE_PX: [u32; 2] = [640, 400];

const BUDGET: u64 = 1_000_000;

/// Samples along each side of the truth's pixels.
const SAMPLES: u32 = 4;

/// Below each tile.
const LABEL_PX: u32 = 14;

/// A row of a table and a tile of a sheet.
struct Way {
    name: String,
    settings: RenderSettings,
}

fn main() -> Result<()> {
    let Options { input, .. } = Options::parse(DEFAULT_INPUT)?;
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("pictures");
    std::fs::create_dir_all(&target)?;
    let dataset = if Path::new(&input).extension().is_some_and(|e| e == "lods") {
        PathBuf::from(&input)
    } else {
        let dataset = target.join("dataset.lods");
        let mut build = Command::new(program("lodestream")?);
        let status = build.arg("build").arg(&input).arg("-o").arg(&dataset).status()?;
        status.success().then_some(dataset).ok_or("the build failed")?
    };
    let courtyard = input.to_str().is_some_and(|input| input.starts_with("sim:courtyard"));
    let mut studio = Studio::open(&dataset)?;
    println!("{}; {}x{} pixels", studio.raster.adapter(), SIZE_PX[0], SIZE_PX[1]);
    println!("\n| picture | raster | compute | CPU against truth | points |");
    println!("| --- | --- | --- | --- | --- |");
    let near = studio.camera(courtyard, "door", 0.4);
    let wide = studio.camera(courtyard, "overview", 1.0);
    let from = |camera| RenderSettings {
        background: [18, 18, 24],
        ..RenderSettings::new(SIZE_PX, camera)
    };
    let way = |name: &str, settings| Way { name: name.to_owned(), settings };

    // So large that shapes show.
    let large = SplatSize::Adaptive(6.0);
    let splats = Splat::ALL
        .map(|(splat, name)| way(name, RenderSettings { splat, splat_size: large, ..from(near) }));
    studio.sheet(&target.join("splats.png"), &splats, 5)?;

    let sizes = [
        ("2px", SplatSize::Pixels(2.0)),
        ("6px", SplatSize::Pixels(6.0)),
        ("fixed in the world", SplatSize::World(studio.world_size())),
        ("by level", SplatSize::Level(1.6)),
        ("adaptive", SplatSize::Adaptive(1.6)),
        ("own", SplatSize::Own),
    ];
    let sizes =
        sizes.map(|(name, splat_size)| way(name, RenderSettings { splat_size, ..from(wide) }));
    studio.sheet(&target.join("sizes.png"), &sizes, 3)?;

    let mut looks = Vec::new();
    for color in ColorMode::ALL {
        let settings = RenderSettings { color, splat_size: SplatSize::Adaptive(1.6), ..from(wide) };
        looks.push(way(color.name(), settings));
    }
    for (name, shading) in [("phong", "phong"), ("eye-dome", "edl"), ("both", "phong+edl")] {
        let shading: Shading = shading.parse()?;
        for color in [ColorMode::Rgb, ColorMode::Elevation] {
            let splat_size = SplatSize::Adaptive(1.6);
            let settings = RenderSettings { shading, color, splat_size, ..from(wide) };
            looks.push(way(&format!("{} {name}", color.name()), settings));
        }
    }
    studio.sheet(&target.join("looks.png"), &looks, 5)?;
    println!("\n{}", target.display());
    Ok(())
}

/// A dataset and all renderers.
struct Studio {
    dataset: PathBuf,
    clouds: Vec<Arc<Manifest>>,
    engine: Engine,
    raster: GpuRenderer,
    compute: GpuRenderer,
}

impl Studio {
    fn open(dataset: &Path) -> Result<Self> {
        let source = Source::parse(dataset.to_str().ok_or("the file's name is no text")?)?;
        let names = ["color", "intensity", "classification", "normal", "axis_u", "axis_v"];
        let attributes = names.map(str::to_owned).to_vec();
        let config = EngineConfig { point_budget: BUDGET, attributes, ..EngineConfig::default() };
        let engine = Engine::start(vec![source], config)?;
        let boots = engine.wait_open(Duration::from_secs(60))?;
        let clouds = boots.iter().map(|boot| Arc::new(boot.manifest.clone())).collect();
        let open = |path| GpuRenderer::new(GpuConfig { path, ..GpuConfig::default() });
        let (raster, compute) = (open(GpuPath::Raster)?, open(GpuPath::Compute)?);
        Ok(Self { dataset: dataset.to_owned(), clouds, engine, raster, compute })
    }

    /// A view of the simulated scan, or the overview of any other, with so much of its field of view.
    fn camera(&self, courtyard: bool, name: &str, field: f64) -> Camera {
        if courtyard && let Some(view) = sim::VIEWS.iter().find(|view| view.name == name) {
            let projection = Projection::Perspective { fov_y: view.fov_y_degrees.to_radians() };
            let (eye, target) = (view.eye.into(), view.target.into());
            return Camera { eye, target, up: DVec3::Z, projection };
        }
        let bounds = self.clouds[0].bounds_world();
        let (min, max) = bounds.unwrap_or(([0.0; 3], [1.0; 3]));
        let aspect = f64::from(SIZE_PX[0]) / f64::from(SIZE_PX[1]);
        let overview = Camera::overview(DVec3::from(min), DVec3::from(max), aspect);
        match overview.projection {
            Projection::Perspective { fov_y } => {
                Camera { projection: Projection::Perspective { fov_y: field * fov_y }, ..overview }
            }
            Projection::Orthographic { .. } => overview,
        }
    }

    /// What closes the surface on the level that most points are seen at.
    fn world_size(&self) -> f64 {
        1.6 * self.clouds[0].spacing_world(self.clouds[0].levels / 2)
    }

    fn load(&self, camera: Camera) -> Result<Arc<FramePlan>> {
        self.engine.set_view(View { camera, size_px: SIZE_PX });
        Ok(self.engine.wait_settled(Duration::from_secs(60))?)
    }

    /// Draws all of them, prints a line for each, and writes the sheet.
    fn sheet(&mut self, path: &Path, ways: &[Way], columns: u32) -> Result<()> {
        let [width, height] = SIZE_PX.map(|side| side / 2);
        let rows = (ways.len() as u32).div_ceil(columns);
        let mut sheet = RgbImage::new(columns * width, rows * (height + LABEL_PX));
        for (way, index) in ways.iter().zip(0u32..) {
            let plan = self.load(way.settings.camera)?;
            let scene = Scene { clouds: &self.clouds, nodes: &plan.nodes };
            let cpu = CpuRenderer.render(&scene, &way.settings)?.picture;
            let raster = self.raster.render(&scene, &way.settings)?.picture;
            let compute = self.compute.render(&scene, &way.settings)?;
            let by_compute = if compute.statistics.path == Some(GpuPath::Compute) {
                format!("{:.4}", ssim(&cpu, &compute.picture)?)
            } else {
                "-".into()
            };
            // Counts of all points have another scale.
            let truth = match way.settings.color {
                ColorMode::Density => "-".into(),
                _ => format!("{:.4}", ssim(&cpu, &self.truth(&way.settings)?)?),
            };
            println!(
                "| {} | {:.4} | {by_compute} | {truth} | {} |",
                way.name,
                ssim(&cpu, &raster)?,
                plan.points
            );
            let (x, y) = (index % columns * width, index / columns * (height + LABEL_PX));
            imageops::replace(&mut sheet, &tile(&raster)?, i64::from(x), i64::from(y));
            label(&mut sheet, &way.name, x + 4, y + height + 3);
        }
        Ok(sheet.save(path)?)
    }

    /// The picture of all points.
    fn truth(&self, settings: &RenderSettings) -> Result<Picture> {
        let dataset = Dataset::open(FileSource::open(&self.dataset)?)?;
        let mut nodes = dataset.hierarchy()?;
        nodes.sort_by_key(|node| node.key);
        let tree = VisibleTree::of(nodes.iter().map(|n| (0, n.key, n.spacing)));
        let mut renderer = TruthRenderer::new(settings, &self.clouds, tree, SAMPLES)?;
        let groups = settings.groups(&self.clouds[0]);
        for pass in 0..renderer.passes() {
            if pass > 0 {
                renderer.next_pass()?;
            }
            for node in &nodes {
                let points = Arc::new(dataset.read_node(node, &groups)?);
                let (key, spacing) = (node.key, node.spacing);
                renderer.add_node(DrawNode { cloud: 0, key, spacing, points, part: 0 })?;
            }
        }
        Ok(renderer.finish()?.picture)
    }
}

/// Half as wide and high.
fn tile(picture: &Picture) -> Result<RgbImage> {
    let bytes = picture.rgba8.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    let whole = RgbImage::from_raw(picture.width, picture.height, bytes);
    let whole = whole.ok_or("the picture is not whole")?;
    let (width, height) = (picture.width / 2, picture.height / 2);
    Ok(imageops::resize(&whole, width, height, imageops::FilterType::Triangle))
}

fn label(sheet: &mut RgbImage, text: &str, x: u32, y: u32) {
    for (c, place) in text.chars().zip(0u32..) {
        let Some(glyph) = font8x8::BASIC_FONTS.get(c) else { continue };
        for (row, bits) in (0u32..).zip(glyph) {
            for column in (0..8u32).filter(|column| bits >> column & 1 == 1) {
                let (x, y) = (x + 8 * place + column, y + row);
                if x < sheet.width() && y < sheet.height() {
                    sheet.put_pixel(x, y, image::Rgb([220, 220, 220]));
                }
            }
        }
    }
}
