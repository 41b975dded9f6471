//! The arcade on the courtyard's east side, and the terrace on top of it.

use glam::{Vec2, Vec3};

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    shape::{Arch, Frame, Shape},
    site::{
        facade::{Opening, Wall, Window, door_leaf},
        furniture,
        palette::*,
    },
};

/// Height of the terrace.
pub const TERRACE: f32 = 3.65;
/// Middle of the row of columns, and the inside of the rear wall.
const FRONT: f32 = 22.3;
const REAR: f32 = 25.5;
const SPRINGING: f32 = 1.95;
const BAYS: usize = 5;
const BAY: f32 = 3.12;

pub fn build(b: &mut Builder) {
    b.object("arcade", class::BUILDING);
    let flags = Material::Checker { color: rgb(0xC9BFA9), second: rgb(0x8D8375), size: 0.45 };
    b.block((FRONT - 0.42, 0.0, -0.2), (REAR, 16.0, 0.15), flags);
    front(b);
    rear(b);
    terrace(b);
    b.room(Vec3::new(FRONT - 0.2, 0.0, 0.0), Vec3::new(REAR, 16.0, 3.4), 1.35);
}

fn front(b: &mut Builder) {
    let first = 0.4;
    let quarter = glam::Mat3::from_rotation_z(std::f32::consts::FRAC_PI_2);
    let (west, east) = (b.surface(ASHLAR), b.surface(ASHLAR));
    for bay in 0..BAYS {
        let middle = Vec3::new(FRONT, first + (bay as f32 + 0.5) * BAY, SPRINGING);
        let arch = Shape::Arch(Arch {
            frame: Frame::turned(middle, quarter),
            half_width: 0.5 * BAY,
            height: 3.4 - SPRINGING,
            half_depth: 0.24,
            radius: 1.27,
        });
        let [side, other, under, over, vault] = [(); 5].map(|()| b.surface(ASHLAR));
        // Turned by a quarter, the block's -y face looks east.
        b.add_faces(arch, &[side, other, east, west, under, over, vault]);
        // Keystone.
        b.block(
            (FRONT - 0.3, middle.y - 0.12, 3.1),
            (FRONT - 0.2, middle.y + 0.12, 3.4),
            SANDSTONE,
        );
    }
    for i in 0..=BAYS {
        column(b, Vec3::new(FRONT, first + i as f32 * BAY, 0.15));
    }
    b.block((FRONT - 0.24, 0.0, 0.15), (FRONT + 0.24, 0.12, 3.4), ASHLAR);
    b.object("arcade", class::BUILDING);
    for i in 0..20 {
        let y = 0.35 + 0.8 * i as f32;
        b.block((FRONT + 0.24, y, 3.2), (REAR, y + 0.14, 3.4), DARK_BEAM);
    }
}

fn column(b: &mut Builder, foot: Vec3) {
    b.object("column", class::BUILDING);
    let h = SPRINGING - foot.z;
    b.block(foot + Vec3::new(-0.27, -0.27, 0.0), foot + Vec3::new(0.27, 0.27, 0.12), SANDSTONE);
    b.turned(
        foot,
        &[
            (0.26, 0.12),
            (0.25, 0.2),
            (0.2, 0.24),
            (0.205, 0.3),
            (0.165, h - 0.36),
            (0.2, h - 0.33),
            (0.175, h - 0.28),
            (0.27, h - 0.12),
        ],
        SANDSTONE,
    );
    b.block(foot + Vec3::new(-0.28, -0.28, h - 0.12), foot + Vec3::new(0.28, 0.28, h), SANDSTONE);
}

fn rear(b: &mut Builder) {
    b.object("arcade", class::BUILDING);
    let wall = Wall {
        length: 16.0,
        thickness: 0.4,
        heights: (-0.2, TERRACE),
        outside: Material::Plaster { color: rgb(0xE9D9BC), stains: 0.3 },
        inside: RUBBLE,
    };
    let doors = [3.6, 12.4].map(|y| Opening::around(y, 1.1, 0.15, 2.25));
    let window = Opening::around(8.0, 1.0, 1.05, 2.2);
    // Its outside is what the arcade shows: it looks west.
    b.place(Vec3::new(REAR, 16.0, 0.0), -90.0, |b| {
        let turned = |o: Opening| Opening { from: 16.0 - o.to, to: 16.0 - o.from, ..o };
        let (doors, window) = (doors.map(turned), turned(window));
        wall.build(b, &[doors[0], doors[1], window]);
        Window { frame: GREEN_PAINT, ..Window::PLAIN }.build(b, window);
        for door in doors {
            b.place(Vec3::new(door.from, 0.2, 0.15), 0.0, |b| door_leaf(b, 1.1, 2.1, GREEN_PAINT));
            b.object("arcade", class::BUILDING);
            b.block((door.from - 0.12, -0.03, 0.15), (door.from, 0.0, 2.25), SANDSTONE);
            b.block((door.to, -0.03, 0.15), (door.to + 0.12, 0.0, 2.25), SANDSTONE);
            b.block((door.from - 0.12, -0.03, 2.25), (door.to + 0.12, 0.0, 2.4), SANDSTONE);
        }
    });
    for y in [5.7, 10.4] {
        b.place(Vec3::new(REAR - 0.3, y, 0.15), 90.0, |b| {
            b.object("arcade bench", class::UNCLASSIFIED);
            b.block((-0.9, -0.2, 0.38), (0.9, 0.2, 0.45), SANDSTONE);
            b.block((-0.75, -0.16, 0.0), (-0.55, 0.16, 0.38), SANDSTONE);
            b.block((0.55, -0.16, 0.0), (0.75, 0.16, 0.38), SANDSTONE);
        });
    }
    for i in 0..BAYS {
        let y = 0.4 + (i as f32 + 0.5) * BAY;
        b.object("lantern", class::UNCLASSIFIED);
        b.pole((23.9, y, 2.75), (23.9, y, 3.4), 0.008, BLACK_IRON);
        b.turned((23.9, y, 2.4), &[(0.07, 0.0), (0.12, 0.28), (0.02, 0.36)], paint(0xF3E6B8));
    }
}

fn terrace(b: &mut Builder) {
    b.object("terrace", class::BUILDING);
    let tiles = Material::Flags { color: rgb(0xC98F6B), size: Vec2::new(0.3, 0.3), bond: 0.0 };
    b.block((FRONT - 0.36, -0.05, 3.4), (REAR + 0.4, 16.0, 3.55), SANDSTONE);
    b.block((FRONT - 0.24, 0.0, 3.55), (REAR + 0.4, 16.0, TERRACE), tiles);
    let (x, foot) = (FRONT - 0.08, TERRACE);
    // The stairs arrive between the first pillar and the second.
    for (y0, y1) in [(2.15, 15.95)] {
        b.block((x - 0.13, y0, foot), (x + 0.13, y1, foot + 0.12), SANDSTONE);
        b.block((x - 0.15, y0, foot + 0.82), (x + 0.15, y1, foot + 0.95), SANDSTONE);
        let count = ((y1 - y0) / 0.23) as usize;
        for i in 0..count {
            let y = y0 + (i as f32 + 0.5) * (y1 - y0) / count as f32;
            if i % 12 == 0 {
                b.block(
                    (x - 0.14, y - 0.1, foot + 0.12),
                    (x + 0.14, y + 0.1, foot + 0.82),
                    SANDSTONE,
                );
            } else {
                b.turned(
                    (x, y, foot + 0.12),
                    &[(0.06, 0.0), (0.035, 0.08), (0.075, 0.24), (0.03, 0.55), (0.055, 0.7)],
                    SANDSTONE,
                );
            }
        }
    }
    b.block((x - 0.15, -0.05, foot), (REAR + 0.4, 0.25, foot + 0.95), ASHLAR);
    b.block((x - 0.19, -0.09, foot + 0.95), (REAR + 0.4, 0.29, foot + 1.03), SANDSTONE);
    b.place(Vec3::new(24.2, 12.6, TERRACE), 30.0, |b| {
        furniture::table(b, (1.5, 0.85, 0.74), OAK);
        for (dx, dy, degrees) in
            [(-0.35, -0.62, 0.0), (0.4, -0.62, 0.0), (-0.35, 0.62, 180.0), (0.4, 0.66, 170.0)]
        {
            b.place(Vec3::new(dx, dy, 0.0), degrees, |b| furniture::chair(b, OAK, LINEN));
        }
    });
    b.place(Vec3::new(24.6, 4.6, TERRACE), 100.0, lounger);
}

fn lounger(b: &mut Builder) {
    b.object("lounger", class::UNCLASSIFIED);
    let stripes = Material::Fabric { color: rgb(0xF1EADB), second: rgb(0x3F77A6), stripe: 0.12 };
    b.block((-0.9, -0.32, 0.28), (0.5, 0.32, 0.36), stripes);
    b.place_turned(Vec3::new(0.5, 0.0, 0.3), glam::Mat3::from_rotation_y(-0.8), |b| {
        b.block((0.0, -0.32, 0.0), (0.75, 0.32, 0.08), stripes);
    });
    for (x, y) in [(-0.85, -0.3), (-0.85, 0.26), (0.45, -0.3), (0.45, 0.26)] {
        b.block((x, y, 0.0), (x + 0.05, y + 0.05, 0.28), PALE_WOOD);
    }
}
