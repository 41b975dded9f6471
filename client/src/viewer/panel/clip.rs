//! The box that limits the view.

use egui::{RangeSlider, Ui};

use super::field;
use crate::{
    engine::ClipBox,
    viewer::{state::Viewer, theme::Palette},
};

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let mut is_on = viewer.clip.is_on;
    if ui.checkbox(&mut is_on, "Clip").on_hover_text("Show what is in the box only (C)").changed() {
        viewer.set_clipping(is_on);
    }
    let Some((low, high)) = viewer.extent() else { return };
    let Some(mut clip) = viewer.clip.bounds.filter(|_| viewer.clip.is_on) else { return };
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        // Relative to the lowest corner: what is shown of large coordinates is short.
        let extent = (high[axis] - low[axis]).max(1e-9);
        let mut from = clip.min[axis] - low[axis];
        let mut to = clip.max[axis] - low[axis];
        let range = from.min(0.0)..=to.max(extent);
        let decimals = (3.0 - extent.log10().floor()).clamp(0.0, 9.0) as usize;
        let response =
            field(ui, palette, &format!("{name} from {}", low[axis].round() as i64), |ui| {
                ui.spacing_mut().slider_width = 72.0;
                ui.add(RangeSlider::new(&mut from, &mut to, range).max_decimals(decimals))
            });
        if response.changed() {
            (clip.min[axis], clip.max[axis]) = (low[axis] + from, low[axis] + to.max(from));
        }
    }
    viewer.clip.bounds = Some(clip);
    ui.horizontal(|ui| {
        if ui.button("All").on_hover_text("The box of all clouds").clicked() {
            viewer.clip.bounds = Some(ClipBox { min: low, max: high });
        }
        let picked = viewer.picked.as_ref().map(|pick| pick.point.place());
        let around = ui.add_enabled(picked.is_some(), egui::Button::new("Around the point"));
        if let Some(place) = picked.filter(|_| around.clicked()) {
            let half = glam::DVec3::splat(0.1 * (high - low).max_element());
            viewer.clip.bounds = Some(ClipBox { min: place - half, max: place + half });
        }
    });
}
