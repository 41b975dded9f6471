//! What it takes.

use egui::Ui;

use super::row;
use crate::viewer::{numbers, state::Viewer, theme::Palette};

pub fn show(viewer: &Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let mut line = |what: &str, value: String| row(ui, palette, what, value);
    let times = &viewer.frame_times;
    if let (Some(half), Some(most), Some(worst)) =
        (times.percentile_ms(0.5), times.percentile_ms(0.95), times.percentile_ms(0.99))
    {
        line("Frames a second", format!("{:.0}", 1e3 / half.max(1e-3)));
        line("Frame, 50, 95, 99 %", format!("{half:.1}, {most:.1}, {worst:.1} ms"));
    }
    let (plan, stats) = (&viewer.plan, &viewer.stats);
    let totals = &stats.since_start.totals;
    let settled = match (viewer.is_settled(), stats.since_view.settled_ms) {
        (true, Some(ms)) => format!("yes, after {ms:.0} ms"),
        (true, None) => "yes".into(),
        (false, _) => "no".into(),
    };
    line("Complete", settled);
    line("Points", numbers::grouped(viewer.shown.points));
    line("Nodes drawn", numbers::grouped(viewer.statistics.nodes));
    line("Nodes loading", numbers::grouped(plan.left_out.loading.nodes));
    line("Nodes lost", numbers::grouped(plan.left_out.failed.nodes));
    line("Pages loading", numbers::grouped(plan.pages_loading));
    line("Requests", numbers::grouped(totals.requests));
    line("In flight, queued", format!("{}, {}", stats.in_flight, stats.queued));
    line("Repeated, broken off", format!("{}, {}", totals.retries, totals.cancelled));
    line("Received", numbers::bytes(totals.bytes));
    line("In use", numbers::bytes(stats.pinned_bytes));
    line("Cache", numbers::bytes(stats.cached_bytes));
    line("On the GPU", numbers::bytes(viewer.statistics.resident_bytes));
    line("Draw calls", numbers::grouped(viewer.statistics.draw_calls));
}
