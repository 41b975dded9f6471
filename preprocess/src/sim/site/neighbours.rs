//! The houses left and right of the courtyard, along the street.

use glam::Vec3;

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::{
        facade::{Opening, Wall, Window, door_leaf, net_curtain},
        palette::*,
        roof::Roof,
    },
};

/// A house whose front looks to -y along x from 0.
struct TownHouse {
    length: f32,
    depth: f32,
    storeys: usize,
    wall: Material,
    base: Material,
    shutters: Option<Material>,
    door: f32,
    windows: &'static [f32],
    ridge: f32,
    tiled: bool,
}

const STOREY: f32 = 3.1;

impl TownHouse {
    fn plate(&self) -> f32 {
        0.5 + STOREY * self.storeys as f32
    }

    /// Builds all but the side walls, which `sides` may add within `0.4` of either end.
    fn build(&self, b: &mut Builder) {
        b.object("town house", class::BUILDING);
        let plate = self.plate();
        let wall = Wall {
            length: self.length,
            thickness: 0.4,
            heights: (-0.3, plate),
            outside: self.wall,
            inside: WHITE_PLASTER,
        };
        let mut windows = Vec::new();
        for storey in 0..self.storeys {
            let sill = 1.25 + STOREY * storey as f32;
            windows.extend(
                self.windows
                    .iter()
                    .filter(|&&x| storey > 0 || (x - self.door).abs() > 0.9)
                    .map(|&x| Opening::around(x, 1.05, sill, sill + 1.55)),
            );
        }
        let door = Opening::around(self.door, 1.05, 0.15, 2.6);
        wall.build(b, &[&windows[..], &[door]].concat());
        let window = Window { shutters: self.shutters, ..Window::PLAIN };
        for &o in &windows {
            window.build(b, o);
            net_curtain(b, o);
        }
        b.place(Vec3::new(door.from + 0.02, 0.22, 0.15), 0.0, |b| door_leaf(b, 1.01, 2.42, WALNUT));
        b.object("town house", class::BUILDING);
        b.block((door.from - 0.2, -0.35, -0.2), (door.to + 0.2, 0.2, 0.15), GRANITE);
        b.block((door.from - 0.16, -0.05, 0.15), (door.from, 0.0, 2.6), SANDSTONE);
        b.block((door.to, -0.05, 0.15), (door.to + 0.16, 0.0, 2.6), SANDSTONE);
        b.block((door.from - 0.22, -0.12, 2.6), (door.to + 0.22, 0.0, 2.8), SANDSTONE);
        b.block((-0.0, -0.045, -0.2), (door.from - 0.2, 0.0, 0.7), self.base);
        b.block((door.to + 0.2, -0.045, -0.2), (self.length, 0.0, 0.7), self.base);
        for storey in 1..self.storeys {
            let z = 0.45 + STOREY * storey as f32;
            b.block((0.0, -0.05, z), (self.length, 0.0, z + 0.14), SANDSTONE);
        }
        b.block((0.0, -0.2, plate - 0.5), (self.length, 0.0, plate - 0.3), SANDSTONE);
        Roof {
            length: self.length,
            depth: self.depth,
            heights: (plate, self.ridge),
            tiled: [self.tiled, false],
            gable: self.wall,
        }
        .build(b);
    }

    /// The solid behind the front, between `from` and `to`.
    fn core(&self, b: &mut Builder, from: f32, to: f32) {
        b.object("town house", class::BUILDING);
        b.block((from, 0.4, -0.3), (to, self.depth, self.plate()), self.wall);
    }

    fn roof(&self) -> Roof {
        Roof {
            length: self.length,
            depth: self.depth,
            heights: (self.plate(), self.ridge),
            tiled: [false; 2],
            gable: self.wall,
        }
    }
}

pub fn build(b: &mut Builder) {
    west(b);
    east(b);
}

fn west(b: &mut Builder) {
    let near = TownHouse {
        length: 12.0,
        depth: 10.6,
        storeys: 2,
        wall: Material::Plaster { color: rgb(0xDDA48C), stains: 0.6 },
        base: ASHLAR,
        shutters: Some(GREEN_PAINT),
        door: 6.0,
        windows: &[1.8, 3.9, 6.0, 8.1, 10.2],
        ridge: 10.0,
        tiled: true,
    };
    b.place(Vec3::new(-12.0, -0.4, 0.0), 0.0, |b| {
        near.build(b);
        near.core(b, 0.0, near.length - 0.4);
        near.roof().chimney(b, 3.0, 1.0);
        near.roof().dormer(b, 6.0, 1.0, WHITE_PLASTER);
        // The side that looks into the courtyard.
        b.object("town house", class::BUILDING);
        let side = Wall {
            length: near.depth - 0.4,
            thickness: 0.4,
            heights: (-0.3, near.plate()),
            outside: near.wall,
            inside: near.wall,
        };
        let windows = [2.6, 5.4].map(|x| Opening::around(x, 0.95, 4.3, 5.7));
        b.place(Vec3::new(near.length, 0.4, 0.0), 90.0, |b| {
            side.build(b, &windows);
            for o in windows {
                Window { shutters: Some(GREEN_PAINT), ..Window::PLAIN }.build(b, o);
                net_curtain(b, o);
            }
        });
    });
    b.object("boundary wall", class::BUILDING);
    b.block((-0.4, 10.2, -0.3), (0.0, 16.0, 2.9), RUBBLE);
    b.block((-0.46, 10.2, 2.9), (0.06, 16.0, 2.99), GRANITE);
    let far = TownHouse {
        length: 9.0,
        depth: 10.6,
        storeys: 3,
        wall: BRICK,
        base: GRANITE,
        shutters: None,
        door: 7.4,
        windows: &[1.6, 4.5, 7.4],
        ridge: 13.4,
        tiled: false,
    };
    b.place(Vec3::new(-21.0, -0.4, 0.0), 0.0, |b| {
        far.build(b);
        far.core(b, 0.0, far.length);
        far.roof().chimney(b, 6.8, 0.8);
        far.roof().chimney(b, 2.0, 0.8);
    });
}

fn east(b: &mut Builder) {
    let near = TownHouse {
        length: 10.5,
        depth: 13.0,
        storeys: 2,
        wall: Material::Plaster { color: rgb(0xE9E4D6), stains: 0.45 },
        base: RUBBLE,
        shutters: Some(paint(0x7C4A3A)),
        door: 2.0,
        windows: &[2.0, 4.4, 6.8, 9.0],
        ridge: 10.6,
        tiled: true,
    };
    b.place(Vec3::new(25.9, -0.4, 0.0), 0.0, |b| {
        near.build(b);
        near.core(b, 0.0, near.length);
        near.roof().chimney(b, 7.4, 1.2);
        near.roof().dormer(b, 3.2, 1.2, WHITE_PLASTER);
        near.roof().dormer(b, 6.2, 1.2, WHITE_PLASTER);
        // Blind windows on the side towards the terrace.
        for y in [4.0, 8.2] {
            b.place(Vec3::new(0.0, y, 0.0), -90.0, |b| {
                let o = Opening::around(0.0, 0.9, 4.5, 5.8);
                b.object("blind window", class::BUILDING);
                b.block((o.from, -0.02, o.sill), (o.to, 0.0, o.head), paint(0xC9BFAE));
                for (x0, x1, z0, z1) in [
                    (o.from - 0.13, o.from, o.sill, o.head),
                    (o.to, o.to + 0.13, o.sill, o.head),
                    (o.from - 0.13, o.to + 0.13, o.head, o.head + 0.15),
                    (o.from - 0.18, o.to + 0.18, o.sill - 0.09, o.sill),
                ] {
                    b.block((x0, -0.05, z0), (x1, 0.0, z1), SANDSTONE);
                }
            });
        }
    });
}
