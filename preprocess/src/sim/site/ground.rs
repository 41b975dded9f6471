//! What one walks on outdoors: paving, pavements, carriageway, park.

use glam::Vec2;

use crate::sim::{
    material::{Material, rgb, street},
    scene::Builder,
    site::palette::{GRANITE, class},
};

/// Level of the carriageway; everything else is at zero.
pub const ROAD_LEVEL: f32 = -0.13;

/// From x to x: as far as anything is built.
pub const EXTENT: (f32, f32) = (-22.0, 38.0);
/// Southern end of the park.
const PARK_END: f32 = -18.6;

pub fn build(b: &mut Builder) {
    let flags = Material::Flags { color: rgb(0xB3ADA2), size: Vec2::new(0.5, 0.5), bond: 0.5 };
    let (south, north) = street::EDGES;
    let (west, east) = EXTENT;
    b.object("paving", class::GROUND);
    b.block((-0.4, 0.0, -0.4), (26.0, 25.2, 0.0), Material::Cobbles { color: rgb(0xA79C8C) });
    b.object("pavement", class::GROUND);
    b.block((west, north + 0.16, -0.4), (east, 0.0, 0.0), flags);
    b.block((west, south - 2.2, -0.4), (east, south - 0.16, 0.0), flags);
    b.object("road", class::ROAD);
    b.block((west, south, -0.4), (east, north, ROAD_LEVEL), Material::Road);
    b.object("kerb", class::GROUND);
    for y in [north, south - 0.16] {
        let mut x = west;
        while x < east {
            b.block((x, y, -0.4), (x + 0.992, y + 0.16, 0.005), GRANITE);
            x += 1.0;
        }
    }
    b.object("park", class::GROUND);
    b.block((west, PARK_END, -0.4), (east, south - 2.2, -0.01), Material::Grass);
    b.block((11.0, PARK_END, -0.3), (13.6, south - 2.2, 0.01), Material::Gravel);
    b.block((west, -15.6, -0.3), (11.0, -14.2, 0.01), Material::Gravel);
    b.block((13.6, -15.6, -0.3), (east, -14.2, 0.01), Material::Gravel);
    b.object("garden", class::GROUND);
    b.block((west, 0.0, -0.6), (-0.4, 25.2, -0.01), Material::Grass);
    b.block((26.0, 0.0, -0.6), (east, 25.2, -0.01), Material::Grass);
    b.block((-0.4, 25.2, -0.6), (26.0, 28.5, -0.01), Material::Grass);
}
