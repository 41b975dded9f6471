//! The session's file.

use std::path::PathBuf;

use egui::{TextEdit, Ui};

use crate::viewer::state::Viewer;

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    ui.add(TextEdit::singleline(&mut viewer.fields.session).desired_width(f32::INFINITY));
    let file = PathBuf::from(viewer.fields.session.trim());
    ui.horizontal(|ui| {
        let tip = "Clouds, camera, look, bookmarks and measurements (Ctrl S)";
        if ui.button("Save session").on_hover_text(tip).clicked() {
            viewer.save_session(&file);
        }
        if ui.button("Open session").clicked() {
            viewer.open_session(&file);
        }
    });
}
