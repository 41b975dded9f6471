//! What is open: shown or not, coloured how, which classes.

use std::collections::BTreeSet;

use egui::{
    Align, Button, ComboBox, Layout, PopupCloseBehavior, RichText, Role, ScrollArea, Ui,
    WidgetInfo,
    containers::menu::{MenuButton, MenuConfig},
};

use crate::{
    render::ColorMode,
    viewer::{
        actions::Action, clouds::Cloud, numbers, point_values::class_name, state::Viewer,
        theme::Palette,
    },
};

/// Highest list before it scrolls.
const HIGHEST: f32 = 300.0;

/// What is to be done with a cloud.
enum Wish {
    Visible(bool),
    Color(Option<ColorMode>),
    Classes(BTreeSet<u8>),
    Frame,
    Reopen,
    Close,
}

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    let mut wishes = Vec::new();
    if viewer.open_clouds().next().is_none() {
        ui.label(RichText::new("Nothing is open").color(palette.faint));
    }
    ScrollArea::vertical().id_salt("clouds").max_height(HIGHEST).show(ui, |ui| {
        for (number, cloud) in viewer.open_clouds() {
            if let Some(wish) = show_cloud(number, cloud, ui, palette) {
                wishes.push((number, wish));
            }
        }
    });
    if ui.button("Open another").clicked() {
        let context = ui.ctx().clone();
        viewer.act(Action::Open, &context);
    }
    for (number, wish) in wishes {
        match wish {
            Wish::Visible(is_visible) => viewer.set_visible(number, is_visible),
            Wish::Color(color) => viewer.clouds[number].color = color,
            Wish::Classes(hidden) => viewer.clouds[number].hidden_classes = hidden,
            Wish::Reopen => viewer.engine.reopen(number),
            Wish::Close => viewer.close(number),
            Wish::Frame => {
                if let Some((min, max)) = viewer.clouds[number].bounds() {
                    viewer.take_over();
                    viewer.navigator.frame(min, max, viewer.aspect());
                }
            }
        }
    }
}

fn show_cloud(number: usize, cloud: &Cloud, ui: &mut Ui, palette: Palette) -> Option<Wish> {
    let mut wish = None;
    ui.horizontal(|ui| {
        let mut is_visible = cloud.is_visible;
        let shown = ui.checkbox(&mut is_visible, "").on_hover_text("Shown or not");
        // What stands beside it for eyes, for assistive technology.
        let title = || format!("Show {}", cloud.name());
        shown.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, cloud.is_visible, title()));
        if shown.changed() {
            wish = Some(Wish::Visible(is_visible));
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let more = ui.menu_button("…", |ui| {
                if ui.button("Show all of it").clicked() {
                    wish = Some(Wish::Frame);
                }
                if ui.button("Read again").clicked() {
                    wish = Some(Wish::Reopen);
                }
                if ui.button("Close").clicked() {
                    wish = Some(Wish::Close);
                }
            });
            more.response.widget_info(|| labeled(Role::Button, "More of", cloud));
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let name =
                    Button::new(RichText::new(cloud.name()).strong()).frame(false).truncate();
                if ui.add(name).on_hover_text(&cloud.source).clicked() {
                    wish = Some(Wish::Frame);
                }
            });
        });
    });
    let (told, color) = match (&cloud.status.failure, &cloud.status.trouble, cloud.manifest()) {
        (Some(failure), ..) => (failure.clone(), palette.warning),
        (None, Some(trouble), _) => (format!("{trouble}. Trying again"), palette.warning),
        (None, None, Some(manifest)) => {
            let points = numbers::short(manifest.points);
            (format!("{points} points, {}", cloud.crs.title()), palette.faint)
        }
        (None, None, None) => ("opening …".into(), palette.faint),
    };
    let is_trouble = color == palette.warning;
    let told = RichText::new(told).color(color).small();
    ui.add(if is_trouble {
        egui::Label::new(told).wrap()
    } else {
        egui::Label::new(told).truncate()
    });
    if cloud.status.failure.is_some() && ui.small_button("Try again").clicked() {
        wish = Some(Wish::Reopen);
    }
    let Some(manifest) = cloud.manifest() else { return wish };
    ui.horizontal(|ui| {
        let title = cloud.color.map_or("as in Look", ColorMode::name);
        let colors = ComboBox::from_id_salt(("color", number))
            .selected_text(title)
            .width(130.0)
            .show_ui(ui, |ui| {
                if ui.selectable_label(cloud.color.is_none(), "as in Look").clicked() {
                    wish = Some(Wish::Color(None));
                }
                for mode in ColorMode::ALL.into_iter().filter(|mode| *mode != ColorMode::Density) {
                    if ui.selectable_label(cloud.color == Some(mode), mode.name()).clicked() {
                        wish = Some(Wish::Color(Some(mode)));
                    }
                }
            });
        colors.response.widget_info(|| labeled(Role::ComboBox, "Colour of", cloud));
        if let Some(range) = class_range(manifest) {
            let hidden = cloud.hidden_classes.len();
            let title =
                if hidden == 0 { "Classes".into() } else { format!("Classes, {hidden} off") };
            // Several classes are switched in one go.
            let stays = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            let (button, _) = MenuButton::new(title).config(stays).ui(ui, |ui| {
                // Beside the names, not over them.
                ui.spacing_mut().scroll.floating_allocated_width = 10.0;
                ScrollArea::vertical().max_height(320.0).show(ui, |ui| {
                    let mut classes = cloud.hidden_classes.clone();
                    for class in range {
                        let mut is_shown = !classes.contains(&class);
                        let name = class_name(f64::from(class)).unwrap_or("");
                        if ui.checkbox(&mut is_shown, format!("{class}  {name}")).changed() {
                            if is_shown {
                                classes.remove(&class);
                            } else {
                                classes.insert(class);
                            }
                        }
                    }
                    if classes != cloud.hidden_classes {
                        wish = Some(Wish::Classes(classes));
                    }
                });
            });
            button.widget_info(|| labeled(Role::Button, "Classes of", cloud));
        }
    });
    ui.add_space(4.0);
    wish
}

/// What stands beside a widget for eyes, for assistive technology.
fn labeled(role: Role, what: &str, cloud: &Cloud) -> WidgetInfo {
    WidgetInfo::labeled(role, true, format!("{what} {}", cloud.name()))
}

/// Classes that a cloud may have.
fn class_range(manifest: &lodestream_protocol::Manifest) -> Option<std::ops::RangeInclusive<u8>> {
    let attribute = manifest.attribute("classification")?;
    let (low, high) = (*attribute.min.first()?, *attribute.max.first()?);
    // Casts saturate: beyond 255 there are no classes.
    (low <= high).then_some(low as u8..=high as u8)
}
