//! How the window looks: spacing, corners, colours, dark and light.

use egui::{Color32, CornerRadius, FontFamily, FontId, Margin, Stroke, TextStyle, Visuals};

use super::settings::Theme;

/// Colours that both themes have, each in its own shade.
#[derive(Debug, Clone, Copy)]
pub struct Palette {
    /// What is chosen, and what can be pressed.
    pub accent: Color32,
    /// Text.
    pub text: Color32,
    /// Text that matters less.
    pub faint: Color32,
    /// Things that are well.
    pub good: Color32,
    /// Things to look after.
    pub warning: Color32,
    /// Upon the picture: behind text.
    pub shade: Color32,
}

impl Palette {
    /// Of a theme.
    #[must_use]
    pub const fn of(theme: Theme) -> Self {
        match theme {
            Theme::Dark => Self {
                accent: Color32::from_rgb(92, 168, 255),
                text: Color32::from_rgb(226, 229, 236),
                faint: Color32::from_rgb(146, 152, 166),
                good: Color32::from_rgb(104, 204, 148),
                warning: Color32::from_rgb(245, 182, 92),
                shade: Color32::from_rgba_premultiplied(18, 19, 24, 215),
            },
            Theme::Light => Self {
                accent: Color32::from_rgb(18, 98, 205),
                text: Color32::from_rgb(30, 34, 42),
                faint: Color32::from_rgb(98, 105, 120),
                good: Color32::from_rgb(20, 128, 76),
                warning: Color32::from_rgb(168, 92, 0),
                shade: Color32::from_rgba_premultiplied(226, 228, 232, 226),
            },
        }
    }
}

/// Makes the context look like the theme.
pub fn apply(context: &egui::Context, theme: Theme) {
    context.set_theme(match theme {
        Theme::Dark => egui::Theme::Dark,
        Theme::Light => egui::Theme::Light,
    });
    context.set_visuals_of(
        match theme {
            Theme::Dark => egui::Theme::Dark,
            Theme::Light => egui::Theme::Light,
        },
        visuals(theme),
    );
    // As desktops have it: where frames take long, 0.3 s are over before the second click is seen.
    context.options_mut(|options| options.input_options.max_double_click_delay = 0.5);
    context.all_styles_mut(|style| {
        let text = |size| FontId::new(size, FontFamily::Proportional);
        style.text_styles = [
            (TextStyle::Small, text(11.5)),
            (TextStyle::Body, text(14.0)),
            (TextStyle::Button, text(14.0)),
            (TextStyle::Heading, text(17.0)),
            (TextStyle::Monospace, FontId::new(12.5, FontFamily::Monospace)),
        ]
        .into();
        let spacing = &mut style.spacing;
        spacing.item_spacing = egui::vec2(8.0, 6.0);
        spacing.button_padding = egui::vec2(9.0, 4.0);
        spacing.interact_size = egui::vec2(36.0, 24.0);
        spacing.slider_width = 104.0;
        spacing.slider_rail_height = 5.0;
        spacing.combo_width = 128.0;
        spacing.indent = 14.0;
        spacing.icon_width = 16.0;
        spacing.icon_width_inner = 9.0;
        spacing.window_margin = Margin::same(14);
        spacing.menu_margin = Margin::same(8);
        spacing.tooltip_width = 320.0;
        style.interaction.tooltip_delay = 0.5;
        style.animation_time = 0.1;
    });
}

fn visuals(theme: Theme) -> Visuals {
    let palette = Palette::of(theme);
    let mut visuals = match theme {
        Theme::Dark => Visuals::dark(),
        Theme::Light => Visuals::light(),
    };
    let grey = |dark: u8, light: u8| match theme {
        Theme::Dark => Color32::from_rgb(dark, dark + 1, dark + 5),
        Theme::Light => Color32::from_rgb(light, light, light.saturating_add(2)),
    };
    let (panel, field) = (grey(28, 249), grey(20, 255));
    let (rest, hover, press) = (grey(44, 234), grey(56, 224), grey(66, 212));
    let line = grey(48, 218);
    visuals.panel_fill = panel;
    visuals.window_fill = grey(32, 252);
    visuals.window_stroke = Stroke::new(1.0, line);
    visuals.window_corner_radius = CornerRadius::same(10);
    visuals.menu_corner_radius = CornerRadius::same(8);
    visuals.extreme_bg_color = field;
    visuals.text_edit_bg_color = Some(field);
    visuals.faint_bg_color = grey(33, 243);
    visuals.hyperlink_color = palette.accent;
    visuals.warn_fg_color = palette.warning;
    visuals.weak_text_color = Some(palette.faint);
    visuals.selection.bg_fill = match theme {
        Theme::Dark => Color32::from_rgb(38, 84, 140),
        Theme::Light => Color32::from_rgb(188, 216, 250),
    };
    visuals.selection.stroke = Stroke::new(1.0, palette.text);
    visuals.slider_trailing_fill = true;
    visuals.indent_has_left_vline = false;
    let corner = CornerRadius::same(6);
    let widgets = &mut visuals.widgets;
    for (widget, fill, text) in [
        (&mut widgets.noninteractive, panel, palette.text),
        (&mut widgets.inactive, rest, palette.text),
        (&mut widgets.hovered, hover, palette.text),
        (&mut widgets.active, press, palette.text),
        (&mut widgets.open, hover, palette.text),
    ] {
        widget.bg_fill = fill;
        widget.weak_bg_fill = fill;
        widget.fg_stroke = Stroke::new(1.2, text);
        widget.corner_radius = corner;
        widget.expansion = 0.0;
        widget.bg_stroke = Stroke::NONE;
    }
    widgets.noninteractive.bg_stroke = Stroke::new(1.0, line);
    widgets.hovered.bg_stroke = Stroke::new(1.0, palette.accent.gamma_multiply(0.6));
    widgets.active.bg_stroke = Stroke::new(1.0, palette.accent);
    visuals
}
