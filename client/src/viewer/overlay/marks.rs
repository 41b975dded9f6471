//! The picked point, and what was measured.

use egui::{Align2, Color32, Painter, Pos2, Stroke, vec2};
use glam::DVec3;

use super::Projector;
use crate::viewer::{
    measurement::Measurement,
    numbers,
    state::{Tool, Viewer},
    theme::Palette,
};

pub fn draw(viewer: &Viewer, painter: &Painter, projector: &Projector, palette: Palette) {
    for measurement in &viewer.measurements {
        draw_measurement(measurement, painter, projector, palette);
    }
    if let Tool::Measure(Some(from)) = viewer.tool
        && let Some(at) = projector.place(from.into())
    {
        dot(painter, at, palette.warning);
    }
    if let Some(pick) = &viewer.picked
        && let Some(at) = projector.place(pick.point.place())
    {
        let stroke = Stroke::new(3.5, Color32::from_black_alpha(170));
        painter.circle_stroke(at, 7.0, stroke);
        painter.circle_stroke(at, 7.0, Stroke::new(1.8, palette.accent));
        painter.circle_filled(at, 2.0, palette.accent);
    }
}

fn dot(painter: &Painter, at: Pos2, color: Color32) {
    painter.circle_filled(at, 5.5, Color32::from_black_alpha(170));
    painter.circle_filled(at, 4.0, color);
}

fn draw_measurement(
    measurement: &Measurement,
    painter: &Painter,
    projector: &Projector,
    palette: Palette,
) {
    let (from, to) = (DVec3::from(measurement.from), DVec3::from(measurement.to));
    let Some(line) = projector.line(from, to) else { return };
    painter.line_segment(line, Stroke::new(4.0, Color32::from_black_alpha(150)));
    painter.line_segment(line, Stroke::new(2.0, palette.warning));
    for end in [from, to].into_iter().filter_map(|place| projector.place(place)) {
        dot(painter, end, palette.warning);
    }
    let label = format!(
        "{}   height {}",
        numbers::length(measurement.distance(), measurement.distance()),
        numbers::length(measurement.height(), measurement.distance())
    );
    let at = line[0].lerp(line[1], 0.5) - vec2(0.0, 12.0);
    super::text(painter, at, Align2::CENTER_BOTTOM, &label, 13.0, palette);
}
