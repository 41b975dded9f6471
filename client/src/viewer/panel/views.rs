//! Bookmarks and camera paths.

use egui::{Button, DragValue, RichText, TextEdit, Ui};

use crate::viewer::{actions::Action, export::MOST_FRAMES, state::Viewer, theme::Palette};

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    bookmarks(viewer, ui);
    ui.add_space(4.0);
    path(viewer, ui, palette);
}

fn bookmarks(viewer: &mut Viewer, ui: &mut Ui) {
    let (mut go, mut remove) = (None, None);
    for (index, bookmark) in viewer.bookmarks.iter().enumerate() {
        ui.horizontal(|ui| {
            if ui.add(Button::new(&bookmark.name).truncate()).clicked() {
                go = Some(bookmark.camera);
            }
            if ui.small_button("x").on_hover_text("Remove").clicked() {
                remove = Some(index);
            }
        });
    }
    if let Some(camera) = go {
        viewer.take_over();
        viewer.navigator.go(&camera);
    }
    if let Some(index) = remove {
        viewer.bookmarks.remove(index);
    }
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut viewer.fields.bookmark);
        ui.add(field.hint_text("Name of the view").desired_width(150.0));
        if ui.button("Keep view").on_hover_text("Keep this view (B)").clicked() {
            viewer.add_bookmark();
        }
    });
}

fn path(viewer: &mut Viewer, ui: &mut Ui, palette: Palette) {
    let context = ui.ctx().clone();
    ui.horizontal(|ui| {
        let record = if viewer.recorder.is_some() { "Stop" } else { "Record" };
        if ui.button(record).on_hover_text("Record a camera path (R)").clicked() {
            viewer.act(Action::Record, &context);
        }
        let play = if viewer.player.is_some() { "Stop playing" } else { "Play" };
        let button = ui.add_enabled(viewer.path.is_some(), Button::new(play));
        if button.on_hover_text("Play the camera path (Space)").clicked() {
            viewer.act(Action::Play, &context);
        }
        if let Some(path) = &viewer.path {
            let text = format!("{:.1} s, {} keys", path.duration(), path.keys().len());
            ui.label(RichText::new(text).color(palette.faint).small());
        }
    });
    let has_path = viewer.path.is_some();
    ui.horizontal(|ui| {
        ui.add(TextEdit::singleline(&mut viewer.fields.path).desired_width(150.0));
        if ui.add_enabled(has_path, Button::new("Save")).on_hover_text("Save the path").clicked() {
            viewer.save_path();
        }
        if ui.button("Load").on_hover_text("Open a path").clicked() {
            viewer.open_path();
        }
    });
    ui.horizontal(|ui| {
        ui.add(TextEdit::singleline(&mut viewer.fields.export).desired_width(120.0));
        ui.add(DragValue::new(&mut viewer.fields.export_frames).range(1..=MOST_FRAMES));
        let label = if viewer.export.is_some() { "Stop" } else { "Export" };
        let tip = "So many pictures along the path, each complete, into this folder";
        if ui.add_enabled(has_path, Button::new(label)).on_hover_text(tip).clicked() {
            if viewer.export.is_some() {
                viewer.end_export();
            } else {
                viewer.start_export();
            }
        }
    });
}
