//! The directions of x, y and z.

use egui::{Align2, Color32, FontId, Painter, Pos2, Stroke, vec2};
use glam::DVec3;

use super::MARGIN;
use crate::viewer::{state::Viewer, theme::Palette};

const LENGTH: f32 = 30.0;

pub fn draw(viewer: &Viewer, painter: &Painter, palette: Palette) {
    let rect = viewer.view_rect;
    let reach = LENGTH + 18.0;
    let middle = rect.right_bottom() - vec2(MARGIN + reach, MARGIN + reach);
    painter.circle_filled(middle, reach, palette.shade);
    let basis = viewer.camera.basis();
    let mut axes = [
        (DVec3::X, "x", Color32::from_rgb(235, 87, 87)),
        (DVec3::Y, "y", Color32::from_rgb(76, 175, 108)),
        (DVec3::Z, "z", Color32::from_rgb(77, 144, 240)),
    ];
    // What points away first: the others lie upon it.
    axes.sort_by(|a, b| b.0.dot(basis.forward).total_cmp(&a.0.dot(basis.forward)));
    for (axis, name, color) in axes {
        let way = vec2(axis.dot(basis.right) as f32, -axis.dot(basis.up) as f32);
        let end: Pos2 = middle + LENGTH * way;
        painter.line_segment([middle, end], Stroke::new(2.5, color));
        let seen = way.length();
        let place = middle + (LENGTH + 9.0) * if seen > 0.25 { way / seen.max(0.6) } else { way };
        painter.text(place, Align2::CENTER_CENTER, name, FontId::proportional(13.0), color);
    }
    painter.circle_filled(middle, 2.5, palette.text);
}
