//! What the view leaves out, and why.

use egui::{RichText, Ui};

use super::row;
use crate::{
    engine::Tally,
    viewer::{numbers, state::Viewer, theme::Palette},
};

pub fn show(viewer: &Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let left_out = &viewer.plan.left_out;
    let reasons: [(&str, Tally); 6] = [
        ("Outside the picture", left_out.outside),
        ("Outside the clip box", left_out.clipped),
        ("Too small", left_out.small),
        ("Over the budget", left_out.over_budget),
        ("Behind others", left_out.hidden),
        ("Lost", left_out.failed),
    ];
    ui.label(RichText::new("Nodes, and points in them").color(palette.faint).small());
    for (reason, tally) in reasons {
        let value = format!("{}, {}", numbers::grouped(tally.nodes), numbers::short(tally.points));
        row(ui, palette, reason, value);
    }
    if viewer.shown.left_out > 0 {
        row(ui, palette, "Points clipped or off", numbers::short(viewer.shown.left_out));
    }
    let skipped: Vec<_> = viewer
        .open_clouds()
        .filter_map(|(_, cloud)| {
            let manifest = cloud.manifest()?;
            let names = manifest
                .groups
                .iter()
                .enumerate()
                .skip(1)
                .filter(|(index, _)| !viewer.is_fetched(manifest, *index));
            let (mut bytes, mut list) = (0u64, Vec::new());
            for (_, group) in names {
                bytes = bytes.saturating_add(group.bytes());
                list.push(group.name.as_str());
            }
            (!list.is_empty()).then(|| (cloud.name().to_owned(), list.join(", "), bytes))
        })
        .collect();
    if !skipped.is_empty() {
        ui.add_space(4.0);
        ui.label(RichText::new("Attributes that are not fetched").color(palette.faint).small());
    }
    for (cloud, list, bytes) in skipped {
        let line = ui.label(format!("{cloud}: {}", numbers::bytes(bytes)));
        line.on_hover_text(list);
    }
}
