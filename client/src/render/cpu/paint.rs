//! What colour a point is seen in: its own, in the light that falls on it.

use glam::DVec3;

use super::stage::place;
use crate::render::{
    color::NodeColor,
    settings::phong,
    surface::NodeSurface,
    view::{NodeView, View},
};

/// The colours of a node's points, as they are seen.
pub(super) struct NodePaint<'a> {
    pub color: NodeColor<'a>,
    /// Where there is light.
    pub light: Option<Light<'a>>,
    pub positions: &'a [[u32; 3]],
}

impl NodePaint<'_> {
    /// Red, green, blue of a point.
    pub fn color(&self, index: usize) -> [u8; 3] {
        // Looked up where it is needed only: points that are seen lie anywhere in memory.
        let position = || self.positions[index];
        let color = self.color.color(index, || position()[2]);
        self.light.as_ref().map_or(color, |light| light.on(color, index, position()))
    }
}

/// What light needs to know of a node.
pub(super) struct Light<'a> {
    pub view: &'a View,
    pub node: NodeView,
    pub surface: NodeSurface<'a>,
}

impl Light<'_> {
    fn on(&self, color: [u8; 3], index: usize, q: [u32; 3]) -> [u8; 3] {
        let Some(normal) = self.surface.normal(index) else { return color };
        // From the eye.
        let sight = if self.view.perspective { place(&self.node, q).normalize() } else { DVec3::Z };
        lit(color, self.view.direction(normal), sight)
    }
}

/// A colour in Phong's illumination; `normal` and the direction of sight are unit vectors in view
/// space. Of the two normals of a surface, the one towards the eye counts. (Radner 2018, 4.5)
fn lit(color: [u8; 3], normal: DVec3, sight: DVec3) -> [u8; 3] {
    let normal = if normal.dot(sight) > 0.0 { -normal } else { normal };
    let to_light = DVec3::from_array(phong::TO_LIGHT);
    let facing = normal.dot(to_light);
    let shade = phong::AMBIENT + phong::DIFFUSE * facing.max(0.0);
    let reflected = 2.0 * facing * normal - to_light;
    let highlight = phong::SPECULAR * reflected.dot(-sight).max(0.0).powf(phong::SHININESS);
    color.map(|c| {
        let c = f64::from(c) / 255.0 * shade + highlight;
        (c.clamp(0.0, 1.0) * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_is_reflected_into_the_eye_is_a_highlight() {
        // The normal half way between light and eye: n·l = n·v = sqrt((1 + l·v) / 2) = sqrt(0.9).
        let to_light = DVec3::from_array(phong::TO_LIGHT);
        let half = (to_light + DVec3::NEG_Z).normalize();
        let shade = 0.35 + 0.65 * 0.9_f64.sqrt();
        let expected = [0u8, 100, 200].map(|c| (f64::from(c) * shade + 0.15 * 255.0).round() as u8);
        assert_eq!(lit([0, 100, 200], half, DVec3::Z), expected);
        assert_eq!(lit([0, 100, 200], -half, DVec3::Z), expected, "no side is the back");
        assert_eq!(lit([255; 3], half, DVec3::Z), [255; 3], "no brighter than white");
    }

    #[test]
    fn what_faces_away_from_the_light_has_but_the_light_that_is_everywhere() {
        // Across the light; then away from it, though towards the eye.
        for normal in [DVec3::new(0.8, 0.6, 0.0), DVec3::new(0.8, -0.6, -0.1).normalize()] {
            assert!(normal.dot(DVec3::from_array(phong::TO_LIGHT)) < 1e-12);
            assert_eq!(lit([100, 200, 0], normal, DVec3::Z), [35, 70, 0]);
        }
    }
}
