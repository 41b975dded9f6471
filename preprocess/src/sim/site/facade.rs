//! Walls with openings, and what fills the openings.

use crate::sim::{
    material::Material,
    scene::Builder,
    site::palette::{BLACK_IRON, LINEN, SANDSTONE, WHITE_PAINT, class},
};

/// A rectangular hole in a wall, in the wall's own coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Opening {
    /// Where it begins along the wall.
    pub from: f32,
    /// Where it ends.
    pub to: f32,
    /// Its lower edge.
    pub sill: f32,
    /// Its upper edge.
    pub head: f32,
}

impl Opening {
    /// An opening of `width` around `middle`.
    pub const fn around(middle: f32, width: f32, sill: f32, head: f32) -> Self {
        Self { from: middle - 0.5 * width, to: middle + 0.5 * width, sill, head }
    }
}

/// A wall along x from 0, its outside at y = 0 and its inside at y = `thickness`.
#[derive(Debug, Clone, Copy)]
pub struct Wall {
    pub length: f32,
    pub thickness: f32,
    /// Foot and top.
    pub heights: (f32, f32),
    pub outside: Material,
    pub inside: Material,
}

impl Wall {
    /// Builds the wall around its openings, which must not overlap along it in other than stacks
    /// of equal width. Its outside is one surface, and so is its inside.
    pub fn build(&self, b: &mut Builder, openings: &[Opening]) {
        let (outside, inside) = (b.surface(self.outside), b.surface(self.inside));
        let mut piece = |x0: f32, x1: f32, z0: f32, z1: f32| {
            if x1 - x0 < 1e-3 || z1 - z0 < 1e-3 {
                return;
            }
            let [left, right, under, over] = [(); 4].map(|()| b.surface(self.outside));
            let shape = b.block_shape((x0, 0.0, z0).into(), (x1, self.thickness, z1).into());
            b.add_faces(shape, &[left, right, outside, inside, under, over]);
        };
        let mut sorted = openings.to_vec();
        sorted.sort_by(|a, b| a.from.total_cmp(&b.from).then(a.sill.total_cmp(&b.sill)));
        let (foot, top) = self.heights;
        let mut x = 0.0;
        for stack in sorted.chunk_by(|a, b| a.from == b.from) {
            piece(x, stack[0].from, foot, top);
            let mut z = foot;
            for opening in stack {
                piece(opening.from, opening.to, z, opening.sill);
                z = opening.head;
            }
            piece(stack[0].from, stack[0].to, z, top);
            x = stack[0].to;
        }
        piece(x, self.length, foot, top);
    }
}

/// How a window is made.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// Colour of the frame.
    pub frame: Material,
    /// Stone around it.
    pub surround: Option<Material>,
    /// Shutters, opened flat against the wall.
    pub shutters: Option<Material>,
    /// Pane and curtain: else it stands open, and light and laser pass.
    pub glazed: bool,
}

impl Window {
    /// A plain window with a white frame and stone surround.
    pub const PLAIN: Self =
        Self { frame: WHITE_PAINT, surround: Some(SANDSTONE), shutters: None, glazed: true };

    /// Fills an opening of a wall whose coordinates are current.
    pub fn build(&self, b: &mut Builder, o: Opening) {
        b.object("window", class::BUILDING);
        let (y0, y1, bar) = (0.14, 0.20, 0.055);
        let middle = 0.5 * (o.from + o.to);
        let transom = o.sill + 0.68 * (o.head - o.sill);
        for (x0, x1, z0, z1) in [
            (o.from, o.from + bar, o.sill, o.head),
            (o.to - bar, o.to, o.sill, o.head),
            (o.from + bar, o.to - bar, o.sill, o.sill + bar),
            (o.from + bar, o.to - bar, o.head - bar, o.head),
            (middle - 0.03, middle + 0.03, o.sill + bar, o.head - bar),
            (o.from + bar, middle - 0.03, transom - 0.02, transom + 0.02),
            (middle + 0.03, o.to - bar, transom - 0.02, transom + 0.02),
        ] {
            b.block((x0, y0, z0), (x1, y1, z1), self.frame);
        }
        if self.glazed {
            b.block((o.from, 0.165, o.sill), (o.to, 0.17, o.head), Material::Glass);
        }
        if let Some(stone) = self.surround {
            let (w, out) = (0.13, -0.035);
            b.block((o.from - w, out, o.sill), (o.from, 0.0, o.head), stone);
            b.block((o.to, out, o.sill), (o.to + w, 0.0, o.head), stone);
            b.block((o.from - w, out, o.head), (o.to + w, 0.0, o.head + 0.17), stone);
            b.block(
                (o.from - w - 0.05, -0.11, o.sill - 0.09),
                (o.to + w + 0.05, 0.1, o.sill),
                stone,
            );
        }
        if let Some(paint) = self.shutters {
            let width = 0.5 * (o.to - o.from);
            for x in [o.from - 0.16 - width, o.to + 0.16] {
                shutter(b, x, width, (o.sill, o.head), paint);
            }
        }
    }
}

fn shutter(b: &mut Builder, x: f32, width: f32, (sill, head): (f32, f32), paint: Material) {
    b.object("shutter", class::BUILDING);
    let rail = 0.07;
    b.block((x, -0.075, sill), (x + rail, -0.035, head), paint);
    b.block((x + width - rail, -0.075, sill), (x + width, -0.035, head), paint);
    for z in [sill, 0.5 * (sill + head) - 0.5 * rail, head - rail] {
        b.block((x + rail, -0.075, z), (x + width - rail, -0.035, z + rail), paint);
    }
    let slats = ((head - sill) / 0.085) as usize;
    for i in 0..slats {
        let z = sill + (i as f32 + 0.5) * (head - sill) / slats as f32;
        // Slanted, so that rain stays out.
        let turn = glam::Mat3::from_rotation_x(-0.7);
        b.place_turned(glam::Vec3::new(x, -0.055, z), turn, |b| {
            b.block((rail, -0.004, -0.04), (width - rail, 0.004, 0.04), paint);
        });
    }
}

/// A pair of curtains on a rod inside an opening, the wall being `thickness` thick.
pub fn curtains(b: &mut Builder, o: Opening, thickness: f32, cloth: Option<Material>) {
    b.object("curtain", class::UNCLASSIFIED);
    let cloth = cloth.unwrap_or(LINEN);
    let y = thickness + 0.09;
    b.pole((o.from - 0.35, y, o.head + 0.14), (o.to + 0.35, y, o.head + 0.14), 0.014, BLACK_IRON);
    let cloth = b.surface(cloth);
    for (x0, step) in [(o.from - 0.3, 1.0f32), (o.to + 0.3, -1.0)] {
        for fold in 0..6 {
            let x = x0 + step * 0.07 * fold as f32;
            let dy = if fold % 2 == 0 { 0.02 } else { -0.02 };
            let shape = b.cone_shape(
                (x, y + dy, 0.2).into(),
                (x, y + dy, o.head + 0.13).into(),
                (0.048, 0.034),
                false,
            );
            b.add_to(shape, cloth);
        }
    }
}

/// Net curtain close behind a pane.
pub fn net_curtain(b: &mut Builder, o: Opening) {
    b.object("curtain", class::UNCLASSIFIED);
    let cloth = b.surface(LINEN);
    let folds = ((o.to - o.from) / 0.1) as usize;
    for fold in 0..folds {
        let x = o.from + 0.05 + fold as f32 * 0.1;
        let shape =
            b.cone_shape((x, 0.29, o.sill).into(), (x, 0.29, o.head).into(), (0.056, 0.05), false);
        b.add_to(shape, cloth);
    }
}

/// A panelled door leaf of `width` by `height`, hinged at the origin, lying along x.
pub fn door_leaf(b: &mut Builder, width: f32, height: f32, paint: Material) {
    b.object("door", class::BUILDING);
    b.block((0.0, -0.025, 0.0), (width, 0.025, height), paint);
    for (z0, z1) in [(0.12, 0.36), (0.42, 0.66), (0.72, 0.94)] {
        for y in [-0.034, 0.034] {
            b.block(
                (0.14 * width, y - 0.009, z0 * height),
                (0.86 * width, y + 0.009, z1 * height),
                paint,
            );
        }
    }
    b.ball((width - 0.08, 0.06, 0.48 * height), (0.03, 0.03, 0.03), BLACK_IRON);
    b.ball((width - 0.08, -0.06, 0.48 * height), (0.03, 0.03, 0.03), BLACK_IRON);
}
