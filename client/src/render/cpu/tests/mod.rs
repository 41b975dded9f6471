//! The CPU renderer against what must be seen: counted by hand, or found another way.

mod blended;
mod density;
pub(in crate::render) mod extremes;
mod facing;
mod mesh;
mod oriented;
mod shading;
mod sizes;
mod truth;

use std::sync::Arc;

use glam::DVec3;
use lodestream_protocol::{Attribute, Column, Lattice, ScalarType, Storage};

use crate::{
    camera::{Camera, Projection},
    render::{
        CpuRenderer, Frame, Picture, RenderSettings, Splat, SplatSize,
        testing::{Point, TestScene, cloud},
    },
};

const BACKGROUND: [u8; 3] = [12, 34, 56];

/// World units per lattice unit; the world is -2048 to 2048 on each axis.
const SCALE: f64 = 1.0 / (1 << 20) as f64;

/// A point, and how its surface lies. World x is to the right, z up, y away from the eye, which is
/// at the origin.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Surfel {
    pub place: DVec3,
    pub rgb: [u8; 3],
    pub normal: [f32; 3],
    pub axes: [[f32; 3]; 2],
    pub radius: f32,
}

impl Surfel {
    /// So far to the right of the eye, above it and away from it.
    pub(in crate::render) fn at(right: f64, up: f64, away: f64) -> Self {
        Self {
            place: DVec3::new(right, away, up),
            rgb: [10, 20, 30],
            normal: [0.0; 3],
            axes: [[0.0; 3]; 2],
            radius: 0.0,
        }
    }
}

/// A cloud of one node with these attributes of `normal`, `axis_u`, `axis_v`, `radius`.
pub(in crate::render) fn scene(surfels: &[Surfel], attributes: &[&str]) -> TestScene {
    scene_at(DVec3::ZERO, surfels, attributes)
}

/// The same, moved in the world.
pub(in crate::render) fn scene_at(
    shift: DVec3,
    surfels: &[Surfel],
    attributes: &[&str],
) -> TestScene {
    let low = DVec3::splat(-2048.0);
    let offset = (low + shift).to_array();
    let lattice = Lattice { scale: SCALE, offset, origin: [0; 3], side_bits: 32 };
    let point = |surfel: &Surfel| Point {
        q: ((surfel.place - low) / SCALE).to_array().map(|c| c.round() as u32),
        rgb: surfel.rgb,
        intensity: 0,
    };
    let points: Vec<_> = surfels.iter().map(point).collect();
    let mut scene = cloud(lattice, 1, &points);
    for name in attributes {
        let values = |surfel: &Surfel| match *name {
            "normal" => surfel.normal.to_vec(),
            "axis_u" => surfel.axes[0].to_vec(),
            "axis_v" => surfel.axes[1].to_vec(),
            "radius" => vec![surfel.radius],
            _ => panic!("{name}"),
        };
        add_attribute(&mut scene, name, surfels.iter().map(values).collect());
    }
    scene
}

/// Adds an attribute of f32 to a scene of at most one node.
fn add_attribute(scene: &mut TestScene, name: &str, values: Vec<Vec<f32>>) {
    let components = values.first().map_or(1, Vec::len);
    let manifest = Arc::make_mut(&mut scene.clouds[0]);
    let attribute = manifest.attributes.len();
    manifest.attributes.push(Attribute {
        name: name.into(),
        scalar: ScalarType::F32,
        components: u8::try_from(components).expect("few"),
        domain: Default::default(),
        storage: Storage::Column { group: 0 },
        min: vec![f64::from(f32::MIN); components],
        max: vec![f64::from(f32::MAX); components],
    });
    manifest.groups[0].columns.push(0);
    for node in &mut scene.nodes {
        let bytes = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let mut points = node.points.as_ref().clone();
        points.columns.push(Column { attribute, bytes });
        node.points = Arc::new(points);
    }
}

/// From the origin along y.
fn camera(projection: Projection) -> Camera {
    Camera { eye: DVec3::ZERO, target: DVec3::Y, up: DVec3::Z, projection }
}

/// A pixel is a world unit.
pub(in crate::render) fn orthographic(size_px: [u32; 2]) -> RenderSettings {
    let height = f64::from(size_px[1]);
    let settings = RenderSettings::new(size_px, camera(Projection::Orthographic { height }));
    RenderSettings { background: BACKGROUND, ..settings }
}

/// The view spans 90 degrees from the lower to the upper edge: a pixel is a world unit where the
/// distance is half the height.
pub(in crate::render) fn perspective(size_px: [u32; 2]) -> RenderSettings {
    let projection = Projection::Perspective { fov_y: std::f64::consts::FRAC_PI_2 };
    RenderSettings { camera: camera(projection), ..orthographic(size_px) }
}

pub(in crate::render) fn with(
    splat: Splat,
    size_px: f32,
    settings: RenderSettings,
) -> RenderSettings {
    RenderSettings { splat, splat_size: SplatSize::Pixels(size_px), ..settings }
}

fn render(scene: &TestScene, settings: &RenderSettings) -> Frame {
    CpuRenderer.render(&scene.scene(), settings).expect("drawn")
}

fn draw(surfels: &[Surfel], attributes: &[&str], settings: &RenderSettings) -> Picture {
    render(&scene(surfels, attributes), settings).picture
}

pub(in crate::render) fn color_at(picture: &Picture, column: u32, row: u32) -> [u8; 3] {
    let at = 4 * (row * picture.width + column) as usize;
    [picture.rgba8[at], picture.rgba8[at + 1], picture.rgba8[at + 2]]
}

fn depth_at(picture: &Picture, column: u32, row: u32) -> f32 {
    picture.depth[(row * picture.width + column) as usize]
}

/// Pixels on which something was drawn: column, row, distance.
pub(in crate::render) fn drawn(picture: &Picture) -> Vec<(u32, u32, f64)> {
    let drawn = picture.depth.iter().zip(0..).filter(|(d, _)| d.is_finite());
    drawn.map(|(d, i)| (i % picture.width, i / picture.width, f64::from(*d))).collect()
}

/// Fails where two lists of drawn pixels differ, or their distances by more than rounding to f32.
fn assert_drawn(found: &[(u32, u32, f64)], expected: &[(u32, u32, f64)], what: &str) {
    let places = |drawn: &[(u32, u32, f64)]| drawn.iter().map(|d| (d.0, d.1)).collect::<Vec<_>>();
    assert_eq!(places(found), places(expected), "{what}");
    for (found, expected) in found.iter().zip(expected) {
        let difference = (found.2 - expected.2).abs();
        assert!(difference <= 1e-6 * expected.2.abs(), "{what}: {found:?}, expected {expected:?}");
    }
}
