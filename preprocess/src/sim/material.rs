//! What surfaces are made of: the colour and the laser reflectance of every spot.
//!
//! Textures are functions of the position, not images: as sharp as any scan is dense, and none
//! to ship.

use glam::{Vec2, Vec3};

use super::{
    noise::{clouds2, lattice, noise2, noise3, smoothstep, split},
    pattern::{boards, cobbles, courses},
};

/// A colour as linear light, from the usual `0xRRGGBB`.
#[must_use]
pub const fn rgb(hex: u32) -> Vec3 {
    const fn linear(byte: u32) -> f32 {
        // A cubic through the sRGB curve (IEC 61966-2-1), within 0.003 of it, that a const fn can do.
        let c = byte as f32 / 255.0;
        c * (c * (c * 0.305_306_01 + 0.682_171_1) + 0.012_522_878)
    }
    Vec3::new(linear((hex >> 16) & 0xFF), linear((hex >> 8) & 0xFF), linear(hex & 0xFF))
}

/// A spot on a surface, as a material wants to know it.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// World position in metres.
    pub world: Vec3,
    /// Position in the coordinates of the shape.
    pub local: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// The local axis along which wood was cut: 0, 1 or 2.
    pub grain: usize,
    /// A number of the primitive's own, so that every leaf and every book differs.
    pub primitive: u32,
}

impl Spot {
    /// Metres along the surface: horizontally, and up the slope (east and north on floors).
    #[inline]
    fn plane(&self) -> Vec2 {
        if self.normal.z.abs() > 0.99 {
            return Vec2::new(self.world.x, self.world.y);
        }
        let along = Vec3::new(-self.normal.y, self.normal.x, 0.0).normalize();
        let up = self.normal.cross(along);
        Vec2::new(self.world.dot(along), self.world.dot(up))
    }

    fn own(&self, salt: u32) -> f32 {
        lattice(self.primitive.cast_signed(), 0, 0, salt)
    }
}

/// What a spot does with light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finish {
    /// Diffuse reflectance in linear red, green, blue.
    pub albedo: Vec3,
    /// Reflectance at the laser's wavelength (1550 nm), 0 to 1.
    pub infrared: f32,
    /// Share of laser shots that come back at all: low on glass and water.
    pub returns: f32,
}

/// What a surface is made of. Colours are linear: see [`rgb`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Material {
    /// Rendered wall; `stains` from 0 (fresh) to 1.
    Plaster { color: Vec3, stains: f32 },
    /// Courses of bricks or dressed stones, sizes in metres.
    Masonry { color: Vec3, mortar: Vec3, size: Vec2, joint: f32, variation: f32 },
    /// Square flags with joints.
    Flags { color: Vec3, size: Vec2, bond: f32 },
    /// Rounded paving stones with bands of larger ones.
    Cobbles { color: Vec3 },
    /// Massive stone, mottled.
    Stone { color: Vec3 },
    /// Solid wood with its grain along the longest side.
    Wood { color: Vec3 },
    /// Floor boards.
    Boards { color: Vec3, width: f32, length: f32 },
    /// Smooth and of one colour.
    Paint { color: Vec3 },
    /// Woven cloth; stripes of the second colour where `stripe` (metres) is above zero.
    Fabric { color: Vec3, second: Vec3, stripe: f32 },
    /// Panels of an umbrella, the two colours by turns around the local z axis.
    Gores { color: Vec3, second: Vec3, count: u8 },
    /// A rug with a border, in local coordinates with this half size.
    Rug { color: Vec3, second: Vec3, half: Vec2 },
    /// Two colours by turns.
    Checker { color: Vec3, second: Vec3, size: f32 },
    /// Clay roof tiles in courses up the slope.
    RoofTiles { color: Vec3 },
    /// A single clay tile, each with its own shade.
    Clay { color: Vec3 },
    /// Lawn.
    Grass,
    /// Raked gravel.
    Gravel,
    /// Garden earth.
    Soil,
    /// The street's surface with its markings.
    Road,
    /// Leaf with a hue of its own around `color`.
    Leaf { color: Vec3 },
    /// Tree bark.
    Bark { color: Vec3 },
    /// Bare or painted metal.
    Metal { color: Vec3 },
    /// A window pane before a dark room.
    Glass,
    /// Still water.
    Water,
    /// A painting, in local coordinates.
    Picture,
}

/// Geometry of the street that its surface must agree with, in metres.
pub mod street {
    /// Northern and southern edge of the carriageway.
    pub const EDGES: (f32, f32) = (-9.5, -3.0);
    /// The zebra crossing, from x to x.
    pub const ZEBRA: (f32, f32) = (6.6, 9.8);
    /// Where cars park: between this line and the northern edge.
    pub const PARKING: f32 = -5.1;
}

impl Material {
    /// Colour and reflectance at a spot.
    #[must_use]
    pub fn finish(&self, spot: &Spot) -> Finish {
        let p = spot.world;
        let (albedo, infrared) = match *self {
            Self::Plaster { color, stains } => (plaster(spot, color, stains), 0.75),
            Self::Masonry { color, mortar, size, joint, variation } => {
                let uv = spot.plane();
                let piece = courses(uv, size, joint, 0.5);
                let grain = 0.85 + 0.3 * noise3(p * 9.0, 31);
                let tone = 1.0 + variation * (piece.own - 0.5) * 2.0;
                let warm = Vec3::new(
                    1.0,
                    1.0 - 0.12 * variation * piece.own,
                    1.0 - 0.2 * variation * piece.own,
                );
                let stone = color * warm * tone * grain;
                (mortar.lerp(stone, piece.body) * splash(p), 0.55)
            }
            Self::Flags { color, size, bond } => {
                let piece = courses(spot.plane(), size, 0.012, bond);
                let worn = 0.86 + 0.22 * clouds2(spot.plane() * 1.3, 33);
                let stone = color * (0.86 + 0.28 * piece.own) * worn;
                ((color * 0.42).lerp(stone, piece.body), 0.5)
            }
            Self::Cobbles { color } => (paving(Vec2::new(p.x, p.y), color), 0.42),
            Self::Stone { color } => {
                let veins = noise3(p * 2.3, 41) * 0.6 + noise3(p * 11.0, 42) * 0.4;
                (color * (0.78 + 0.4 * veins) * splash(p), 0.6)
            }
            Self::Wood { color } => (color * grain(spot.local, spot.grain, spot.own(3)), 0.6),
            Self::Boards { color, width, length } => {
                let uv = spot.plane();
                let piece = boards(uv, width, length);
                let fine = noise2(Vec2::new(uv.x * 2.5, uv.y * 60.0 + piece.own * 40.0), 44);
                let tone = (0.72 + 0.5 * piece.own) * (0.86 + 0.28 * fine);
                (color * tone * (0.45 + 0.55 * piece.body), 0.55)
            }
            Self::Paint { color } => (color * (0.97 + 0.05 * noise3(p * 3.0, 45)), 0.6),
            Self::Fabric { color, second, stripe } => {
                let striped = stripe > 0.0 && split(spot.local.x / stripe).0 % 2 == 0;
                let fold = 0.88 + 0.2 * noise3(spot.local * 7.0, 46);
                (if striped { second } else { color } * fold, 0.65)
            }
            Self::Gores { color, second, count } => {
                let turn = libm::atan2f(spot.local.y, spot.local.x) / std::f32::consts::TAU;
                let odd = split(turn * f32::from(count)).0 % 2 != 0;
                (
                    if odd { second } else { color } * (0.92 + 0.12 * noise3(spot.local * 7.0, 46)),
                    0.65,
                )
            }
            Self::Rug { color, second, half } => (rug(spot.local, color, second, half), 0.5),
            Self::Checker { color, second, size } => {
                let uv = spot.plane() / size;
                let ((x, _), (y, _)) = (split(uv.x), split(uv.y));
                let tone = 0.9 + 0.15 * lattice(x, y, 0, 47);
                (if (x + y).rem_euclid(2) == 0 { color } else { second } * tone, 0.6)
            }
            Self::RoofTiles { color } => (roof_tile(spot, color), 0.5),
            Self::Clay { color } => {
                let (tone, hue) = (spot.own(57), spot.own(58));
                let lichen = 0.5 * smoothstep(0.5, 0.8, noise3(p * 0.7, 59));
                let fired = color
                    * Vec3::new(1.0, 0.82 + 0.4 * hue, 0.7 + 0.6 * hue)
                    * (0.62 + 0.65 * tone);
                (fired.lerp(rgb(0x8C8468), lichen) * (0.9 + 0.2 * noise3(p * 8.0, 60)), 0.5)
            }
            Self::Grass => (grass(p), 0.5),
            Self::Gravel => {
                let fine = lattice((p.x * 40.0) as i32, (p.y * 40.0) as i32, 0, 48);
                (
                    rgb(0xC9B899)
                        * (0.75 + 0.25 * fine + 0.15 * noise2(Vec2::new(p.x, p.y) * 0.7, 49)),
                    0.5,
                )
            }
            Self::Soil => (rgb(0x5A4634) * (0.7 + 0.5 * noise3(p * 14.0, 50)), 0.35),
            Self::Road => road(p),
            Self::Leaf { color } => {
                let (light, hue) = (spot.own(51), spot.own(52));
                let vein = 1.0 - 0.18 * smoothstep(0.12, 0.0, spot.local.y.abs());
                let tint = Vec3::new(0.8 + 0.5 * hue, 0.95 + 0.1 * hue, 0.75 + 0.2 * light);
                (color * tint * (0.65 + 0.65 * light) * vein, 0.7)
            }
            Self::Bark { color } => {
                let q = Vec3::new(spot.local.x * 14.0, spot.local.y * 14.0, spot.local.z * 2.5);
                (color * (0.6 + 0.7 * noise3(q, 53)), 0.45)
            }
            Self::Metal { color } => (color * (0.9 + 0.16 * noise3(p * 5.0, 54)), 0.35),
            Self::Glass => return pane(spot),
            Self::Water => {
                let ripple = noise2(Vec2::new(p.x, p.y) * 5.0, 56);
                return Finish {
                    albedo: rgb(0x3E6E78) * (0.7 + 0.6 * ripple),
                    infrared: 0.12,
                    returns: 0.45,
                };
            }
            Self::Picture => (picture(spot), 0.5),
        };
        // What is bright to the eye is mostly bright to the laser.
        let luminance = albedo.dot(Vec3::new(0.21, 0.72, 0.07));
        let infrared = (0.55 * infrared + 0.6 * luminance).clamp(0.02, 0.95);
        Finish {
            albedo: albedo.clamp(Vec3::splat(0.01), Vec3::splat(0.92)),
            infrared,
            returns: 1.0,
        }
    }
}

/// Rain splashes earth up a wall's foot.
fn splash(p: Vec3) -> f32 {
    if p.z > 1.0 {
        return 1.0;
    }
    1.0 - 0.3
        * smoothstep(0.75, 0.0, p.z + 0.5 * noise2(Vec2::new((p.x + p.y) * 2.1, p.z * 3.0), 32))
}

fn plaster(spot: &Spot, color: Vec3, stains: f32) -> Vec3 {
    let uv = spot.plane();
    let mottle = 0.94 + 0.12 * clouds2(uv * 0.8, 60);
    if stains <= 0.0 {
        return color * mottle;
    }
    // Rain runs down in streaks; patches have been mended.
    let streak = noise2(Vec2::new(uv.x * 4.0, uv.y * 0.35), 61);
    let patch = noise2(uv * 0.45, 62);
    let dirt =
        stains * (0.45 * smoothstep(0.62, 0.95, streak) + 0.28 * smoothstep(0.55, 0.8, patch));
    let fine = 0.95 + 0.1 * noise2(uv * 23.0, 63);
    (color * mottle * fine).lerp(color * Vec3::new(0.55, 0.52, 0.47), dirt) * splash(spot.world)
}

/// Rings and fibres of wood cut along the local axis `along`.
fn grain(local: Vec3, along: usize, own: f32) -> f32 {
    let mut q = local * 22.0;
    q[along] = local[along] * 1.6;
    let bent = noise3(q + own * 31.0, 64);
    let fibre = noise3(q * 3.1 + own * 17.0, 65);
    (0.8 + 0.25 * own) * (0.75 + 0.3 * bent + 0.2 * fibre)
}

/// Cobbles in fields of four metres, framed by bands of flags.
fn paving(p: Vec2, color: Vec3) -> Vec3 {
    let field = Vec2::new(p.x - 1.0, p.y) / 4.2;
    let (_, fx) = split(field.x);
    let (_, fy) = split(field.y);
    let band = 0.5 - (fx - 0.5).abs().max((fy - 0.5).abs());
    let worn = 0.8 + 0.35 * clouds2(p * 0.22, 70);
    let moss = smoothstep(0.58, 0.75, clouds2(p * 0.5, 71));
    if band < 0.05 {
        let along = if fx.min(1.0 - fx) < fy.min(1.0 - fy) { Vec2::new(p.y, p.x) } else { p };
        let piece = courses(along, Vec2::new(0.6, 0.42), 0.012, 0.5);
        let stone = rgb(0xCDBFA6) * (0.85 + 0.3 * piece.own) * worn;
        return (color * 0.45).lerp(stone, piece.body);
    }
    // Laid in shallow arcs, as pavers reach.
    let (_, lane) = split(p.x / 1.05);
    let sag = (lane - 0.5) * (lane - 0.5) * 1.6;
    let piece = cobbles(Vec2::new(p.x, p.y + sag * 1.05) / 0.115, 0.45, 0.16);
    let warm = Vec3::new(1.0, 0.97 + 0.06 * piece.own, 0.9 + 0.16 * piece.own);
    let stone = color * warm * (0.72 + 0.5 * piece.own) * worn;
    let joint = rgb(0x5B5346).lerp(rgb(0x5E6B3C), moss);
    joint.lerp(stone, piece.body)
}

fn rug(local: Vec3, color: Vec3, second: Vec3, half: Vec2) -> Vec3 {
    let p = Vec2::new(local.x, local.y);
    let edge = (half - p.abs()).min_element();
    let pile = 0.85 + 0.25 * noise2(p * 45.0, 80);
    let figure = if edge < 0.06 {
        second
    } else if edge < 0.22 {
        let (_, t) = split((p.x + p.y) / 0.16);
        if (t - 0.5).abs() < 0.25 { rgb(0xE2CFA3) } else { second * 0.7 }
    } else {
        // Diamonds in the field, after the manner of a kilim.
        let (_, u) = split(p.x / 0.5);
        let (_, v) = split(p.y / 0.5);
        let diamond = (u - 0.5).abs() + (v - 0.5).abs();
        if diamond < 0.16 {
            rgb(0xE2CFA3)
        } else if diamond < 0.32 {
            second
        } else {
            color
        }
    };
    figure * pile
}

fn roof_tile(spot: &Spot, color: Vec3) -> Vec3 {
    let uv = spot.plane();
    let piece = courses(uv, Vec2::new(0.22, 0.36), 0.02, 0.0);
    let lichen = smoothstep(0.55, 0.8, clouds2(uv * 0.6, 81));
    let age = 0.8 + 0.35 * noise2(uv * 0.33, 82);
    let hue = Vec3::new(1.0, 0.85 + 0.35 * piece.own, 0.75 + 0.5 * piece.own);
    let tile = color * hue * (0.65 + 0.6 * piece.own) * age;
    tile.lerp(rgb(0x8C8468), 0.45 * lichen) * (0.55 + 0.45 * piece.body)
}

fn grass(p: Vec3) -> Vec3 {
    let q = Vec2::new(p.x, p.y);
    let patch = clouds2(q * 0.35, 83);
    let blade = noise2(q * 31.0, 84);
    let dry = smoothstep(0.5, 0.8, noise2(q * 0.8, 85));
    rgb(0x5E8A35).lerp(rgb(0x9A9A50), 0.5 * dry) * (0.6 + 0.4 * patch + 0.45 * blade)
}

fn road(p: Vec3) -> (Vec3, f32) {
    let q = Vec2::new(p.x, p.y);
    let (south, north) = street::EDGES;
    let middle = 0.5 * (south + street::PARKING);
    let stone = lattice((p.x * 90.0) as i32, (p.y * 90.0) as i32, 0, 86);
    let wheel = 0.06 * smoothstep(0.5, 0.0, ((p.y - middle).abs() - 1.1).abs());
    let patch = if courses(q + Vec2::new(0.7, 0.3), Vec2::new(7.0, 2.4), 0.0, 0.37).own < 0.14 {
        0.7
    } else {
        1.0
    };
    let asphalt = Vec3::new(0.085, 0.085, 0.088)
        * (0.75 + 0.35 * stone + 0.3 * clouds2(q * 0.6, 87) + wheel)
        * patch;
    let worn = smoothstep(0.30, 0.42, noise2(q * 6.0, 88));
    let zebra = p.x > street::ZEBRA.0 && p.x < street::ZEBRA.1;
    let paint = if zebra {
        split((p.y - south - 0.25) / 0.5).0 % 2 == 0 && p.y > south + 0.25 && p.y < north - 0.25
    } else {
        let clear = p.x < street::ZEBRA.0 - 1.0 || p.x > street::ZEBRA.1 + 1.0;
        let dash = (p.y - middle).abs() < 0.06 && split(p.x / 4.5).1 < 0.55;
        let bay = (p.y - street::PARKING).abs() < 0.05;
        let divider = p.y > street::PARKING && split(p.x / 5.6).1 * 5.6 < 0.1;
        clear && (dash || bay || divider)
    };
    // The cast-iron lid of a manhole.
    let lid = (q - Vec2::new(3.2, middle - 0.4)).length();
    if lid < 0.34 {
        let ribs = split((p.x + p.y) * 16.0).1;
        return (Vec3::splat(if lid > 0.29 { 0.05 } else { 0.07 + 0.05 * ribs }), 0.2);
    }
    if paint { (asphalt.lerp(Vec3::splat(0.72), 0.35 + 0.6 * worn), 0.8) } else { (asphalt, 0.15) }
}

fn pane(spot: &Spot) -> Finish {
    // A hint of the sky's reflection, brighter upward.
    let uv = spot.plane();
    let sky = smoothstep(-0.6, 1.2, spot.local.z + 0.35 * (noise2(uv * 1.7, 89) - 0.5));
    let albedo = rgb(0x1D262B).lerp(rgb(0x6F8796), 0.6 * sky);
    Finish { albedo, infrared: 0.06, returns: 0.55 }
}

/// A landscape by an unknown master: sky, hills, a lake.
fn picture(spot: &Spot) -> Vec3 {
    let p = spot.local;
    let (x, z) = (if spot.grain == 0 { p.x } else { p.y }, p.z);
    let own = spot.own(90);
    let hill = 0.22 * (noise2(Vec2::new(x * 4.0 + own * 50.0, 0.0), 91) - 0.4);
    let near = 0.16 * (noise2(Vec2::new(x * 6.0 + own * 70.0, 5.0), 92) - 1.2);
    let dab = 0.85 + 0.3 * noise2(Vec2::new(x, z) * 40.0, 93);
    let color = if z > hill {
        rgb(0xE8C98F).lerp(rgb(0x6E9CC0), smoothstep(0.0, 0.4, z))
    } else if z > near {
        rgb(0x4F6B52).lerp(rgb(0x6C7FA0), own)
    } else {
        rgb(0x7A5A33).lerp(rgb(0x3C5A2E), own)
    };
    color * dab
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::random::Random;

    #[test]
    fn every_material_reflects_between_nothing_and_everything() {
        let (color, second) = (rgb(0xE0C090), rgb(0x804020));
        let materials = [
            Material::Plaster { color, stains: 1.0 },
            Material::Masonry {
                color,
                mortar: second,
                size: Vec2::new(0.25, 0.08),
                joint: 0.01,
                variation: 0.4,
            },
            Material::Flags { color, size: Vec2::splat(0.5), bond: 0.5 },
            Material::Cobbles { color },
            Material::Stone { color },
            Material::Wood { color },
            Material::Boards { color, width: 0.1, length: 1.0 },
            Material::Paint { color },
            Material::Fabric { color, second, stripe: 0.1 },
            Material::Gores { color, second, count: 16 },
            Material::Rug { color, second, half: Vec2::ONE },
            Material::Checker { color, second, size: 0.3 },
            Material::RoofTiles { color },
            Material::Clay { color },
            Material::Grass,
            Material::Gravel,
            Material::Soil,
            Material::Road,
            Material::Leaf { color },
            Material::Bark { color },
            Material::Metal { color },
            Material::Glass,
            Material::Water,
            Material::Picture,
        ];
        let mut random = Random::of([11, 0, 0, 0]);
        for material in materials {
            for primitive in 0..500 {
                let normal = if primitive % 2 == 0 { Vec3::Z } else { random.direction() };
                let world = random.direction() * 30.0;
                let spot = Spot { world, local: random.direction(), normal, grain: 1, primitive };
                let finish = material.finish(&spot);
                assert!(
                    finish.albedo.min_element() > 0.0 && finish.albedo.max_element() < 1.0,
                    "{material:?}"
                );
                assert!(finish.infrared > 0.0 && finish.infrared < 1.0);
                assert!(finish.returns > 0.0 && finish.returns <= 1.0);
            }
        }
    }
}
