//! Inside the courtyard: garden wall and gate, stairs, fountain, tables.

use glam::{Mat3, Vec3};

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::{
        facade::{Opening, Wall},
        furniture,
        palette::*,
    },
};

pub fn build(b: &mut Builder) {
    garden_wall(b);
    stairs(b);
    fountain(b);
    b.place(Vec3::new(14.6, 4.1, 0.0), 20.0, cafe_table);
    b.place(Vec3::new(12.2, 2.1, 0.0), -35.0, cafe_table);
    b.place(Vec3::new(1.0, 12.4, 0.0), 90.0, firewood);
    barrels(b);
    for (x, y, degrees) in [(6.4, 13.6, 180.0), (8.2, 15.4, 0.0)] {
        b.place(Vec3::new(x, y, 0.0), degrees, garden_bench);
    }
}

/// Foot of the wall to the street, with the gate between two pillars.
fn garden_wall(b: &mut Builder) {
    b.object("garden wall", class::BUILDING);
    let wall =
        Wall { length: 22.0, thickness: 0.4, heights: (0.0, 2.3), outside: RUBBLE, inside: RUBBLE };
    let gate = Opening { from: 7.6, to: 11.4, sill: 0.0, head: 2.3 };
    b.place(Vec3::new(0.0, -0.4, 0.0), 0.0, |b| wall.build(b, &[gate]));
    for (x0, x1) in [(-0.02, 7.3), (11.7, 22.02)] {
        // A coping with a ridge sheds the rain.
        b.prism((-0.47, 0.07), &[(x0, 2.3), (x1, 2.3), (x1, 2.38), (x0, 2.38)], GRANITE);
        b.place(Vec3::new(x0, -0.2, 2.38), 90.0, |b| {
            b.prism((x0 - x1, 0.0), &[(-0.25, 0.0), (0.25, 0.0), (0.0, 0.13)], ROOF_TILES);
        });
    }
    for x in [7.3, 11.1] {
        b.object("gate", class::BUILDING);
        b.block((x, -0.5, 0.0), (x + 0.6, 0.1, 2.75), ASHLAR);
        b.block((x - 0.07, -0.57, 2.75), (x + 0.67, 0.17, 2.9), SANDSTONE);
        b.turned((x + 0.3, -0.2, 2.9), &[(0.2, 0.0), (0.12, 0.08), (0.1, 0.16)], SANDSTONE);
        b.ball((x + 0.3, -0.2, 3.24), (0.21, 0.21, 0.21), SANDSTONE);
    }
    b.place(Vec3::new(7.92, -0.1, 0.0), 78.0, |b| gate_leaf(b, 1.55));
    b.place(Vec3::new(11.08, -0.1, 0.0), 102.0, |b| gate_leaf(b, 1.55));
}

/// Wrought iron, hinged at the origin.
fn gate_leaf(b: &mut Builder, width: f32) {
    b.object("gate", class::UNCLASSIFIED);
    for z in [0.12, 1.1, 1.95] {
        b.block((0.0, -0.02, z), (width, 0.02, z + 0.05), BLACK_IRON);
    }
    for i in 0..13 {
        let x = i as f32 / 12.0 * (width - 0.04) + 0.02;
        let top = 2.05 + 0.28 * (i as f32 / 12.0);
        b.pole((x, 0.0, 0.08), (x, 0.0, top), 0.011, BLACK_IRON);
        b.ball((x, 0.0, top + 0.04), (0.018, 0.018, 0.05), BRASS);
    }
}

/// Twenty steps along the garden wall up to the terrace over the arcade.
fn stairs(b: &mut Builder) {
    b.object("stairs", class::BUILDING);
    let (steps, rise, run, start) = (20, 0.1825, 0.29, 16.2);
    for i in 0..steps {
        let x = start + run * i as f32;
        let z = rise * (i + 1) as f32;
        b.block((x, 0.35, 0.0), (x + run, 1.95, z - 0.05), RUBBLE);
        b.block((x - 0.03, 0.33, z - 0.05), (x + run, 1.97, z), SANDSTONE);
        if i % 2 == 0 {
            b.pole((x + 0.14, 1.88, z), (x + 0.14, 1.88, z + 0.9), 0.012, BLACK_IRON);
        }
    }
    let rail = |i: f32| Vec3::new(start + run * i + 0.14, 1.88, rise * (i + 1.0) + 0.9);
    b.pole(rail(0.0), rail(19.0), 0.022, BLACK_IRON);
}

/// An octagonal basin with a bowl on a column.
fn fountain(b: &mut Builder) {
    b.place(Vec3::new(13.4, 8.9, 0.0), 11.0, |b| {
        b.object("fountain", class::BUILDING);
        b.turned((0.0, 0.0, 0.0), &[(2.35, 0.0), (2.35, 0.14)], GRANITE);
        let side = 1.75f32 * (std::f32::consts::PI / 8.0).tan();
        for i in 0..8 {
            b.place(Vec3::Z * 0.14, 45.0 * i as f32, |b| {
                b.block((1.5, -side, 0.0), (1.75, side, 0.5), SANDSTONE);
                b.block((1.44, -side - 0.02, 0.5), (1.82, side + 0.02, 0.6), SANDSTONE);
                b.block((1.75, -0.3, 0.12), (1.775, 0.3, 0.4), GRANITE);
            });
        }
        b.turned(
            (0.0, 0.0, 0.14),
            &[
                (0.42, 0.0),
                (0.42, 0.3),
                (0.2, 0.38),
                (0.15, 0.75),
                (0.19, 1.05),
                (0.12, 1.12),
                (0.75, 1.3),
                (0.82, 1.38),
            ],
            SANDSTONE,
        );
        b.turned(
            (0.0, 0.0, 1.52),
            &[(0.14, 0.0), (0.1, 0.35), (0.18, 0.42), (0.1, 0.5)],
            SANDSTONE,
        );
        b.ball((0.0, 0.0, 2.13), (0.11, 0.11, 0.17), SANDSTONE);
        b.object("water", class::WATER);
        b.turned((0.0, 0.0, 0.14), &[(1.56, 0.0), (1.56, 0.36)], Material::Water);
        b.turned((0.0, 0.0, 1.52), &[(0.74, 0.0), (0.74, 0.015)], Material::Water);
    });
}

/// A round table under a parasol, with four chairs.
fn cafe_table(b: &mut Builder) {
    b.object("cafe table", class::UNCLASSIFIED);
    b.turned((0.0, 0.0, 0.0), &[(0.28, 0.0), (0.26, 0.03)], BLACK_IRON);
    b.pole((0.0, 0.0, 0.03), (0.0, 0.0, 2.55), 0.025, PALE_WOOD);
    b.turned((0.0, 0.0, 0.71), &[(0.5, 0.0), (0.5, 0.03)], WHITE_PAINT);
    b.object("parasol", class::UNCLASSIFIED);
    let stripes = Material::Gores { color: rgb(0xF1EADB), second: rgb(0xC24A3A), count: 16 };
    b.shade((0.0, 0.0, 2.12), (0.0, 0.0, 2.62), (1.45, 0.03), stripes);
    b.shade((0.0, 0.0, 2.0), (0.0, 0.0, 2.12), (1.47, 1.45), stripes);
    for i in 0..8 {
        let angle = f32::to_radians(45.0 * i as f32 + 10.0);
        let tip = Vec3::new(1.4 * angle.cos(), 1.4 * angle.sin(), 2.1);
        b.pole((0.0, 0.0, 2.57), tip, 0.008, PALE_WOOD);
    }
    for i in 0..4 {
        b.place(Vec3::ZERO, 90.0 * i as f32 + 30.0, |b| {
            b.place(Vec3::new(0.0, -0.75, 0.0), 0.0, |b| {
                furniture::chair(b, TEAL_PAINT, TEAL_PAINT)
            });
        });
    }
}

/// Cut logs, stacked between two posts.
fn firewood(b: &mut Builder) {
    b.object("firewood", class::UNCLASSIFIED);
    let (bark, cut) = (Material::Bark { color: rgb(0x7C6148) }, PALE_WOOD);
    let mut random = crate::sim::random::Random::of([71, 0, 0, 0]);
    for row in 0..8 {
        for i in 0..15 {
            let radius = random.range(0.055, 0.078);
            let x = -1.15 + 0.16 * i as f32 + 0.08 * (row % 2) as f32;
            let z = 0.08 + 0.138 * row as f32;
            let shape = b.cone_shape(
                Vec3::new(x, random.range(0.0, 0.05), z),
                Vec3::new(x, random.range(0.68, 0.75), z),
                (radius, radius),
                true,
            );
            let ids = [bark, cut, cut].map(|material| b.surface(material));
            b.add_faces(shape, &ids);
        }
    }
    for x in [-1.3, 1.34] {
        b.block((x, 0.05, 0.0), (x + 0.09, 0.14, 1.5), DARK_BEAM);
        b.block((x, 0.55, 0.0), (x + 0.09, 0.64, 1.3), DARK_BEAM);
    }
    b.place_turned(Vec3::new(0.0, 0.35, 1.5), Mat3::from_rotation_x(-0.25), |b| {
        b.block((-1.5, -0.5, 0.0), (1.6, 0.5, 0.04), DARK_BEAM);
    });
}

fn barrels(b: &mut Builder) {
    b.object("barrel", class::UNCLASSIFIED);
    for (x, y, top) in [(0.75, 14.9, 0.92), (1.5, 15.35, 0.92), (0.7, 8.2, 0.85)] {
        let middle = 0.5 * top;
        let profile =
            [(0.27, 0.0), (0.34, 0.6 * middle), (0.35, middle), (0.34, 1.4 * middle), (0.27, top)];
        b.turned((x, y, 0.0), &profile, OAK);
        for z in [0.16, 0.62, 1.32, 1.78] {
            let r = 0.285 + 0.068 * (1.0 - (z - 1.0f32).abs());
            b.shade(
                (x, y, z * middle),
                (x, y, z * middle + 0.04),
                (r + 0.012, r + 0.012),
                BLACK_IRON,
            );
        }
    }
}

fn garden_bench(b: &mut Builder) {
    b.object("bench", class::UNCLASSIFIED);
    for i in 0..4 {
        let y = -0.22 + 0.115 * i as f32;
        b.block((-0.8, y, 0.43), (0.8, y + 0.09, 0.46), OAK);
    }
    for i in 0..3 {
        let z = 0.56 + 0.13 * i as f32;
        b.place_turned(
            Vec3::new(0.0, 0.25 + 0.03 * i as f32, z),
            Mat3::from_rotation_x(-0.2),
            |b| {
                b.block((-0.8, 0.0, 0.0), (0.8, 0.025, 0.1), OAK);
            },
        );
    }
    for x in [-0.72, 0.66] {
        b.block((x, -0.2, 0.0), (x + 0.06, -0.14, 0.43), BLACK_IRON);
        b.block((x, 0.18, 0.0), (x + 0.06, 0.24, 0.5), BLACK_IRON);
        b.block((x, -0.2, 0.39), (x + 0.06, 0.24, 0.43), BLACK_IRON);
        b.pole((x + 0.03, 0.2, 0.45), (x + 0.03, 0.36, 0.95), 0.02, BLACK_IRON);
    }
}
