//! The panel at the side: a section for each thing that can be set or told.

mod appearance;
mod clip;
mod clouds;
mod detail;
mod left_out;
mod session;
mod statistics;
mod views;

use std::ops::RangeInclusive;

use egui::{
    Align, CollapsingHeader, Frame, Layout, Margin, Panel, RichText, ScrollArea, Slider,
    SliderClamping, Ui,
};

use super::{
    actions::{Action, GESTURES, SHORTCUTS},
    navigation::{Mode, Side},
    numbers,
    settings::Theme,
    state::{Tool, Viewer},
    theme::Palette,
};

/// Width of the panel.
const WIDTH: f32 = 316.0;

/// Width of what is told before widgets.
const LABEL_WIDTH: f32 = 88.0;

/// Narrower windows have no panel: the picture comes first.
const NARROWEST: f32 = 560.0;

/// Lower windows have no bars.
const LOWEST: f32 = 160.0;

/// Shows the bars and the panel; what they leave is the picture's.
pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let size = ui.max_rect().size();
    if size.y >= LOWEST && size.x >= 240.0 {
        top_bar(viewer, ui);
        status_bar(viewer, ui);
    }
    if viewer.settings.panel && size.x >= NARROWEST && size.y >= LOWEST {
        side_panel(viewer, ui);
    }
}

fn top_bar(viewer: &mut Viewer, ui: &mut Ui) {
    let fill = ui.visuals().panel_fill;
    let frame = Frame::new().fill(fill).inner_margin(Margin::symmetric(10, 6));
    Panel::top("bar").frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            let mut action = None;
            let mut button = |ui: &mut Ui, label: &str, tip: &str, does: Action| {
                if ui.button(label).on_hover_text(tip).clicked() {
                    action = Some(does);
                }
            };
            button(
                ui,
                "Open",
                "Open a dataset, a server's list or a session (Ctrl O)",
                Action::Open,
            );
            // What does not fit is left to its keys.
            if ui.available_width() > 360.0 {
                button(ui, "Save", "Save the session (Ctrl S)", Action::Save);
                button(ui, "Picture", "Write the picture as PNG (F12)", Action::Picture);
                ui.separator();
            }
            button(ui, "Fit", "Show all (F)", Action::Fit);
            let room = ui.available_width();
            if room > 780.0 {
                for (index, (side, name)) in Side::ALL.into_iter().enumerate() {
                    let tip = format!("View {} ({})", name.to_lowercase(), index + 1);
                    button(ui, name, &tip, Action::Look(side));
                }
            }
            let toggles = [
                (
                    viewer.navigator.goal().orthographic,
                    "Ortho",
                    "Orthographic (O)",
                    Action::Projection,
                ),
                (
                    viewer.navigator.mode == Mode::Fly,
                    "Fly",
                    "Fly with W A S D E Q (G)",
                    Action::Mode,
                ),
                (
                    viewer.tool != Tool::Pick,
                    "Measure",
                    "Measure between two points (M)",
                    Action::Measure,
                ),
            ];
            if room > 400.0 {
                ui.separator();
                for (is_on, label, tip, does) in toggles {
                    if ui.add(egui::Button::selectable(is_on, label)).on_hover_text(tip).clicked() {
                        action = Some(does);
                    }
                }
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let mut button = |ui: &mut Ui, label: &str, tip: &str, does: Action| {
                    if ui.button(label).on_hover_text(tip).clicked() {
                        action = Some(does);
                    }
                };
                button(ui, "Keys", "All keys (F1)", Action::Help);
                let theme = match viewer.settings.theme {
                    Theme::Dark => "Light",
                    Theme::Light => "Dark",
                };
                button(ui, theme, "Light or dark (T)", Action::Theme);
                button(ui, "Panel", "Panel on or off (F2)", Action::Panel);
            });
            if let Some(action) = action {
                let context = ui.ctx().clone();
                viewer.act(action, &context);
            }
        });
    });
}

fn status_bar(viewer: &Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let fill = ui.visuals().panel_fill;
    let frame = Frame::new().fill(fill).inner_margin(Margin::symmetric(12, 4));
    Panel::bottom("status").frame(frame).show(ui, |ui| {
        ui.horizontal(|ui| {
            let open = viewer.open_clouds().count();
            let opening = viewer.open_clouds().filter(|(_, c)| c.manifest().is_none()).count();
            let (color, text) = if open == 0 {
                (palette.faint, "Nothing is open".into())
            } else if opening > 0 && opening == open {
                (palette.accent, "Opening …".into())
            } else if viewer.is_settled() {
                (palette.good, "Complete".into())
            } else {
                let loading = viewer.plan.left_out.loading.nodes;
                (palette.accent, format!("Loading, {} nodes to come", numbers::grouped(loading)))
            };
            let (dot, _) = ui.allocate_exact_size(egui::vec2(10.0, 18.0), egui::Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.5, color);
            ui.label(text);
            ui.separator();
            let points = format!("{} points", numbers::grouped(viewer.shown.points));
            ui.label(RichText::new(points).color(palette.faint));
            if let Some(export) = &viewer.export {
                let (done, all) = export.progress();
                ui.separator();
                ui.label(
                    RichText::new(format!("Exporting {done} of {all}, Esc ends it"))
                        .color(palette.accent),
                );
            } else if viewer.recorder.is_some() {
                ui.separator();
                ui.label(RichText::new("Recording, R ends it").color(palette.warning));
            } else if viewer.player.is_some() {
                ui.separator();
                ui.label(RichText::new("Playing, Space ends it").color(palette.accent));
            } else if let Tool::Measure(from) = &viewer.tool {
                let text = match from {
                    None => "Measuring: click the first point",
                    Some(_) => "Measuring: click the second point",
                };
                ui.separator();
                ui.label(RichText::new(text).color(palette.warning));
            }
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let name = RichText::new(&viewer.renderer).color(palette.faint).small();
                if ui.available_width() > 60.0 {
                    ui.add(egui::Label::new(name).truncate());
                }
            });
        });
    });
}

fn side_panel(viewer: &mut Viewer, ui: &mut Ui) {
    let fill = ui.visuals().panel_fill;
    let frame =
        Frame::new().fill(fill).inner_margin(Margin { left: 12, right: 4, top: 4, bottom: 4 });
    Panel::left("panel").frame(frame).exact_size(WIDTH).resizable(false).show(ui, |ui| {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.set_max_width(WIDTH - 30.0);
            let opens_clip = std::mem::take(&mut viewer.opens_clip);
            section(ui, "Clouds", true, |ui| clouds::show(viewer, ui));
            section(ui, "Look", true, |ui| appearance::show(viewer, ui));
            section(ui, "Detail", true, |ui| detail::show(viewer, ui));
            let is_clipped = viewer.clip.is_on;
            let clip = header("Clip box", is_clipped).open(opens_clip.then_some(true));
            show_section(ui, clip, |ui| clip::show(viewer, ui));
            section(ui, "Views and paths", false, |ui| views::show(viewer, ui));
            section(ui, "Session", false, |ui| session::show(viewer, ui));
            section(ui, "Statistics", false, |ui| statistics::show(viewer, ui));
            section(ui, "Left out", false, |ui| left_out::show(viewer, ui));
            ui.add_space(8.0);
        });
    });
}

/// A slider that leaves what the command line or a session says as it is, be it beyond its ends.
fn slider<'a, Number: egui::emath::Numeric>(
    value: &'a mut Number,
    range: RangeInclusive<Number>,
) -> Slider<'a> {
    Slider::new(value, range).clamping(SliderClamping::Edits)
}

fn section(ui: &mut Ui, title: &str, is_open: bool, contents: impl FnOnce(&mut Ui)) {
    show_section(ui, header(title, is_open), contents);
}

fn header(title: &str, is_open: bool) -> CollapsingHeader {
    let text = RichText::new(title).strong().size(14.5);
    CollapsingHeader::new(text).id_salt(title).default_open(is_open)
}

fn show_section(ui: &mut Ui, header: CollapsingHeader, contents: impl FnOnce(&mut Ui)) {
    ui.add_space(4.0);
    header.show_unindented(ui, |ui| {
        ui.add_space(1.0);
        contents(ui);
        ui.add_space(5.0);
    });
    ui.separator();
}

/// A line of a table: what, and how much.
pub(super) fn row(ui: &mut Ui, palette: Palette, what: &str, value: impl Into<String>) {
    ui.horizontal(|ui| {
        ui.label(RichText::new(what).color(palette.faint));
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.add(egui::Label::new(value.into()).truncate());
        });
    });
}

/// A line of a table: what, and a widget for it.
fn field<R>(ui: &mut Ui, palette: Palette, what: &str, widget: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let (rect, _) = ui.allocate_exact_size(egui::vec2(LABEL_WIDTH, 24.0), egui::Sense::hover());
        let label = egui::Label::new(RichText::new(what).color(palette.faint)).truncate();
        let place =
            egui::UiBuilder::new().max_rect(rect).layout(Layout::left_to_right(Align::Center));
        ui.new_child(place).add(label);
        widget(ui)
    })
    .inner
}

/// Shows all keys, if that is wanted.
pub fn show_help(viewer: &mut Viewer, context: &egui::Context) {
    if !viewer.shows_help {
        return;
    }
    let palette = Palette::of(viewer.settings.theme);
    let mut is_open = true;
    let middle = viewer.view_rect.center() - context.content_rect().center();
    egui::Window::new("Keys")
        .open(&mut is_open)
        .collapsible(false)
        .resizable(false)
        .anchor(egui::Align2::CENTER_CENTER, middle)
        .show(context, |ui| {
            let line = |ui: &mut Ui, key: &str, does: &str| {
                ui.label(RichText::new(key).color(palette.accent));
                ui.label(does);
                ui.end_row();
            };
            let tables = |ui: &mut Ui| {
                ui.horizontal_top(|ui| {
                    egui::Grid::new("gestures").spacing([16.0, 5.0]).show(ui, |ui| {
                        GESTURES.iter().for_each(|(key, does)| line(ui, key, does));
                    });
                    // '=' is where '+' is on many keyboards: not worth a line.
                    let told: Vec<_> = SHORTCUTS.iter().filter(|s| s.name != "=").collect();
                    for (index, half) in told.chunks(told.len().div_ceil(2)).enumerate() {
                        ui.add_space(18.0);
                        egui::Grid::new(("keys", index)).spacing([16.0, 5.0]).show(ui, |ui| {
                            half.iter().for_each(|s| line(ui, s.name, s.does));
                        });
                    }
                });
            };
            let room = context.content_rect().size() - egui::vec2(80.0, 130.0);
            ScrollArea::vertical().min_scrolled_height(room.y).max_height(room.y).show(ui, tables);
        });
    viewer.shows_help &= is_open;
}
