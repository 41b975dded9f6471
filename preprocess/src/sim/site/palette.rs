//! Materials that recur, so that one house looks like one house.

use glam::Vec2;

use crate::sim::material::{Material, rgb};

/// ASPRS classes that the scene uses (LAS 1.4 R15, table 17).
pub mod class {
    /// Furniture, vehicles, fittings.
    pub const UNCLASSIFIED: u8 = 1;
    /// Ground.
    pub const GROUND: u8 = 2;
    /// Plants up to knee height.
    pub const LOW_VEGETATION: u8 = 3;
    /// Shrubs, hedges, ivy.
    pub const MEDIUM_VEGETATION: u8 = 4;
    /// Trees.
    pub const HIGH_VEGETATION: u8 = 5;
    /// Walls, roofs, floors of buildings.
    pub const BUILDING: u8 = 6;
    /// Water.
    pub const WATER: u8 = 9;
    /// The carriageway.
    pub const ROAD: u8 = 11;
}

const fn plain(hex: u32) -> Material {
    Material::Paint { color: rgb(hex) }
}

const fn wood(hex: u32) -> Material {
    Material::Wood { color: rgb(hex) }
}

const fn stone(hex: u32) -> Material {
    Material::Stone { color: rgb(hex) }
}

const fn metal(hex: u32) -> Material {
    Material::Metal { color: rgb(hex) }
}

const fn cloth(hex: u32) -> Material {
    Material::Fabric { color: rgb(hex), second: rgb(hex), stripe: 0.0 }
}

pub const OCHRE_PLASTER: Material = Material::Plaster { color: rgb(0xE8C58A), stains: 0.55 };
pub const WHITE_PLASTER: Material = Material::Plaster { color: rgb(0xEFE9DC), stains: 0.0 };
pub const SAGE_PLASTER: Material = Material::Plaster { color: rgb(0xA9BC9E), stains: 0.0 };
pub const BLUE_PLASTER: Material = Material::Plaster { color: rgb(0xA8BFD2), stains: 0.0 };
pub const SANDSTONE: Material = stone(0xD9C4A0);
pub const GRANITE: Material = stone(0x9A9994);
pub const ASHLAR: Material = Material::Masonry {
    color: rgb(0xCDB893),
    mortar: rgb(0x9C8F78),
    size: Vec2::new(0.62, 0.3),
    joint: 0.012,
    variation: 0.16,
};
pub const RUBBLE: Material = Material::Masonry {
    color: rgb(0xB9A88A),
    mortar: rgb(0x85796A),
    size: Vec2::new(0.42, 0.2),
    joint: 0.025,
    variation: 0.28,
};
pub const BRICK: Material = Material::Masonry {
    color: rgb(0xA5553C),
    mortar: rgb(0xBDB1A0),
    size: Vec2::new(0.25, 0.077),
    joint: 0.012,
    variation: 0.3,
};
pub const ROOF_TILES: Material = Material::RoofTiles { color: rgb(0xC4663F) };
pub const OAK: Material = wood(0xB9854F);
pub const WALNUT: Material = wood(0x7A5235);
pub const PALE_WOOD: Material = wood(0xD9B988);
pub const DARK_BEAM: Material = wood(0x5E4330);
pub const WHITE_PAINT: Material = plain(0xF0EEE6);
pub const GREEN_PAINT: Material = plain(0x2F5B4A);
pub const TEAL_PAINT: Material = plain(0x4F8381);
pub const BLACK_IRON: Material = metal(0x2E2F31);
pub const STEEL: Material = metal(0xB4B7B9);
pub const COPPER: Material = metal(0xA86A45);
pub const BRASS: Material = metal(0xC29A4B);
pub const TERRACOTTA: Material = stone(0xBF6A45);
pub const LINEN: Material = cloth(0xE9E2D2);
pub const RED_CLOTH: Material = cloth(0xA23B35);
pub const BLUE_CLOTH: Material = cloth(0x3F5F8C);
pub const MUSTARD_CLOTH: Material = cloth(0xC9983A);

/// Smooth paint of any colour.
pub const fn paint(hex: u32) -> Material {
    plain(hex)
}

/// Leaves of any colour.
pub const fn leaf(hex: u32) -> Material {
    Material::Leaf { color: rgb(hex) }
}
