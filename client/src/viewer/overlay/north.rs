//! Where north (+y) is.

use egui::{Align2, Color32, FontId, Painter, Shape, Stroke, Vec2, vec2};

use super::MARGIN;
use crate::viewer::{state::Viewer, theme::Palette};

const RADIUS: f32 = 24.0;

pub fn draw(viewer: &Viewer, painter: &Painter, palette: Palette) {
    let middle = viewer.view_rect.right_top() + vec2(-(MARGIN + RADIUS), MARGIN + RADIUS);
    painter.circle_filled(middle, RADIUS, palette.shade);
    painter.circle_stroke(middle, RADIUS, Stroke::new(1.0, palette.faint.gamma_multiply(0.5)));
    // Of a map that lies in the picture: what is to the right is to the right.
    let basis = viewer.camera.basis();
    let up_on_map = if basis.forward.z.abs() > 0.999 { basis.up } else { basis.forward };
    let heading = (-up_on_map.x).atan2(up_on_map.y) as f32;
    let way = Vec2::angled(-std::f32::consts::FRAC_PI_2 + heading);
    let side = vec2(-way.y, way.x);
    let (tip, tail) = (middle + 13.0 * way, middle - 13.0 * way);
    let half = |end: egui::Pos2, color: Color32| {
        let corners = vec![end, middle + 4.5 * side, middle - 4.5 * side];
        painter.add(Shape::convex_polygon(corners, color, Stroke::NONE));
    };
    half(tip, Color32::from_rgb(235, 87, 87));
    half(tail, palette.faint);
    let place = middle + 19.0 * way;
    painter.circle_filled(place, 7.5, palette.shade.to_opaque());
    painter.text(place, Align2::CENTER_CENTER, "N", FontId::proportional(12.5), palette.text);
}
