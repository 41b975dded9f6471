//! How much is drawn, and kept.

use egui::Ui;

use super::{field, slider};
use crate::viewer::{Settings, numbers, state::Viewer, theme::Palette};

/// Most points of the slider; the command line may ask for more.
const MOST_POINTS: u64 = 20_000_000;

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let settings = &mut viewer.settings;
    field(ui, palette, "Points", |ui| {
        let most = MOST_POINTS.max(settings.point_budget);
        let slider = slider(&mut settings.point_budget, *Settings::BUDGETS.start()..=most)
            .logarithmic(true)
            .custom_formatter(|points, _| numbers::short(points as u64))
            .custom_parser(points);
        ui.add(slider).on_hover_text("Most points drawn at once, over all clouds")
    });
    field(ui, palette, "Least node", |ui| {
        let slider = slider(&mut settings.min_node_px, Settings::MIN_NODE_PX).logarithmic(true);
        let slider = slider.suffix(" px").max_decimals(0);
        ui.add(slider).on_hover_text("Parts that appear smaller are left out")
    });
    field(ui, palette, "Cache", |ui| {
        let slider = slider(&mut settings.cache_mib, 0..=8192).logarithmic(true);
        ui.add(slider.suffix(" MiB")).on_hover_text("What is kept though it is not drawn")
    });
}

/// `2M`, `500 k`, `1234`.
fn points(text: &str) -> Option<f64> {
    let text = text.trim();
    let (digits, factor) = match text.char_indices().last() {
        Some((at, 'k' | 'K')) => (&text[..at], 1e3),
        Some((at, 'm' | 'M')) => (&text[..at], 1e6),
        _ => (text, 1.0),
    };
    digits.trim().parse::<f64>().ok().map(|number| number * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_typed_as_they_are_shown() {
        assert_eq!(points("2 M"), Some(2e6));
        assert_eq!(points("1.5k"), Some(1500.0));
        assert_eq!(points("1234"), Some(1234.0));
        assert_eq!(points("much"), None);
    }
}
