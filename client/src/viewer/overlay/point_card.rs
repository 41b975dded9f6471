//! The picked point, and what was measured: a card upon the picture, where the eye is.

use egui::{Frame, Margin, RichText, ScrollArea, Stroke, Ui, vec2};

use super::MARGIN;
use crate::viewer::{numbers, panel::row, state::Viewer, theme::Palette};

const WIDTH: f32 = 250.0;

pub fn show(viewer: &mut Viewer, ui: &Ui, palette: Palette) {
    let rect = viewer.view_rect;
    let has_nothing = viewer.picked.is_none() && viewer.measurements.is_empty();
    if has_nothing || rect.width() < 2.0 * WIDTH || rect.height() < 300.0 {
        return;
    }
    let line = Stroke::new(1.0, palette.faint.gamma_multiply(0.35));
    let frame = Frame::new().fill(palette.shade).stroke(line).corner_radius(10);
    egui::Area::new(egui::Id::unique("point"))
        .order(egui::Order::Middle)
        .fixed_pos(rect.min + vec2(MARGIN, MARGIN))
        .show(ui.ctx(), |ui| {
            frame.inner_margin(Margin::symmetric(14, 10)).show(ui, |ui| {
                ui.set_width(WIDTH);
                ui.spacing_mut().item_spacing.y = 3.0;
                let highest = rect.height() - 160.0;
                ScrollArea::vertical().max_height(highest).min_scrolled_height(highest).show(
                    ui,
                    |ui| {
                        show_picked(viewer, ui, palette);
                        show_measured(viewer, ui, palette);
                    },
                );
            });
        });
}

fn show_picked(viewer: &mut Viewer, ui: &mut Ui, palette: Palette) {
    let Some(pick) = viewer.picked.clone() else { return };
    let cloud = &viewer.clouds[pick.point.cloud];
    for (name, text) in ["x", "y", "z"].iter().zip(&pick.point.text) {
        ui.horizontal(|ui| {
            ui.label(RichText::new(*name).color(palette.faint));
            // Until it is known where in its cell the point lies.
            let about = if pick.point.is_exact { "" } else { "≈ " };
            ui.label(RichText::new(format!("{about}{text}")).monospace().size(13.5));
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
    ui.add_space(4.0);
    ui.horizontal(|ui| {
        if ui.button("Copy").on_hover_text("Copy the coordinates").clicked() {
            let context = ui.ctx().clone();
            viewer.copy_text(pick.point.text.join(" "), &context);
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
    if viewer.picked.is_some() && !viewer.measurements.is_empty() {
        ui.separator();
    }
    let mut removed = None;
    for (index, measurement) in viewer.measurements.iter().enumerate() {
        ui.horizontal(|ui| {
            let whole = measurement.distance();
            let distance = numbers::length(whole, whole);
            let more = format!(
                "height {}, across {}",
                numbers::length(measurement.height(), whole),
                numbers::length(measurement.horizontal(), whole)
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
