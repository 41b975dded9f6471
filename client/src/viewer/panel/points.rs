//! The picked point, and what was measured.

use egui::{RichText, Ui};

use super::row;
use crate::viewer::{numbers, theme::Palette, viewer::Viewer};

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    show_picked(viewer, ui, palette);
    show_measured(viewer, ui, palette);
}

fn show_picked(viewer: &mut Viewer, ui: &mut Ui, palette: Palette) {
    let Some(pick) = viewer.picked.clone() else {
        let text = "Click a point for its coordinates and values";
        ui.label(RichText::new(text).color(palette.faint).small());
        return;
    };
    let cloud = &viewer.clouds[pick.point.cloud];
    for (name, text) in ["x", "y", "z"].iter().zip(&pick.point.text) {
        ui.horizontal(|ui| {
            ui.label(RichText::new(*name).color(palette.faint));
            ui.label(RichText::new(text).monospace().size(13.5));
        });
    }
    ui.label(RichText::new(cloud.crs.title()).color(palette.faint).small());
    row(ui, palette, "Cloud", cloud.name());
    row(ui, palette, "Level", pick.point.key.level().to_string());
    match &pick.values {
        None => {
            ui.label(RichText::new("Fetching its values …").color(palette.faint));
        }
        Some(Err(error)) => {
            ui.add(egui::Label::new(RichText::new(error).color(palette.warning).small()).wrap());
        }
        Some(Ok(values)) => values.iter().for_each(|(name, value)| row(ui, palette, name, value)),
    }
    ui.horizontal(|ui| {
        if ui.button("Copy").on_hover_text("Copy the coordinates (Ctrl C)").clicked() {
            let context = ui.ctx().clone();
            viewer.copy(&context);
        }
        if ui.button("Turn around it").clicked() {
            viewer.take_over();
            viewer.navigator.set_pivot(pick.point.place());
        }
        if ui.button("Forget").clicked() {
            viewer.picked = None;
        }
    });
}

fn show_measured(viewer: &mut Viewer, ui: &mut Ui, palette: Palette) {
    let mut removed = None;
    for (index, measurement) in viewer.measurements.iter().enumerate() {
        ui.horizontal(|ui| {
            let distance = numbers::length(measurement.distance());
            let more = format!(
                "height {}, across {}",
                numbers::length(measurement.height()),
                numbers::length(measurement.horizontal())
            );
            ui.label(RichText::new(distance).color(palette.warning));
            ui.label(RichText::new(more).color(palette.faint).small());
            if ui.small_button("x").on_hover_text("Remove").clicked() {
                removed = Some(index);
            }
        });
    }
    if let Some(index) = removed {
        viewer.measurements.remove(index);
    }
}
