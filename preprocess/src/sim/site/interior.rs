//! The rooms of the ground floor and what stands in them.

use glam::Vec3;

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::{
        facade::{Opening, Wall, door_leaf},
        furniture::{
            self, bed, bookshelf, cabinet, chair, fireplace, pendant, picture, sofa, stand_lamp,
            table, tableware,
        },
        house::{CEILING, FLOOR},
        palette::*,
    },
};

/// Inside of the outer walls, from south to north.
const SOUTH: f32 = 16.45;
const NORTH: f32 = 24.55;

pub fn build(b: &mut Builder) {
    for (x0, x1) in [(0.3, 9.5), (9.5, 12.9), (12.9, 16.5), (16.5, 21.7)] {
        b.room(Vec3::new(x0, 16.3, 0.0), Vec3::new(x1, 24.7, 3.2), 4.4);
    }
    partition(b, 9.4, 18.0, SAGE_PLASTER, WHITE_PLASTER, 172.0);
    partition(b, 12.8, 17.6, WHITE_PLASTER, WHITE_PLASTER, 172.0);
    partition(b, 16.4, 18.6, WHITE_PLASTER, BLUE_PLASTER, 168.0);
    b.place(Vec3::Z * FLOOR, 0.0, |b| {
        living_room(b);
        hall(b);
        kitchen(b);
        bedroom(b);
    });
}

/// A wall across the house at `x` with a door around `door`, its leaf open by `degrees`.
fn partition(b: &mut Builder, x: f32, door: f32, west: Material, east: Material, degrees: f32) {
    b.object("partition", class::BUILDING);
    let wall = Wall {
        length: NORTH - SOUTH,
        thickness: 0.2,
        heights: (0.0, CEILING),
        outside: west,
        inside: east,
    };
    let opening = Opening::around(NORTH - door, 0.95, FLOOR, 2.2);
    b.place(Vec3::new(x, NORTH, 0.0), -90.0, |b| {
        wall.build(b, &[opening]);
        b.object("door", class::BUILDING);
        for (x0, x1, z0, z1) in [
            (opening.from - 0.08, opening.from, FLOOR, 2.2),
            (opening.to, opening.to + 0.08, FLOOR, 2.2),
            (opening.from - 0.08, opening.to + 0.08, 2.2, 2.29),
        ] {
            b.block((x0, -0.025, z0), (x1, 0.225, z1), WHITE_PAINT);
        }
        b.place(Vec3::new(opening.from + 0.02, 0.2, FLOOR), degrees, |b| {
            door_leaf(b, 0.9, 2.03, WHITE_PAINT)
        });
    });
}

fn living_room(b: &mut Builder) {
    b.place(Vec3::new(6.9, 20.6, 0.0), 90.0, |b| {
        table(b, (2.1, 0.95, 0.75), OAK);
        tableware(b, 0.75, &[(-0.6, -0.27), (0.55, -0.27), (-0.6, 0.27), (0.55, 0.27)]);
        for x in [-0.6, 0.0, 0.6] {
            b.place(Vec3::new(x, -0.72, 0.0), 0.0, |b| chair(b, WALNUT, RED_CLOTH));
            b.place(Vec3::new(x + 0.03, 0.74, 0.0), 176.0, |b| chair(b, WALNUT, RED_CLOTH));
        }
    });
    b.place(Vec3::new(6.9, 20.6, 0.0), 0.0, |b| pendant(b, CEILING - FLOOR, 1.55, COPPER));
    b.place(Vec3::new(6.9, 20.6, 0.0), 0.0, |b| furniture::rug(b, (1.3, 1.75), 0x7E2F2C, 0x243B57));
    b.place(Vec3::new(0.95, 18.6, 0.0), 90.0, |b| sofa(b, 2.3, BLUE_CLOTH));
    b.place(Vec3::new(2.35, 18.5, 0.0), 90.0, |b| {
        furniture::rug(b, (1.25, 0.85), 0xB4552F, 0x33524B);
        table(b, (1.1, 0.55, 0.42), WALNUT);
        b.block((-0.3, -0.12, 0.42), (0.02, 0.1, 0.45), paint(0x8A3B32));
        b.block((-0.28, -0.1, 0.45), (0.0, 0.09, 0.475), paint(0x365A7A));
        b.turned((0.3, 0.05, 0.42), &[(0.04, 0.0), (0.035, 0.1)], WHITE_PAINT);
    });
    b.place(Vec3::new(2.6, 21.0, 0.0), 200.0, |b| sofa(b, 0.95, MUSTARD_CLOTH));
    b.place(Vec3::new(0.8, 20.4, 0.0), 0.0, |b| stand_lamp(b, 1.6, 0.26));
    b.place(Vec3::new(0.95, 22.7, 0.0), 90.0, |b| fireplace(b, CEILING - FLOOR));
    b.place(Vec3::new(3.7, NORTH - 0.3, 0.0), 0.0, |b| bookshelf(b, (2.8, 0.3, 2.35), 6, 3));
    b.place(Vec3::new(9.05, 23.9, 0.0), -90.0, |b| {
        cabinet(b, (1.9, 0.42, 0.9), 4, WALNUT);
        b.place(Vec3::new(0.3, 0.2, 0.9), 0.0, |b| stand_lamp(b, 0.5, 0.15));
        b.turned(
            (1.1, 0.2, 0.9),
            &[(0.06, 0.0), (0.11, 0.14), (0.05, 0.26), (0.08, 0.3)],
            paint(0xD8D2C4),
        );
    });
    b.place(Vec3::new(9.38, 22.95, 1.75), -90.0, |b| picture(b, 1.3, 0.85));
    b.place(Vec3::new(9.38, 20.2, 1.6), -90.0, |b| picture(b, 0.7, 0.9));
    b.place(Vec3::new(0.47, 18.6, 1.7), 90.0, |b| picture(b, 1.5, 0.8));
}

fn hall(b: &mut Builder) {
    b.object("staircase", class::BUILDING);
    let (steps, rise, run) = (16, 0.181, 0.26);
    for i in 0..steps {
        let (y, z) = (19.9 + run * i as f32, rise * (i + 1) as f32);
        b.block((11.75, y - 0.03, z - 0.04), (12.78, y + run, z), OAK);
        b.block((11.78, y, z - rise), (12.78, y + 0.02, z - 0.04), WHITE_PAINT);
        b.pole((11.8, y + 0.12, z), (11.8, y + 0.12, z + 0.85), 0.014, WHITE_PAINT);
    }
    let rail = |i: f32| Vec3::new(11.8, 19.9 + run * i + 0.12, rise * (i + 1.0) + 0.87);
    b.pole(rail(-0.6), rail(15.0), 0.03, OAK);
    b.turned((11.8, 19.85, 0.0), &[(0.06, 0.0), (0.06, 0.2), (0.045, 0.3), (0.05, 1.0)], OAK);
    b.ball((11.8, 19.85, 1.05), (0.07, 0.07, 0.07), OAK);
    b.place(Vec3::new(11.0, 18.2, 0.0), 90.0, |b| {
        furniture::rug(b, (1.4, 0.5), 0x32564C, 0xA8402F)
    });
    b.place(Vec3::new(9.62, 21.0, 0.0), 90.0, |b| {
        b.place(Vec3::new(0.0, -0.36, 0.0), 0.0, |b| cabinet(b, (1.2, 0.36, 0.85), 2, PALE_WOOD));
        b.object("mirror", class::UNCLASSIFIED);
        b.block((0.3, -0.02, 1.1), (0.9, 0.0, 1.95), STEEL);
        b.block((0.24, -0.03, 1.04), (0.96, -0.001, 1.1), BRASS);
        b.block((0.24, -0.03, 1.95), (0.96, -0.001, 2.01), BRASS);
    });
    b.object("coat rack", class::UNCLASSIFIED);
    b.block((9.6, 22.9, 1.7), (9.63, 24.2, 1.82), OAK);
    for (i, cloth) in [BLUE_CLOTH, MUSTARD_CLOTH, RED_CLOTH, LINEN].into_iter().enumerate() {
        let y = 23.05 + 0.33 * i as f32;
        b.pole((9.63, y, 1.74), (9.74, y, 1.78), 0.01, BRASS);
        b.ball((9.74, y, 1.25), (0.09, 0.15, 0.5), cloth);
    }
    b.place(Vec3::new(11.0, 20.0, 0.0), 0.0, |b| pendant(b, CEILING - FLOOR, 2.3, BRASS));
}

fn kitchen(b: &mut Builder) {
    let front = Material::Paint { color: rgb(0xC9D3C4) };
    // Along the east wall, then along the north.
    b.place(Vec3::new(15.78, 24.5, 0.0), -90.0, |b| {
        cabinet(b, (4.6, 0.6, 0.88), 8, front);
        b.object("counter", class::UNCLASSIFIED);
        b.block((-0.02, -0.03, 0.88), (4.62, 0.61, 0.92), OAK);
        b.place(Vec3::new(0.0, 0.26, 1.45), 0.0, |b| cabinet(b, (1.5, 0.34, 0.75), 3, front));
        b.place(Vec3::new(2.7, 0.26, 1.45), 0.0, |b| cabinet(b, (1.9, 0.34, 0.75), 4, front));
        stove(b);
        b.object("sink", class::UNCLASSIFIED);
        b.block((3.3, 0.1, 0.921), (3.9, 0.5, 0.928), STEEL);
        b.pole((3.6, 0.53, 0.92), (3.6, 0.53, 1.2), 0.015, STEEL);
        b.pole((3.6, 0.53, 1.2), (3.6, 0.33, 1.22), 0.012, STEEL);
        b.object("wall tiles", class::BUILDING);
        let tiles = Material::Masonry {
            color: rgb(0xE9EEF0),
            mortar: rgb(0xB9BDBD),
            size: (0.2, 0.1).into(),
            joint: 0.006,
            variation: 0.05,
        };
        b.block((0.0, 0.6, 0.92), (4.6, 0.615, 1.45), tiles);
        for (x, hex) in [(0.25, 0xB5482F), (0.45, 0xD8C9A5), (0.62, 0x3F6B57)] {
            b.object("jar", class::UNCLASSIFIED);
            b.turned(
                (x, 0.45, 0.92),
                &[(0.07, 0.0), (0.075, 0.17), (0.05, 0.19), (0.05, 0.22)],
                paint(hex),
            );
        }
    });
    b.object("fridge", class::UNCLASSIFIED);
    b.block((13.05, 23.85, 0.03), (13.7, 24.52, 1.85), paint(0xDDE3E4));
    b.block((13.1, 23.81, 0.05), (13.65, 23.85, 1.15), paint(0xE6EAEA));
    b.block((13.1, 23.81, 1.17), (13.65, 23.85, 1.83), paint(0xE6EAEA));
    b.pole((13.16, 23.78, 1.3), (13.16, 23.78, 1.65), 0.012, STEEL);
    b.place(Vec3::new(14.2, 22.4, 0.0), 0.0, |b| {
        table(b, (1.2, 0.8, 0.76), PALE_WOOD);
        tableware(b, 0.76, &[(-0.35, -0.2)]);
        for (x, y, turn) in [(-0.25, -0.62, 5.0), (0.35, -0.6, -8.0), (0.0, 0.66, 180.0)] {
            b.place(Vec3::new(x, y, 0.0), turn, |b| chair(b, PALE_WOOD, TEAL_PAINT));
        }
    });
    b.place(Vec3::new(14.2, 22.4, 0.0), 0.0, |b| pendant(b, CEILING - FLOOR, 1.6, TEAL_PAINT));
    b.place(Vec3::new(13.02, 19.2, 0.0), 90.0, |b| {
        b.place(Vec3::new(0.0, -0.4, 0.0), 0.0, |b| cabinet(b, (1.3, 0.4, 0.95), 3, PALE_WOOD));
        b.object("plates", class::UNCLASSIFIED);
        for (z, n) in [(1.3, 4), (1.65, 4)] {
            b.block((0.0, -0.22, z), (1.3, 0.0, z + 0.025), OAK);
            for i in 0..n {
                let x = 0.18 + 0.3 * i as f32;
                b.cone((x, -0.05, z + 0.15), (x, -0.075, z + 0.15), (0.11, 0.12), WHITE_PAINT);
            }
        }
    });
}

fn stove(b: &mut Builder) {
    b.object("stove", class::UNCLASSIFIED);
    b.block((1.75, -0.035, 0.1), (2.4, -0.001, 0.86), BLACK_IRON);
    b.block((1.75, 0.03, 0.921), (2.4, 0.55, 0.935), BLACK_IRON);
    b.pole((1.82, -0.06, 0.75), (2.33, -0.06, 0.75), 0.01, STEEL);
    b.turned((1.92, 0.18, 0.935), &[(0.11, 0.0), (0.11, 0.13), (0.115, 0.135)], COPPER);
    b.turned((2.22, 0.38, 0.935), &[(0.09, 0.0), (0.09, 0.17), (0.02, 0.2)], STEEL);
    b.prism((0.1, 0.58), &[(1.7, 1.7), (2.45, 1.7), (2.22, 2.05), (1.93, 2.05)], STEEL);
    b.block((1.93, 0.3, 2.05), (2.22, 0.58, CEILING - FLOOR), STEEL);
}

fn bedroom(b: &mut Builder) {
    b.place(Vec3::new(20.45, 21.2, 0.0), -90.0, bed);
    for y in [19.9, 22.5] {
        b.place(Vec3::new(21.1, y + 0.22, 0.0), -90.0, |b| {
            cabinet(b, (0.45, 0.4, 0.5), 1, OAK);
            b.place(Vec3::new(0.22, 0.2, 0.5), 0.0, |b| stand_lamp(b, 0.42, 0.13));
        });
    }
    b.place(Vec3::new(17.0, NORTH - 0.62, 0.0), 0.0, |b| cabinet(b, (2.1, 0.6, 2.2), 4, WALNUT));
    b.place(Vec3::new(18.6, 21.2, 0.0), 90.0, |b| {
        furniture::rug(b, (1.1, 0.75), 0x35506E, 0xC7A469)
    });
    b.place(Vec3::new(19.15, 16.95, 0.0), 180.0, |b| {
        table(b, (1.3, 0.6, 0.74), OAK);
        b.place(Vec3::new(-0.45, 0.0, 0.74), 0.0, |b| stand_lamp(b, 0.45, 0.12));
        b.block((0.0, -0.14, 0.74), (0.3, 0.08, 0.765), paint(0xE8E2D0));
        b.place(Vec3::new(0.1, -0.6, 0.0), 8.0, |b| chair(b, OAK, BLUE_CLOTH));
    });
    b.place(Vec3::new(21.53, 21.2, 1.75), -90.0, |b| picture(b, 1.1, 0.7));
    b.place(Vec3::new(16.62, 21.8, 1.65), 90.0, |b| picture(b, 0.8, 1.0));
    b.place(Vec3::new(16.85, 20.3, 0.0), 90.0, |b| cabinet(b, (1.1, 0.24, 0.95), 3, PALE_WOOD));
    b.place(Vec3::new(18.9, 21.0, 0.0), 0.0, |b| pendant(b, CEILING - FLOOR, 2.25, LINEN));
}
