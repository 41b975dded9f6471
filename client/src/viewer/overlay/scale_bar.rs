//! How long a world unit is in the picture: exact across the view at the pivot's distance.

use egui::{Align2, FontId, Painter, Pos2, Stroke, vec2};

use super::MARGIN;
use crate::viewer::{navigation::Pose, numbers, state::Viewer, theme::Palette};

/// Longest bar, logical pixels.
const LONGEST: f32 = 150.0;

pub fn draw(viewer: &Viewer, painter: &Painter, palette: Palette) {
    let rect = viewer.view_rect;
    let world_per_point = Pose::of(&viewer.camera).height() / f64::from(rect.height());
    let world = numbers::round_below(f64::from(LONGEST) * world_per_point);
    let length = (world / world_per_point) as f32;
    if !(8.0..=LONGEST * 1.1).contains(&length) {
        return;
    }
    // One unit, where all clouds agree.
    let mut units = viewer.open_clouds().map(|(_, cloud)| cloud.crs.unit);
    let first = units.next().flatten();
    let unit = first.filter(|first| units.all(|unit| unit == Some(first)));
    let (world, unit) = match unit {
        Some("m") if world >= 1000.0 => (world / 1000.0, "km"),
        Some("m") if world < 0.01 => (world * 1000.0, "mm"),
        Some("m") if world < 1.0 => (world * 100.0, "cm"),
        Some(unit) => (world, unit),
        None => (world, "units"),
    };
    let left = Pos2::new(rect.left() + MARGIN + 8.0, rect.bottom() - MARGIN - 8.0);
    let right = left + vec2(length, 0.0);
    let label = format!("{} {unit}", numbers::round_text(world));
    let galley = painter.layout_no_wrap(label, FontId::proportional(13.0), palette.text);
    let size = vec2(length.max(galley.size().x) + 18.0, 36.0);
    let shade = egui::Rect::from_min_size(left - vec2(9.0, 26.0), size);
    painter.rect_filled(shade, 7.0, palette.shade);
    let stroke = Stroke::new(2.0, palette.text);
    painter.line_segment([left, right], stroke);
    for end in [left, right] {
        painter.line_segment([end - vec2(0.0, 5.0), end + vec2(0.0, 1.0)], stroke);
    }
    let text = Align2::LEFT_BOTTOM.anchor_size(left - vec2(0.0, 5.0), galley.size());
    painter.galley(text.min, galley, palette.text);
}
