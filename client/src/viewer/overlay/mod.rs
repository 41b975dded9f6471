//! What is drawn upon the picture: scale, axes, north, what was picked and measured, messages.

mod axes;
mod clip_edges;
mod marks;
mod message_lines;
mod north;
mod point_card;
mod projector;
mod scale_bar;

use egui::{Color32, FontId, Painter, Pos2, Ui};

use super::{state::Viewer, theme::Palette};
use projector::Projector;

/// Between what is drawn and the edges of the picture.
const MARGIN: f32 = 16.0;

/// Draws all of it.
pub fn show(viewer: &mut Viewer, ui: &mut Ui, palette: Palette) {
    let rect = viewer.view_rect;
    // Upon less there is no room for anything but the picture.
    if rect.width() < 160.0 || rect.height() < 120.0 {
        return;
    }
    let painter = ui.painter_at(rect);
    let projector = Projector::new(&viewer.camera, rect);
    let has_points = viewer.open_clouds().any(|(_, cloud)| cloud.bounds().is_some());
    if has_points {
        if let Some(clip) = viewer.clip.active() {
            clip_edges::draw(&painter, &projector, &clip, palette);
        }
        marks::draw(viewer, &painter, &projector, palette);
        scale_bar::draw(viewer, &painter, palette);
        axes::draw(viewer, &painter, palette);
        north::draw(viewer, &painter, palette);
    }
    point_card::show(viewer, ui, palette);
    message_lines::show(viewer, ui, palette);
}

/// Text upon the picture, readable whatever is behind it.
fn text(
    painter: &Painter,
    at: Pos2,
    anchor: egui::Align2,
    text: &str,
    size: f32,
    palette: Palette,
) {
    let galley = painter.layout_no_wrap(text.into(), FontId::proportional(size), palette.text);
    let rect = anchor.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand2(egui::vec2(6.0, 3.0)), 5.0, palette.shade);
    painter.galley(rect.min, galley, Color32::WHITE);
}
