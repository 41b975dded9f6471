//! Where trees stand; hedges, ivy, flowers and plants in pots. Leaves are single discs.

use glam::Vec3;

use crate::sim::{
    material::{Material, rgb},
    noise::noise2,
    random::Random,
    scene::Builder,
    site::{arcade::TERRACE, ground::EXTENT, palette::*, tree::Tree},
};

pub fn build(b: &mut Builder) {
    planting_bed(b, Vec3::new(5.6, 9.4, 0.0));
    let linden =
        Tree { height: 8.6, spread: 1.0, leaves: 9000, leaf: 0.07, color: 0x6FA03C, seed: 1 };
    linden.grow(b, Vec3::new(5.6, 9.4, 0.3));
    let olive =
        Tree { height: 3.9, spread: 0.85, leaves: 2400, leaf: 0.05, color: 0x93A876, seed: 2 };
    olive.grow(b, Vec3::new(19.6, 4.3, 0.0));
    for (x, y, height, color, seed) in [
        (-13.5, -16.9, 8.6, 0x5C8C33, 11),
        (-4.2, -17.4, 7.8, 0x6A963A, 12),
        (20.5, -17.2, 8.2, 0x7DA042, 13),
        (31.5, -16.8, 8.6, 0x5E8E38, 14),
    ] {
        let tree = Tree { height, spread: 1.0, leaves: 4200, leaf: 0.115, color, seed };
        tree.grow(b, Vec3::new(x, y, -0.02));
    }
    for (x, seed) in [(-10.4, 21), (0.9, 22), (23.6, 23), (36.2, 24)] {
        b.object("tree pit", class::GROUND);
        b.turned((x, -2.35, -0.2), &[(0.55, 0.0), (0.55, 0.21)], Material::Soil);
        let tree =
            Tree { height: 5.2, spread: 0.75, leaves: 2600, leaf: 0.075, color: 0x86A84A, seed };
        tree.grow(b, Vec3::new(x, -2.35, 0.0));
    }
    ivy(b);
    for (x0, x1) in [(EXTENT.0, 10.4), (14.2, EXTENT.1)] {
        hedge(b, x0, x1);
    }
    pots(b);
}

/// A raised bed around a tree: a ring of stone, earth, flowers.
fn planting_bed(b: &mut Builder, centre: Vec3) {
    b.object("planting bed", class::UNCLASSIFIED);
    for i in 0..16 {
        b.place(centre, 22.5 * i as f32, |b| {
            b.block((1.55, -0.36, 0.0), (1.85, 0.36, 0.4), SANDSTONE);
            b.block((1.5, -0.38, 0.4), (1.9, 0.38, 0.46), SANDSTONE);
        });
    }
    b.object("soil", class::GROUND);
    b.turned(centre, &[(1.6, 0.0), (1.6, 0.33)], Material::Soil);
    b.object("flowers", class::LOW_VEGETATION);
    let kinds = [(0x4F7A33, 500), (0xE3D9E8, 60), (0xD8607C, 90), (0xF0C63C, 70)];
    let mut random = Random::of([31, 0, 0, 0]);
    for (color, count) in kinds {
        let surface = b.surface(leaf(color));
        for _ in 0..count {
            let (angle, r) = (random.range(0.0, std::f32::consts::TAU), 1.5 * random.unit().sqrt());
            let z =
                if color == 0x4F7A33 { random.range(0.33, 0.5) } else { random.range(0.47, 0.58) };
            let at = centre + Vec3::new(r * angle.cos(), r * angle.sin(), z);
            let normal = random.direction() * 0.8 + Vec3::Z;
            b.leaf(at, normal, random.direction(), (0.05, 0.035), surface);
        }
    }
}

/// Ivy on the boundary wall in the west and up the neighbour's corner.
fn ivy(b: &mut Builder) {
    b.object("ivy", class::MEDIUM_VEGETATION);
    let surface = b.surface(leaf(0x4C7A35));
    let mut random = Random::of([41, 0, 0, 0]);
    let mut left = 5200;
    while left > 0 {
        let y = random.range(7.2, 15.8);
        let z = random.range(0.0, 5.6);
        let limit = 1.0
            + 4.4 * noise2(glam::Vec2::new(y * 0.45, 0.3), 61) * if y > 10.0 { 0.68 } else { 1.0 };
        let ragged = limit + 0.5 * noise2(glam::Vec2::new(y * 3.0, z * 3.0), 62) - 0.25;
        if z > ragged || (y > 10.1 && z > 3.1) {
            continue;
        }
        left -= 1;
        let depth = 0.03 + 0.16 * random.unit() * (1.0 - z / 6.5);
        let over = if y > 10.1 && z > 2.85 { -random.range(0.0, 0.35) } else { 0.0 };
        let normal = Vec3::new(1.0, 0.0, 0.35) + random.direction() * 0.65;
        let size = random.range(0.035, 0.065);
        b.leaf(Vec3::new(depth + 0.04 + over, y, z), normal, -Vec3::Z, (1.1 * size, size), surface);
    }
}

/// A clipped hedge along the park: leaves around a dark core.
fn hedge(b: &mut Builder, x0: f32, x1: f32) {
    b.object("hedge", class::MEDIUM_VEGETATION);
    let (south, north, top) = (-12.35, -11.75, 0.95);
    let (south, north) = (south - 1.1, north - 1.1);
    b.block(
        (x0, south + 0.1, 0.0),
        (x1, north - 0.1, top - 0.12),
        Material::Leaf { color: rgb(0x2E4423) },
    );
    let surface = b.surface(leaf(0x557F36));
    let mut random = Random::of([51, x0.to_bits().into(), 0, 0]);
    let count = ((x1 - x0) * 130.0) as usize;
    for _ in 0..count {
        let x = random.range(x0, x1);
        // Unrolled cross-section: up the north side, over the top, down the south side.
        let s = random.range(0.0, 2.0 * top + (north - south));
        let (y, z, out) = if s < top {
            (north, s, Vec3::Y)
        } else if s < top + north - south {
            (north - (s - top), top, Vec3::Z)
        } else {
            (south, s - top - (north - south), -Vec3::Y)
        };
        let at = Vec3::new(x, y, z) - out * (0.14 * random.unit() * random.unit());
        let normal = out + random.direction() * 0.9;
        b.leaf(at, normal, random.direction(), (0.085, 0.06), surface);
    }
}

fn pots(b: &mut Builder) {
    let greens = [0x5B8A3A, 0x7A9C4F, 0x4C7A45, 0x8FA35A];
    let blooms = [0xD9486B, 0xF1EDE4, 0xE8A53A, 0xB04A9C];
    let places = [
        (9.9, 15.35, 0.0, 0.3),
        (12.5, 15.35, 0.0, 0.3),
        (0.9, 3.2, 0.0, 0.36),
        (1.2, 4.3, 0.0, 0.26),
        (16.3, 14.9, 0.0, 0.28),
        (19.2, 15.2, 0.0, 0.34),
        (21.6, 9.8, 0.0, 0.3),
        (21.6, 3.6, 0.0, 0.3),
        (22.9, 15.2, TERRACE, 0.34),
        (25.4, 15.3, TERRACE, 0.3),
        (23.0, 2.8, TERRACE, 0.3),
        (25.4, 0.8, TERRACE, 0.36),
        (25.4, 7.0, TERRACE, 0.28),
    ];
    for (i, (x, y, z, size)) in places.into_iter().enumerate() {
        let foot = Vec3::new(x, y, z);
        b.object("flower pot", class::UNCLASSIFIED);
        let profile = [(0.62, 0.0), (0.95, 1.3), (1.06, 1.32), (1.04, 1.55)]
            .map(|(r, h)| (r * size, h * size));
        b.turned(foot, &profile, TERRACOTTA);
        b.object("potted plant", class::LOW_VEGETATION);
        let (green, bloom) = (b.surface(leaf(greens[i % 4])), b.surface(leaf(blooms[i % 4])));
        let mut random = Random::of([61, i as u64, 0, 0]);
        let middle = foot + Vec3::Z * (2.3 * size);
        for k in 0..320 {
            let out = random.direction();
            let flower = k % 7 == 0;
            let r = size * if flower { 1.3 } else { 1.25 * random.unit().sqrt() };
            let at = middle + out * Vec3::new(1.0, 1.0, 0.8) * r;
            let long = if flower { 0.03 } else { random.range(0.035, 0.06) };
            b.leaf(
                at,
                out + random.direction() * 0.6,
                random.direction(),
                (long, 0.7 * long),
                if flower { bloom } else { green },
            );
        }
    }
}
