//! The house: walls, windows, floors and roof. What is in it: see `interior`.

use glam::{Vec2, Vec3};

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::{
        facade::{Opening, Wall, Window, curtains, door_leaf, net_curtain},
        palette::*,
        roof::Roof,
    },
};

/// South-west corner, length and depth on the outside.
const CORNER: Vec3 = Vec3::new(0.0, 16.0, 0.0);
const LENGTH: f32 = 22.0;
const DEPTH: f32 = 9.0;
const THICK: f32 = 0.45;
const PLATE: f32 = 6.2;
const RIDGE: f32 = 10.1;
/// Level of the ground floor and of its ceiling.
pub const FLOOR: f32 = 0.15;
pub const CEILING: f32 = 3.05;

/// Middles of the windows of the south front; the door is between the third and the fourth.
const BAYS: [f32; 6] = [2.1, 4.9, 7.7, 14.7, 17.9, 20.4];
const DOOR: Opening = Opening { from: 10.4, to: 12.0, sill: FLOOR, head: 2.65 };
/// Windows of the north front, by x.
const REAR_BAYS: [f32; 3] = [2.9, 7.2, 19.6];

pub fn build(b: &mut Builder) {
    b.place(CORNER, 0.0, |b| {
        south(b);
        sides(b);
        floors(b);
        trim(b);
        let roof = Roof {
            length: LENGTH,
            depth: DEPTH,
            heights: (PLATE, RIDGE),
            tiled: [true, false],
            gable: OCHRE_PLASTER,
        };
        roof.build(b);
        roof.chimney(b, 5.2, 0.9);
        roof.chimney(b, 15.6, 0.6);
        roof.dormer(b, 7.9, 1.1, OCHRE_PLASTER);
        roof.dormer(b, 13.3, 1.1, OCHRE_PLASTER);
    });
}

fn wall(length: f32) -> Wall {
    Wall {
        length,
        thickness: THICK,
        heights: (-0.2, PLATE),
        outside: OCHRE_PLASTER,
        inside: WHITE_PLASTER,
    }
}

fn south(b: &mut Builder) {
    b.object("house wall", class::BUILDING);
    let lower = BAYS.map(|x| Opening::around(x, 1.15, 1.0, 2.5));
    let upper = BAYS.map(|x| Opening::around(x, 1.15, 4.2, 5.55));
    let over_door = Opening { from: DOOR.from, to: DOOR.to, sill: 4.2, head: 5.55 };
    let openings = [&lower[..], &upper[..], &[DOOR, over_door]].concat();
    wall(LENGTH).build(b, &openings);
    let open = Window { glazed: false, shutters: Some(TEAL_PAINT), ..Window::PLAIN };
    for o in lower {
        open.build(b, o);
        curtains(b, o, THICK, (o.from > 16.0).then_some(BLUE_CLOTH));
    }
    let closed = Window { shutters: Some(TEAL_PAINT), ..Window::PLAIN };
    for o in upper {
        closed.build(b, o);
        net_curtain(b, o);
    }
    Window::PLAIN.build(b, over_door);
    net_curtain(b, over_door);
    entrance(b);
}

fn entrance(b: &mut Builder) {
    b.object("entrance", class::BUILDING);
    let (x0, x1) = (DOOR.from, DOOR.to);
    b.block((x0 - 0.28, -0.07, 0.0), (x0, 0.0, DOOR.head), SANDSTONE);
    b.block((x1, -0.07, 0.0), (x1 + 0.28, 0.0, DOOR.head), SANDSTONE);
    b.block((x0 - 0.34, -0.1, DOOR.head), (x1 + 0.34, 0.0, DOOR.head + 0.26), SANDSTONE);
    b.place(Vec3::new(0.5 * (x0 + x1), 0.0, DOOR.head + 0.26), 0.0, |b| {
        b.prism((-0.16, 0.0), &[(-1.2, 0.0), (1.2, 0.0), (0.0, 0.42)], SANDSTONE);
    });
    b.block((x0 - 0.5, -0.75, -0.1), (x1 + 0.5, 0.0, 0.075), GRANITE);
    b.block((x0 - 0.3, -0.4, 0.075), (x1 + 0.3, 0.0, FLOOR), GRANITE);
    b.place(Vec3::new(x0 + 0.03, THICK - 0.05, FLOOR), 84.0, |b| {
        door_leaf(b, 0.8, 2.48, GREEN_PAINT)
    });
    b.place(Vec3::new(x1 - 0.03, THICK - 0.05, FLOOR), 175.0, |b| {
        door_leaf(b, 0.8, 2.48, GREEN_PAINT)
    });
    for x in [x0 - 0.62, x1 + 0.62] {
        b.object("lantern", class::UNCLASSIFIED);
        b.pole((x, 0.0, 2.3), (x, -0.22, 2.3), 0.014, BLACK_IRON);
        b.turned(
            (x, -0.22, 1.95),
            &[(0.05, 0.0), (0.1, 0.22), (0.12, 0.24), (0.02, 0.34)],
            paint(0xEFE2B5),
        );
    }
}

fn sides(b: &mut Builder) {
    b.object("house wall", class::BUILDING);
    let rear: Vec<Opening> =
        REAR_BAYS.iter().map(|x| Opening::around(LENGTH - x, 1.15, 1.0, 2.5)).collect();
    b.place(Vec3::new(LENGTH, DEPTH, 0.0), 180.0, |b| {
        wall(LENGTH).build(b, &rear);
        for &o in &rear {
            Window { glazed: false, ..Window::PLAIN }.build(b, o);
        }
    });
    b.object("house wall", class::BUILDING);
    let inner = DEPTH - 2.0 * THICK;
    b.place(Vec3::new(0.0, DEPTH - THICK, 0.0), -90.0, |b| wall(inner).build(b, &[]));
    let terrace_window = Opening::around(3.2, 1.15, 4.2, 5.55);
    b.place(Vec3::new(LENGTH, THICK, 0.0), 90.0, |b| {
        wall(inner).build(b, &[terrace_window]);
        Window { shutters: Some(TEAL_PAINT), ..Window::PLAIN }.build(b, terrace_window);
        net_curtain(b, terrace_window);
    });
}

fn floors(b: &mut Builder) {
    b.object("floor", class::BUILDING);
    let oak = Material::Boards { color: rgb(0xB98A57), width: 0.14, length: 1.7 };
    let pine = Material::Boards { color: rgb(0xD3B07C), width: 0.2, length: 2.6 };
    let tiles = Material::Checker { color: rgb(0xEEE9DE), second: rgb(0x3D4548), size: 0.33 };
    let flags = Material::Flags { color: rgb(0xC4A07A), size: Vec2::new(0.4, 0.4), bond: 0.5 };
    for (x0, x1, material) in
        [(0.4, 9.5, oak), (9.5, 12.9, flags), (12.9, 16.5, tiles), (16.5, 21.6, pine)]
    {
        b.block((x0, THICK - 0.05, -0.2), (x1, DEPTH - THICK + 0.05, FLOOR), material);
    }
    b.object("ceiling", class::BUILDING);
    b.block((0.3, 0.3, CEILING), (LENGTH - 0.3, DEPTH - 0.3, 3.4), WHITE_PLASTER);
    b.block((0.3, 0.3, 6.05), (LENGTH - 0.3, DEPTH - 0.3, 6.18), WHITE_PLASTER);
    b.object("beam", class::BUILDING);
    for i in 0..7 {
        let x = 1.3 + 1.15 * i as f32;
        b.block((x, THICK, CEILING - 0.18), (x + 0.16, DEPTH - THICK, CEILING), DARK_BEAM);
    }
}

/// Plinth, corner stones, string course and cornice.
fn trim(b: &mut Builder) {
    b.object("house trim", class::BUILDING);
    b.block((-0.05, -0.05, 0.0), (DOOR.from - 0.5, 0.0, 0.62), ASHLAR);
    b.block((DOOR.to + 0.5, -0.05, 0.0), (LENGTH, 0.0, 0.62), ASHLAR);
    b.block((-0.03, -0.06, 3.28), (LENGTH, 0.0, 3.46), SANDSTONE);
    b.block((-0.03, -0.16, PLATE - 0.42), (LENGTH + 0.03, 0.0, PLATE - 0.26), SANDSTONE);
    for i in 0..16 {
        let z = 0.62 + 0.33 * i as f32;
        let w = if i % 2 == 0 { 0.62 } else { 0.4 };
        if !(3.0..3.5).contains(&z) && z < 5.6 {
            b.block((-0.035, -0.035, z + 0.01), (w, 0.0, z + 0.32), SANDSTONE);
            b.block((LENGTH - w, -0.035, z + 0.01), (LENGTH + 0.035, 0.0, z + 0.32), SANDSTONE);
        }
    }
}
