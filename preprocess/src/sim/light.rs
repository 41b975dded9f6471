//! Sun, sky and the light that comes off walls, as a scanner's camera sees them.
//!
//! The sun is traced per point. The light of sky and walls is smooth, and is therefore gathered
//! once per metre of space: some rays tell what light arrives from the six sides (an ambient cube,
//! McTaggart 2004), and points take the mean of the cells around them. A cell is gathered when a
//! point first needs it, and is a function of its place alone, so that any order gives the same.

use std::sync::{LazyLock, OnceLock};

use glam::Vec3;

use super::{
    material::rgb,
    random::Random,
    scene::{Hit, Scene},
    shape::{MIN_DISTANCE, Ray},
};

/// Where the sun stands, of length 1: south-south-west, 41 degrees up.
const SUN: Vec3 = Vec3::new(-0.365, -0.662, 0.655);
/// Tangent of the sun's angular radius: what softens a shadow's edge.
const SUN_RADIUS: f32 = 0.0046;
/// Light that the sun throws on a white surface facing it.
const SUN_LIGHT: Vec3 = Vec3::new(1.16, 1.04, 0.86);
/// Share of the sky's light that comes by way of two walls or more, which one bounce misses.
const FURTHER_BOUNCES: f32 = 0.35;

const CELL: f32 = 1.0;
const LOW: Vec3 = Vec3::new(-28.0, -26.0, -0.5);
const CELLS: [usize; 3] = [78, 54, 15];
/// Rays per cell, in the open and in rooms, whose light comes through few small windows.
const GATHER_RAYS: [usize; 2] = [24, 112];
/// Cells with a larger part of their rays inside solids are inside one themselves.
const INSIDE: f32 = 0.16;
/// Light in rooms from lamps and from walls that have theirs from walls.
const ROOM_LIGHT: Vec3 = Vec3::new(0.105, 0.10, 0.093);

/// Light per side (-x, +x, -y, +y, -z, +z) that arrives in a cell, or nothing inside a wall.
type Cube = Option<[Vec3; 6]>;

/// The light in a scene.
pub struct Light {
    scene: &'static Scene,
    cells: Vec<Cell>,
}

struct Cell {
    /// The room that its middle is in.
    room: Option<usize>,
    cube: OnceLock<Cube>,
}

static COURTYARD: LazyLock<Light> = LazyLock::new(|| Light::new(Scene::courtyard()));

impl Light {
    /// The light in the courtyard.
    #[must_use]
    pub fn courtyard() -> &'static Self {
        &COURTYARD
    }

    fn new(scene: &'static Scene) -> Self {
        let cell = |i| Cell { room: scene.room_of(centre(i)), cube: OnceLock::new() };
        Self { scene, cells: (0..CELLS.iter().product()).map(cell).collect() }
    }

    /// Colour of a surface of `albedo` at a point, as 8-bit sRGB. `random` picks a spot on the sun.
    #[must_use]
    pub fn shade(&self, point: Vec3, normal: Vec3, albedo: Vec3, random: &mut Random) -> [u8; 3] {
        let inside = point + normal * 0.05;
        let room = self.scene.room_of(inside);
        let light = self.sun(point, normal, random) + self.ambient(point, normal, room);
        let exposure = room.map_or(1.0, |room| self.scene.rooms()[room].exposure);
        develop(albedo * light * exposure)
    }

    fn sun(&self, point: Vec3, normal: Vec3, random: &mut Random) -> Vec3 {
        let (a, b) = random.pair();
        let incidence = normal.dot(SUN);
        if incidence <= 0.0 {
            return Vec3::ZERO;
        }
        let spread = Vec3::new(a - 0.5, b - 0.5, 0.0) * (2.0 * SUN_RADIUS);
        let ray = Ray { origin: point + normal * 2e-3, direction: (SUN + spread).normalize() };
        if self.scene.blocked(&ray, 100.0) { Vec3::ZERO } else { SUN_LIGHT * incidence }
    }

    /// Light from everywhere but the sun.
    fn ambient(&self, point: Vec3, normal: Vec3, room: Option<usize>) -> Vec3 {
        // From half a cell off the surface, so that most cells asked lie on its lit side.
        let place = (point + normal * (0.5 * CELL) - LOW) / CELL - 0.5;
        let base = [0, 1, 2].map(|i| place[i].clamp(0.0, CELLS[i] as f32 - 1.001));
        let corner = base.map(|b| b as usize);
        let part = [0, 1, 2].map(|i| base[i] - corner[i] as f32);
        let squares = normal * normal;
        let side = |axis: usize| 2 * axis + usize::from(normal[axis] > 0.0);
        let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
        for i in 0..8usize {
            let step = [i & 1, (i >> 1) & 1, i >> 2];
            let weight =
                (0..3).map(|a| if step[a] == 1 { part[a] } else { 1.0 - part[a] }).product::<f32>();
            let [x, y, z] = [corner[0] + step[0], corner[1] + step[1], corner[2] + step[2]];
            let index = (z * CELLS[1] + y) * CELLS[0] + x;
            let cell = &self.cells[index];
            if weight < 0.01 || cell.room != room {
                continue;
            }
            if let Some(cube) = cell.cube.get_or_init(|| self.gather(centre(index), room.is_some()))
            {
                let light = cube[side(0)] * squares.x
                    + cube[side(1)] * squares.y
                    + cube[side(2)] * squares.z;
                sum += light * weight;
                weights += weight;
            }
        }
        if weights > 0.02 { sum / weights } else { ROOM_LIGHT }
    }

    /// What arrives at a point from all sides: sky, and what the sun lights.
    fn gather(&self, origin: Vec3, in_room: bool) -> Cube {
        let rays = GATHER_RAYS[usize::from(in_room)];
        let mut sums = [Vec3::ZERO; 6];
        let mut weights = [0.0f32; 6];
        let mut inside = 0.0;
        for i in 0..rays {
            let direction = spread(i, rays);
            let seen = match self.scene.trace(&Ray { origin, direction }, 60.0) {
                None => sky(direction),
                Some(hit) if !hit.outside => {
                    inside += 1.0 / rays as f32;
                    Vec3::ZERO
                }
                Some(hit) => self.glow(&hit, in_room),
            };
            for axis in 0..3 {
                let side = 2 * axis + usize::from(direction[axis] > 0.0);
                sums[side] += seen * direction[axis].abs();
                weights[side] += direction[axis].abs();
            }
        }
        (inside <= INSIDE).then(|| std::array::from_fn(|side| sums[side] / weights[side].max(1e-6)))
    }

    /// Light that a surface sends on.
    fn glow(&self, hit: &Hit, in_room: bool) -> Vec3 {
        let albedo = self.scene.finish(hit).albedo;
        // A camera's white balance takes half of the tint that bounced light has.
        let albedo = (albedo + Vec3::splat(luminance(albedo))) * 0.5;
        let ray = Ray { origin: hit.point + hit.normal * (20.0 * MIN_DISTANCE), direction: SUN };
        let incidence = hit.normal.dot(SUN);
        let sun = if incidence > 0.0 && !self.scene.blocked(&ray, 100.0) { incidence } else { 0.0 };
        let open = sky(Vec3::Z) * ((0.5 + 0.5 * hit.normal.z) * FURTHER_BOUNCES);
        albedo * (SUN_LIGHT * sun + ROOM_LIGHT + if in_room { Vec3::ZERO } else { open })
    }
}

/// Middle of cell `index`.
fn centre(index: usize) -> Vec3 {
    let cell = [index % CELLS[0], index / CELLS[0] % CELLS[1], index / (CELLS[0] * CELLS[1])];
    LOW + (Vec3::from(cell.map(|c| c as f32)) + 0.5) * CELL
}

fn luminance(color: Vec3) -> f32 {
    color.dot(Vec3::new(0.2126, 0.7152, 0.0722))
}

/// Direction `i` of `count`, spread evenly over the sphere (a Fibonacci spiral).
fn spread(i: usize, count: usize) -> Vec3 {
    let z = 1.0 - (2 * i + 1) as f32 / count as f32;
    let angle = i as f64 * 2.399_963_229_728_653;
    let r = (1.0 - z * z).sqrt();
    Vec3::new(r * libm::cos(angle) as f32, r * libm::sin(angle) as f32, z)
}

/// A clear sky: deep above, pale at the horizon, a meadow below it.
fn sky(direction: Vec3) -> Vec3 {
    if direction.z < 0.0 {
        return rgb(0x7A7A66) * 0.35;
    }
    let pale = (1.0 - direction.z) * (1.0 - direction.z);
    Vec3::new(0.25, 0.36, 0.58).lerp(Vec3::new(0.62, 0.70, 0.80), pale)
}

/// From light to a picture's bytes: a filmic curve that has the gamma in it (Lagarde's fit,
/// x / (x + 0.155) * 1.019), which also makes colours gaudier than film does: a sixth goes to grey.
fn develop(light: Vec3) -> [u8; 3] {
    let light = light.lerp(Vec3::splat(luminance(light)), 0.16);
    let curve = light / (light + 0.155) * 1.019;
    curve.to_array().map(|c| (c.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}
