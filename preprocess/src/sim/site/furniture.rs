//! Furniture, each piece in coordinates of its own: standing on z = 0, its front towards -y.

use glam::{Mat3, Vec3};

use crate::sim::{material::Material, random::Random, scene::Builder, site::palette::*};

/// A chair around the origin; who sits on it looks to +y.
pub fn chair(b: &mut Builder, frame: Material, seat: Material) {
    b.object("chair", class::UNCLASSIFIED);
    for (x, y, h) in
        [(-0.2, -0.21, 0.9), (0.165, -0.21, 0.9), (-0.2, 0.175, 0.44), (0.165, 0.175, 0.44)]
    {
        b.block((x, y, 0.0), (x + 0.035, y + 0.035, h), frame);
    }
    b.block((-0.215, -0.215, 0.44), (0.215, 0.225, 0.48), seat);
    for z in [0.6, 0.72, 0.83] {
        b.block((-0.165, -0.205, z), (0.165, -0.185, z + 0.06), frame);
    }
    b.block((-0.17, -0.2, 0.2), (-0.18 + 0.02, 0.19, 0.225), frame);
    b.block((0.16, -0.2, 0.2), (0.17, 0.19, 0.225), frame);
}

/// A table `length` by `width` by `height` around the origin.
pub fn table(b: &mut Builder, (length, width, height): (f32, f32, f32), wood: Material) {
    b.object("table", class::UNCLASSIFIED);
    let (x, y) = (0.5 * length, 0.5 * width);
    b.block((-x, -y, height - 0.04), (x, y, height), wood);
    b.block((-x + 0.08, -y + 0.08, height - 0.13), (x - 0.08, y - 0.08, height - 0.04), wood);
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let foot = Vec3::new(sx * (x - 0.1), sy * (y - 0.1), 0.0);
        b.cone(foot, foot + Vec3::Z * (height - 0.04), (0.028, 0.042), wood);
    }
}

/// Plates, glasses, a bottle and a bowl of fruit on a surface at `height`.
pub fn tableware(b: &mut Builder, height: f32, places: &[(f32, f32)]) {
    b.object("tableware", class::UNCLASSIFIED);
    for &(x, y) in places {
        b.cone((x, y, height), (x, y, height + 0.018), (0.07, 0.12), WHITE_PAINT);
        b.turned(
            (x + 0.16, y, height),
            &[(0.03, 0.0), (0.008, 0.01), (0.008, 0.08), (0.035, 0.12), (0.03, 0.19)],
            paint(0xBBD0CF),
        );
    }
    b.turned(
        (0.28, 0.02, height),
        &[(0.038, 0.0), (0.038, 0.19), (0.014, 0.24), (0.014, 0.3)],
        paint(0x27452E),
    );
    b.turned((-0.05, 0.0, height), &[(0.06, 0.0), (0.16, 0.08)], TERRACOTTA);
    for (dx, dy, hex) in [
        (-0.05, 0.05, 0xC6402F),
        (0.03, -0.04, 0xD98A2B),
        (0.06, 0.06, 0x9DB23A),
        (-0.07, -0.03, 0xC6402F),
    ] {
        b.ball((-0.05 + dx, dy, height + 0.1), (0.04, 0.04, 0.038), paint(hex));
    }
}

/// A sofa of `length` along x, its back at +y.
pub fn sofa(b: &mut Builder, length: f32, cloth: Material) {
    b.object("sofa", class::UNCLASSIFIED);
    let x = 0.5 * length;
    b.block((-x, -0.42, 0.1), (x, 0.42, 0.3), cloth);
    b.block((-x, 0.2, 0.3), (x, 0.42, 0.82), cloth);
    for side in [-1.0f32, 1.0] {
        let (a, c) = (side * x, side * (x - 0.18));
        b.block((a.min(c), -0.42, 0.3), (a.max(c), 0.2, 0.58), cloth);
        b.pole((0.5 * (a + c), -0.42, 0.58), (0.5 * (a + c), 0.2, 0.58), 0.1, cloth);
    }
    let seats = (length / 0.75) as usize;
    let width = (length - 0.36) / seats as f32;
    for i in 0..seats {
        let left = -x + 0.18 + width * i as f32;
        b.block((left + 0.01, -0.43, 0.3), (left + width - 0.01, 0.2, 0.45), cloth);
        b.ball((left + 0.5 * width, -0.1, 0.45), (0.46 * width, 0.28, 0.045), cloth);
        b.ball((left + 0.5 * width, 0.17, 0.64), (0.45 * width, 0.09, 0.2), cloth);
    }
    for (px, material) in [(-0.3 * length, MUSTARD_CLOTH), (0.33 * length, LINEN)] {
        b.place_turned(Vec3::new(px, 0.02, 0.62), Mat3::from_rotation_x(-0.35), |b| {
            b.ball((0.0, 0.0, 0.0), (0.21, 0.08, 0.2), material);
        });
    }
    for (fx, fy) in [(-x + 0.06, -0.36), (x - 0.1, -0.36), (-x + 0.06, 0.32), (x - 0.1, 0.32)] {
        b.block((fx, fy, 0.0), (fx + 0.04, fy + 0.04, 0.1), WALNUT);
    }
}

/// A shelf `width` by `height` with its back at y = `depth`, filled with books.
pub fn bookshelf(
    b: &mut Builder,
    (width, depth, height): (f32, f32, f32),
    boards: usize,
    seed: u64,
) {
    b.object("bookshelf", class::UNCLASSIFIED);
    let board = 0.025;
    b.block((0.0, depth - 0.01, 0.0), (width, depth, height), WALNUT);
    let uprights = (width / 0.95).round().max(1.0) as usize;
    for i in 0..=uprights {
        let x = (width - board) * i as f32 / uprights as f32;
        b.block((x, 0.0, 0.0), (x + board, depth - 0.01, height), WALNUT);
    }
    for i in 0..=boards {
        let z = 0.06 + (height - 0.06 - board) * i as f32 / boards as f32;
        b.block((board, 0.004, z), (width - board, depth - 0.01, z + board), WALNUT);
    }
    b.object("books", class::UNCLASSIFIED);
    let mut random = Random::of([seed, 0, 0, 0]);
    let colors =
        [0x8C2F2B, 0x2F4A6B, 0x3F6044, 0xC9A24B, 0xE5DAC3, 0x5B3A57, 0x22302F, 0xB5613A, 0x7C8C92];
    for shelf in 0..boards {
        let z = 0.06 + (height - 0.06 - board) * shelf as f32 / boards as f32 + board;
        let room = (height - 0.06) / boards as f32 - 0.06;
        for bay in 0..uprights {
            let left = (width - board) * bay as f32 / uprights as f32 + board;
            let right = (width - board) * (bay as f32 + 1.0) / uprights as f32;
            let mut x = left + 0.005;
            while x < right - 0.06 {
                let thick = random.range(0.018, 0.052);
                if random.unit() < 0.06 {
                    x += random.range(0.05, 0.2);
                    continue;
                }
                let tall = room * random.range(0.66, 0.97);
                let deep = random.range(0.02, 0.07);
                let color = colors[(random.unit() * colors.len() as f32) as usize];
                b.block((x, deep, z), (x + thick, depth - 0.03, z + tall), paint(color));
                x += thick + 0.002;
            }
        }
    }
}

/// A bed with its head at +y, 1.6 by 2.05 m.
pub fn bed(b: &mut Builder) {
    b.object("bed", class::UNCLASSIFIED);
    b.block((-0.85, 1.0, 0.0), (0.85, 1.06, 1.05), OAK);
    b.block((-0.84, -1.08, 0.0), (0.84, -1.03, 0.5), OAK);
    b.block((-0.84, -1.03, 0.18), (0.84, 1.0, 0.34), OAK);
    b.block((-0.8, -1.02, 0.34), (0.8, 0.99, 0.52), LINEN);
    let spread = Material::Fabric {
        color: crate::sim::material::rgb(0x54718F),
        second: crate::sim::material::rgb(0xD9DDE0),
        stripe: 0.17,
    };
    b.block((-0.84, -1.025, 0.3), (0.84, 0.35, 0.56), spread);
    b.ball((0.0, -0.3, 0.55), (0.8, 0.72, 0.06), spread);
    b.block((-0.845, 0.3, 0.5), (0.845, 0.48, 0.585), LINEN);
    for x in [-0.4, 0.4] {
        b.ball((x, 0.72, 0.59), (0.34, 0.22, 0.1), WHITE_PAINT);
    }
}

/// A chest with doors, `width` by `depth` by `height`, its front at y = 0.
pub fn cabinet(
    b: &mut Builder,
    (width, depth, height): (f32, f32, f32),
    doors: usize,
    wood: Material,
) {
    b.object("cabinet", class::UNCLASSIFIED);
    b.block((0.0, 0.02, 0.07), (width, depth, height), wood);
    b.block((0.03, 0.07, 0.0), (width - 0.03, depth, 0.07), DARK_BEAM);
    let leaf = width / doors as f32;
    for i in 0..doors {
        let x = leaf * i as f32;
        b.block((x + 0.006, 0.0, 0.08), (x + leaf - 0.006, 0.02, height - 0.008), wood);
        let knob = if i % 2 == 0 { x + leaf - 0.05 } else { x + 0.05 };
        b.ball((knob, -0.018, 0.55 * height), (0.016, 0.02, 0.016), BRASS);
    }
}

/// A lamp hanging from `ceiling` with its shade's rim at `rim`.
pub fn pendant(b: &mut Builder, ceiling: f32, rim: f32, color: Material) {
    b.object("lamp", class::UNCLASSIFIED);
    b.pole((0.0, 0.0, rim + 0.24), (0.0, 0.0, ceiling), 0.005, BLACK_IRON);
    b.shade((0.0, 0.0, rim), (0.0, 0.0, rim + 0.24), (0.26, 0.07), color);
    b.ball((0.0, 0.0, rim + 0.1), (0.05, 0.05, 0.06), WHITE_PAINT);
}

/// A lamp on a stand of `height`.
pub fn stand_lamp(b: &mut Builder, height: f32, width: f32) {
    b.object("lamp", class::UNCLASSIFIED);
    b.turned((0.0, 0.0, 0.0), &[(0.6 * width, 0.0), (0.55 * width, 0.02)], BRASS);
    b.pole((0.0, 0.0, 0.02), (0.0, 0.0, height - 0.1), 0.012, BRASS);
    b.shade((0.0, 0.0, height - 0.75 * width), (0.0, 0.0, height), (width, 0.62 * width), LINEN);
}

/// A framed painting `width` by `height` around the origin, its front towards -y.
pub fn picture(b: &mut Builder, width: f32, height: f32) {
    b.object("picture", class::UNCLASSIFIED);
    let (x, z, rim) = (0.5 * width, 0.5 * height, 0.045);
    b.block((-x, -0.022, -z), (x, 0.0, z), Material::Picture);
    for (x0, x1, z0, z1) in [
        (-x - rim, x + rim, z, z + rim),
        (-x - rim, x + rim, -z - rim, -z),
        (-x - rim, -x, -z, z),
        (x, x + rim, -z, z),
    ] {
        b.block((x0, -0.04, z0), (x1, 0.0, z1), BRASS);
    }
}

/// A rug around the origin.
pub fn rug(b: &mut Builder, half: (f32, f32), color: u32, second: u32) {
    use crate::sim::material::rgb;
    b.object("rug", class::UNCLASSIFIED);
    let material = Material::Rug { color: rgb(color), second: rgb(second), half: half.into() };
    b.block((-half.0, -half.1, 0.0), (half.0, half.1, 0.012), material);
}

/// Fireplace with its back at y = 0.5, 1.7 m wide.
pub fn fireplace(b: &mut Builder, ceiling: f32) {
    b.object("fireplace", class::BUILDING);
    b.block((-0.85, 0.0, 0.0), (-0.5, 0.5, 1.05), SANDSTONE);
    b.block((0.5, 0.0, 0.0), (0.85, 0.5, 1.05), SANDSTONE);
    b.block((-0.85, 0.0, 0.85), (0.85, 0.5, 1.1), SANDSTONE);
    b.block((-0.95, -0.08, 1.1), (0.95, 0.5, 1.18), OAK);
    b.block((-0.5, 0.45, 0.0), (0.5, 0.5, 0.85), BRICK);
    b.block((-0.75, -0.5, 0.0), (0.75, 0.0, 0.03), GRANITE);
    b.prism(
        (0.12, 0.5),
        &[(-0.7, 1.18), (0.7, 1.18), (0.42, ceiling), (-0.42, ceiling)],
        WHITE_PLASTER,
    );
    for (x, y, turn) in [(-0.12, 0.2, 0.3), (0.1, 0.24, -0.2), (0.0, 0.16, 0.05)] {
        let along = Vec3::new(0.24, 0.24 * turn, 0.0);
        let middle = Vec3::new(x, y, 0.09);
        b.pole(
            middle - along,
            middle + along,
            0.055,
            Material::Bark { color: crate::sim::material::rgb(0x4A3A2E) },
        );
    }
    for (x, h) in [(-0.7, 0.24), (-0.55, 0.17), (0.66, 0.2)] {
        b.turned((x, 0.1, 1.18), &[(0.04, 0.0), (0.012, 0.02), (0.02, h * 0.5), (0.02, h)], BRASS);
    }
    b.turned(
        (0.25, 0.12, 1.18),
        &[(0.05, 0.0), (0.1, 0.12), (0.04, 0.22), (0.06, 0.26)],
        paint(0x3C6D8E),
    );
}
