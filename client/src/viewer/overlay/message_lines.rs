//! What is told, at the foot of the picture.

use egui::{Align2, Frame, Margin, RichText, Stroke, Ui, vec2};

use crate::viewer::{messages::Weight, state::Viewer, theme::Palette};

/// Widest line.
const WIDEST: f32 = 560.0;

pub fn show(viewer: &mut Viewer, ui: &Ui, palette: Palette) {
    let rect = viewer.view_rect;
    let standing = standing(viewer);
    let (lines, next) = viewer.messages.current();
    if let Some(next) = next {
        ui.ctx().request_repaint_after(next);
    }
    if standing.is_empty() && lines.is_empty() {
        return;
    }
    let mut dismissed = None;
    let at = rect.center_bottom() - vec2(0.0, 14.0);
    egui::Area::new(egui::Id::unique("messages"))
        .order(egui::Order::Middle)
        .pivot(Align2::CENTER_BOTTOM)
        .fixed_pos(at)
        .show(ui.ctx(), |ui| {
            ui.set_max_width(WIDEST.min(rect.width() - 120.0).max(120.0));
            for text in &standing {
                line(ui, palette, text, Weight::Warning);
            }
            for (index, message) in lines.iter().enumerate() {
                if line(ui, palette, &message.text, message.weight).clicked() {
                    dismissed = Some(index);
                }
            }
        });
    if let Some(index) = dismissed {
        viewer.messages.dismiss(index);
    }
}

/// What is told as long as it is so: clouds that cannot be had at the moment.
fn standing(viewer: &Viewer) -> Vec<String> {
    const MOST: usize = 3;
    let troubles = viewer.open_clouds().filter_map(|(_, cloud)| {
        let status = &cloud.status;
        match (&status.failure, &status.trouble) {
            (Some(failure), _) => Some(failure.clone()),
            (None, Some(trouble)) => Some(format!("{trouble}. Trying again")),
            (None, None) => None,
        }
    });
    let mut lines: Vec<String> = troubles.take(MOST + 1).collect();
    if lines.len() > MOST {
        lines.truncate(MOST);
        lines.push("and more: see the list of clouds".into());
    }
    lines
}

fn line(ui: &mut Ui, palette: Palette, text: &str, weight: Weight) -> egui::Response {
    let color = match weight {
        Weight::Note => palette.good,
        Weight::Warning => palette.warning,
    };
    let frame = Frame::new()
        .fill(palette.shade)
        .stroke(Stroke::new(1.0, color.gamma_multiply(0.5)))
        .corner_radius(8)
        .inner_margin(Margin::symmetric(12, 7));
    let response = frame.show(ui, |ui| {
        ui.horizontal(|ui| {
            let (dot, _) = ui.allocate_exact_size(vec2(8.0, 16.0), egui::Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.0, color);
            ui.add(egui::Label::new(RichText::new(text).color(palette.text)).wrap());
        });
    });
    response.response.interact(egui::Sense::click())
}
