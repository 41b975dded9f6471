//! The part of the window that shows the picture, and what hands do there.

use egui::{Event, PointerButton, Rect, Response, Sense, Ui, Vec2};
use glam::{DVec2, DVec3};

use super::{
    navigation::{Mode, Walk},
    overlay,
    picking::{self, Picked},
    state::Viewer,
    theme::Palette,
};
use crate::render::LARGEST_SIDE_PX;

/// Logical pixels of scrolling that are a turn of the wheel.
const WHEEL_POINTS: f64 = 40.0;

/// Longest time that a step of walking may take: after a stall nobody is thrown across the scene.
const LONGEST_STEP: f64 = 0.1;

/// A hand that holds a button down.
#[derive(Debug, Clone, Copy)]
pub struct Drag {
    /// Where it is.
    at: egui::Pos2,
    button: PointerButton,
    /// Whether it turns the camera; else it moves along the picture.
    turns: bool,
}

impl Viewer {
    /// Shows the picture and obeys hands; returns whether somebody walks.
    pub fn show_view(
        &mut self,
        ui: &mut Ui,
        texture: Option<egui::TextureId>,
        largest: u32,
    ) -> bool {
        let pixels = ui.ctx().pixels_per_point();
        // On whole pixels: each of the picture's is one of the window's.
        let whole = |at: egui::Pos2| ((at.to_vec2() * pixels).round() / pixels).to_pos2();
        let available = ui.max_rect();
        let rect = Rect::from_min_max(whole(available.min), whole(available.max));
        let largest = largest.min(LARGEST_SIDE_PX);
        let side = |length: f32| ((length * pixels).round() as u32).clamp(1, largest);
        (self.view_rect, self.size_px) = (rect, [side(rect.width()), side(rect.height())]);
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        let name = "Points";
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Image, true, name));
        if let Some(texture) = texture {
            let all = Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(1.0, 1.0));
            ui.painter_at(rect).image(texture, rect, all, egui::Color32::WHITE);
        } else {
            let [r, g, b] = self.settings.theme.background();
            ui.painter_at(rect).rect_filled(rect, 0.0, egui::Color32::from_rgb(r, g, b));
        }
        self.obey_pointer(ui, &response);
        let walks = self.obey_walking(ui);
        overlay::show(self, ui, Palette::of(self.settings.theme));
        walks
    }

    /// Parts of the picture's height.
    fn parts(&self, moved: Vec2) -> DVec2 {
        let height = f64::from(self.view_rect.height()).max(1.0);
        DVec2::new(f64::from(moved.x), -f64::from(moved.y)) / height
    }

    /// How far the hand has dragged since the last frame, to turn and to pan. Taken from the events
    /// themselves: where a frame takes long, a whole drag may lie between two of them.
    fn dragged(&mut self, ui: &Ui) -> (Vec2, Vec2) {
        let (mut turned, mut panned) = (Vec2::ZERO, Vec2::ZERO);
        let events = ui.input(|input| input.events.clone());
        for event in events {
            match event {
                Event::PointerButton { pos, button, pressed: true, modifiers } => {
                    let is_here = self.view_rect.contains(pos)
                        && ui.ctx().layer_id_at(pos) == Some(ui.layer_id());
                    let turns = button == PointerButton::Primary && !modifiers.shift;
                    self.drag = is_here.then_some(Drag { at: pos, button, turns });
                }
                Event::PointerButton { button, pressed: false, .. } => {
                    self.drag.take_if(|drag| drag.button == button);
                }
                Event::PointerMoved(pos) => {
                    if let Some(drag) = &mut self.drag {
                        let moved = pos - std::mem::replace(&mut drag.at, pos);
                        *if drag.turns { &mut turned } else { &mut panned } += moved;
                    }
                }
                Event::PointerGone | Event::WindowFocused(false) => self.drag = None,
                _ => {}
            }
        }
        (turned, panned)
    }

    fn obey_pointer(&mut self, ui: &Ui, response: &Response) {
        let (turned, panned) = self.dragged(ui);
        if turned != Vec2::ZERO || panned != Vec2::ZERO {
            self.take_over();
            self.navigator.turn(self.parts(turned));
            self.navigator.pan(self.parts(panned));
        }
        if response.hovered() {
            self.obey_wheel(ui, response);
        }
        if response.double_clicked() {
            if let Some(picked) = self.picked_at(response) {
                self.take_over();
                self.navigator.set_pivot(picked.place());
            }
        } else if response.clicked() {
            match self.picked_at(response) {
                Some(picked) => self.set_picked(picked),
                None => self.events.tell("picked", serde_json::json!({ "cloud": null })),
            }
        }
    }

    fn obey_wheel(&mut self, ui: &Ui, response: &Response) {
        let (scrolled, pinched, shift) = ui.input(|input| {
            (input.smooth_scroll_delta(), f64::from(input.zoom_delta()), input.modifiers.shift)
        });
        let steps = f64::from(scrolled.y) / WHEEL_POINTS + pinched.ln() / 1.25f64.ln();
        let across = self.parts(Vec2::new(scrolled.x, if shift { scrolled.y } else { 0.0 }));
        if shift && across != DVec2::ZERO {
            self.take_over();
            self.navigator.pan(across);
        } else if steps != 0.0 && steps.is_finite() {
            self.take_over();
            if self.navigator.mode == Mode::Fly {
                self.navigator.change_speed(steps);
            } else if let Some(at) = response.hover_pos() {
                let anchor = self.anchor_at(at);
                self.navigator.zoom(steps, anchor);
            }
        }
    }

    /// The place under the cursor: the point that is seen there, or the plane through the pivot.
    fn anchor_at(&mut self, at: egui::Pos2) -> DVec3 {
        if let Some((known_at, anchor)) = self.anchor
            && known_at == at
        {
            return anchor;
        }
        let middle = at - self.view_rect.center();
        let anchor = match self.pick(at) {
            Some(picked) => picked.place(),
            None => self.navigator.goal().on_pivot_plane(self.parts(middle)),
        };
        self.anchor = Some((at, anchor));
        anchor
    }

    fn picked_at(&mut self, response: &Response) -> Option<Picked> {
        self.pick(response.interact_pointer_pos()?)
    }

    /// The point that is seen at a place of the window.
    fn pick(&mut self, at: egui::Pos2) -> Option<Picked> {
        let from_corner = (at - self.view_rect.min) / self.view_rect.size();
        let pixel = |part: f32, side: u32| ((part * side as f32) as u32).min(side - 1);
        let [width, height] = self.size_px;
        let at = [pixel(from_corner.x, width), pixel(from_corner.y, height)];
        // What is on the picture is what can be picked.
        let settings = self.settings.look.settings(
            self.size_px,
            self.camera,
            self.settings.theme.background(),
        );
        match picking::pick(&self.plan, &self.shown, &settings, at) {
            Ok(picked) => picked,
            Err(error) => {
                self.warn(error.to_string());
                None
            }
        }
    }

    fn obey_walking(&mut self, ui: &Ui) -> bool {
        if ui.ctx().egui_wants_keyboard_input() {
            return false;
        }
        let (way, seconds) = ui.input(|input| {
            use egui::Key;
            let held =
                |keys: &[Key]| f64::from(u8::from(keys.iter().any(|key| input.key_down(*key))));
            let way = if input.modifiers.command {
                Walk::ZERO
            } else {
                Walk::new(
                    held(&[Key::D, Key::ArrowRight]) - held(&[Key::A, Key::ArrowLeft]),
                    held(&[Key::W, Key::ArrowUp]) - held(&[Key::S, Key::ArrowDown]),
                    held(&[Key::E]) - held(&[Key::Q]),
                )
            };
            (way, f64::from(input.stable_dt).min(LONGEST_STEP))
        });
        if way == Walk::ZERO {
            return false;
        }
        self.take_over();
        self.navigator.walk(way.normalize(), seconds);
        true
    }
}
