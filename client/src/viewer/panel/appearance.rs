//! What pictures look like.

use egui::{ComboBox, DragValue, Ui};

use super::{field, slider};
use crate::{
    render::{ColorMode, EyeDome, LARGEST_SPLAT_PX, SMALLEST_SPLAT_PX, Splat, SplatSize},
    viewer::{navigation::Pose, state::Viewer, theme::Palette},
};

/// Kinds of sizes.
const KINDS: [&str; 5] = ["pixels", "world units", "by level", "adaptive", "own"];

pub fn show(viewer: &mut Viewer, ui: &mut Ui) {
    let palette = Palette::of(viewer.settings.theme);
    // Sizes in world units begin with what two pixels are now.
    let pixel = Pose::of(&viewer.camera).height() / f64::from(viewer.size_px[1]);
    let look = &mut viewer.settings.look;
    field(ui, palette, "Colour", |ui| {
        ComboBox::from_id_salt("look color").selected_text(look.color.name()).show_ui(ui, |ui| {
            for mode in ColorMode::ALL {
                ui.selectable_value(&mut look.color, mode, mode.name());
            }
        });
    });
    field(ui, palette, "Splat", |ui| {
        ComboBox::from_id_salt("splat").selected_text(look.splat.name()).height(400.0).show_ui(
            ui,
            |ui| {
                for (splat, name) in Splat::ALL {
                    ui.selectable_value(&mut look.splat, splat, name);
                }
            },
        );
    });
    field(ui, palette, "Size", |ui| {
        let now = kind(look.splat_size);
        let mut chosen = now;
        ComboBox::from_id_salt("size kind").selected_text(KINDS[now]).show_ui(ui, |ui| {
            for (index, name) in KINDS.iter().enumerate() {
                ui.selectable_value(&mut chosen, index, *name);
            }
        });
        if chosen != now {
            look.splat_size = match chosen {
                0 => SplatSize::Pixels(2.0),
                1 => SplatSize::World(2.0 * pixel),
                2 => SplatSize::Level(1.6),
                3 => SplatSize::Adaptive(1.6),
                _ => SplatSize::Own,
            };
        }
    });
    match &mut look.splat_size {
        SplatSize::Pixels(px) => {
            field(ui, palette, "", |ui| {
                ui.add(slider(px, 1.0..=32.0).logarithmic(true).suffix(" px"))
            });
        }
        SplatSize::World(size) => {
            let speed = (0.01 * *size).max(1e-9);
            field(ui, palette, "", |ui| {
                ui.add(
                    DragValue::new(size)
                        .speed(speed)
                        .range(1e-9..=1e9)
                        .clamp_existing_to_range(false)
                        .suffix(" units"),
                )
            });
        }
        SplatSize::Level(times) | SplatSize::Adaptive(times) => {
            field(ui, palette, "", |ui| {
                ui.add(slider(times, 0.2..=8.0).logarithmic(true).suffix(" x"))
            });
        }
        SplatSize::Own => {}
    }
    field(ui, palette, "At least, most", |ui| {
        let (least, most) = (look.min_splat_px, look.max_splat_px);
        ui.add(
            DragValue::new(&mut look.min_splat_px)
                .range(SMALLEST_SPLAT_PX..=most)
                .speed(0.1)
                .suffix(" px"),
        );
        ui.add(
            DragValue::new(&mut look.max_splat_px)
                .range(least..=LARGEST_SPLAT_PX)
                .speed(1.0)
                .suffix(" px"),
        );
    });
    field(ui, palette, "Light", |ui| {
        ui.checkbox(&mut look.phong, "normals").on_hover_text("Phong's, where points have normals");
        ui.checkbox(&mut look.eye_dome, "eye-dome").on_hover_text("By steps of depth (L)");
    });
    if look.eye_dome {
        field(ui, palette, "Strength", |ui| ui.add(slider(&mut look.edl_strength, 0.0..=2.0)));
        field(ui, palette, "Radius", |ui| {
            let largest = EyeDome::LARGEST_RADIUS_PX;
            let radius = slider(&mut look.edl_radius_px, 1.0..=largest).logarithmic(true);
            ui.add(radius.suffix(" px"))
        });
    }
}

fn kind(size: SplatSize) -> usize {
    match size {
        SplatSize::Pixels(_) => 0,
        SplatSize::World(_) => 1,
        SplatSize::Level(_) => 2,
        SplatSize::Adaptive(_) => 3,
        SplatSize::Own => 4,
    }
}
