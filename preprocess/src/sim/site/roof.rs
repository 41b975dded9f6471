//! Pitched roofs, tile by tile, with gutters, chimneys and dormers.

use glam::{Mat3, Vec3};

use crate::sim::{
    material::{Material, rgb},
    scene::Builder,
    site::palette::*,
};

/// A roof with its ridge along x over the rectangle (0, 0)..(`length`, `depth`), gables at both ends.
#[derive(Debug, Clone, Copy)]
pub struct Roof {
    pub length: f32,
    pub depth: f32,
    /// Height of the wall plate and of the ridge.
    pub heights: (f32, f32),
    /// Lay real cover tiles, not a flat pattern, on the slopes towards -y and +y.
    pub tiled: [bool; 2],
    pub gable: Material,
}

const OVERHANG: f32 = 0.5;
const VERGE: f32 = 0.25;

impl Roof {
    /// Rise over run.
    fn slope(&self) -> f32 {
        (self.heights.1 - self.heights.0) / (0.5 * self.depth)
    }

    pub fn build(&self, b: &mut Builder) {
        b.object("roof", class::BUILDING);
        let pitch = self.slope().atan();
        let eaves = self.heights.0 - OVERHANG * self.slope();
        let rafter = (0.5 * self.depth + OVERHANG) / pitch.cos();
        for (side, degrees) in [(0.0, 0.0), (self.depth, 180.0f32)] {
            let (x, y) = if degrees > 0.0 {
                (self.length + VERGE, side + OVERHANG)
            } else {
                (-VERGE, -OVERHANG)
            };
            let tiled = self.tiled[usize::from(degrees > 0.0)];
            b.place(Vec3::new(x, y, eaves + 0.14), degrees, |b| {
                let width = self.length + 2.0 * VERGE;
                b.place_turned(Vec3::ZERO, Mat3::from_rotation_x(pitch), |b| {
                    slope(b, width, rafter, tiled)
                });
                b.object("gutter", class::BUILDING);
                b.pole((0.0, -0.06, -0.03), (width, -0.06, -0.03), 0.065, COPPER);
                for px in [VERGE + 0.25, width - VERGE - 0.25] {
                    b.pole((px, -0.06, -0.05), (px, OVERHANG - 0.1, -0.5), 0.045, COPPER);
                    b.pole(
                        (px, OVERHANG - 0.1, -0.5),
                        (px, OVERHANG - 0.1, 0.1 - eaves),
                        0.045,
                        COPPER,
                    );
                }
                b.object("roof", class::BUILDING);
            });
        }
        let ridge = self.heights.1 + 0.2;
        b.pole(
            (-VERGE, 0.5 * self.depth, ridge - 0.06),
            (self.length + VERGE, 0.5 * self.depth, ridge - 0.06),
            0.13,
            TERRACOTTA,
        );
        b.object("gable", class::BUILDING);
        for x in [(0.0, 0.45), (self.length - 0.45, self.length)] {
            b.place(Vec3::ZERO, 90.0, |b| {
                let (plate, top) = self.heights;
                b.prism(
                    (-x.1, -x.0),
                    &[(0.0, plate), (self.depth, plate), (0.5 * self.depth, top)],
                    self.gable,
                );
            });
        }
    }

    /// A chimney at `x` on the slope towards -y, `up` metres below the ridge.
    pub fn chimney(&self, b: &mut Builder, x: f32, down: f32) {
        b.object("chimney", class::BUILDING);
        let (y, top) = (0.5 * self.depth - down, self.heights.1 + 1.1);
        b.block((x - 0.5, y - 0.35, top - 2.4), (x + 0.5, y + 0.35, top), BRICK);
        b.block((x - 0.58, y - 0.43, top), (x + 0.58, y + 0.43, top + 0.12), SANDSTONE);
        for dx in [-0.25, 0.25] {
            b.turned(
                (x + dx, y, top + 0.12),
                &[(0.13, 0.0), (0.1, 0.35), (0.13, 0.38), (0.12, 0.44)],
                TERRACOTTA,
            );
        }
    }

    /// A dormer around `x` on the slope towards -y, its front `back` metres behind the wall.
    pub fn dormer(&self, b: &mut Builder, x: f32, back: f32, wall: Material) {
        b.object("dormer", class::BUILDING);
        let foot = self.heights.0 + back * self.slope();
        let (half, eaves, top) = (0.72, foot + 1.3, foot + 1.95);
        b.place(Vec3::new(x, 0.0, 0.0), 0.0, |b| {
            let corners = [
                (-half, foot - 0.3),
                (half, foot - 0.3),
                (half, eaves),
                (0.0, top),
                (-half, eaves),
            ];
            b.prism((back, back + 2.6), &corners, wall);
            b.block(
                (-0.42, back - 0.01, foot + 0.35),
                (0.42, back + 0.01, foot + 1.3),
                Material::Glass,
            );
            for (x0, x1, z0, z1) in [
                (-0.5, -0.42, 0.27, 1.38),
                (0.42, 0.5, 0.27, 1.38),
                (-0.42, 0.42, 0.27, 0.35),
                (-0.42, 0.42, 1.3, 1.38),
                (-0.025, 0.025, 0.35, 1.3),
                (-0.42, 0.42, 0.95, 0.99),
            ] {
                b.block((x0, back - 0.04, foot + z0), (x1, back + 0.02, foot + z1), WHITE_PAINT);
            }
            let pitch = ((top - eaves) / half).atan();
            for side in [-1.0f32, 1.0] {
                let turn = Mat3::from_rotation_y(side * pitch);
                b.place_turned(Vec3::new(0.0, 0.0, top + 0.07), turn, |b| {
                    let reach = side * (half / pitch.cos() + 0.16);
                    b.block(
                        (reach.min(0.0), back - 0.2, -0.07),
                        (reach.max(0.0), back + 2.6, 0.0),
                        ROOF_TILES,
                    );
                });
            }
        });
    }
}

/// One slope: x along the eaves, y up the rafters.
fn slope(b: &mut Builder, width: f32, rafter: f32, tiled: bool) {
    b.block((0.0, 0.0, -0.12), (width, rafter, 0.0), ROOF_TILES);
    if !tiled {
        return;
    }
    // Monk-and-nun tiling: rows of tapered cover tiles, each end lying on the tile below.
    let (columns, step) = ((width / 0.235) as usize, 0.36);
    let rows = (rafter / step) as usize;
    let tiles = b.surface(Material::Clay { color: rgb(0xC4663F) });
    for column in 0..columns {
        let x = (column as f32 + 0.5) * width / columns as f32;
        for row in 0..rows {
            let y = step * row as f32 - 0.04;
            let shape = b.cone_shape(
                Vec3::new(x, y, 0.022),
                Vec3::new(x, y + 0.43, 0.0),
                (0.092, 0.07),
                false,
            );
            b.add_to(shape, tiles);
        }
    }
}
