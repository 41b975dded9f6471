//! What keys and buttons do. One table has all keys: the help shows it, and the window obeys it.

use std::{path::PathBuf, time::Instant};

use egui::{Key, Modifiers};
use serde_json::json;

use super::{
    export::Export,
    jobs::Answer,
    navigation::{Mode, Side},
    recording::Recorder,
    session::Bookmark,
    settings::Theme,
    state::{Clip, Tool, Viewer},
};
use crate::{
    engine::ClipBox,
    path::CameraPath,
    render::{ColorMode, SplatSize},
};

/// What can be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Shows all.
    Fit,
    /// One of the six views.
    Look(Side),
    /// Perspective or orthographic.
    Projection,
    /// Orbit or fly.
    Mode,
    /// Measure or pick.
    Measure,
    /// Limits the view or not.
    Clip,
    /// Keeps the view.
    Bookmark,
    /// The next source of colours.
    NextColor,
    /// Larger splats.
    Larger,
    /// Smaller splats.
    Smaller,
    /// Eye-dome lighting or not.
    EyeDome,
    /// Records a path, or ends that.
    Record,
    /// Plays the path, or ends that.
    Play,
    /// Writes the picture.
    Picture,
    /// Opens something.
    Open,
    /// Saves the session.
    Save,
    /// Copies the picked point.
    Copy,
    /// Light or dark.
    Theme,
    /// Panel or not.
    Panel,
    /// Keys or not.
    Help,
    /// Ends what is under way.
    Cancel,
    /// Closes the window.
    Quit,
}

/// A key, with or without Ctrl, what it does, and how that is told.
pub struct Shortcut {
    /// The key.
    pub key: Key,
    /// Whether Ctrl (Cmd) is held.
    pub with_command: bool,
    /// What it does.
    pub action: Action,
    /// The key, for people.
    pub name: &'static str,
    /// What it does, for people.
    pub does: &'static str,
}

const fn key(key: Key, action: Action, name: &'static str, does: &'static str) -> Shortcut {
    Shortcut { key, with_command: false, action, name, does }
}

const fn ctrl(key: Key, action: Action, name: &'static str, does: &'static str) -> Shortcut {
    Shortcut { key, with_command: true, action, name, does }
}

/// All of them.
pub const SHORTCUTS: [Shortcut; 27] = [
    key(Key::F, Action::Fit, "F", "Show all"),
    key(Key::Num1, Action::Look(Side::Front), "1", "From the front (south)"),
    key(Key::Num2, Action::Look(Side::Back), "2", "From the back"),
    key(Key::Num3, Action::Look(Side::Left), "3", "From the left"),
    key(Key::Num4, Action::Look(Side::Right), "4", "From the right"),
    key(Key::Num5, Action::Look(Side::Top), "5", "From above"),
    key(Key::Num6, Action::Look(Side::Bottom), "6", "From below"),
    key(Key::O, Action::Projection, "O", "Perspective or orthographic"),
    key(Key::G, Action::Mode, "G", "Orbit or fly"),
    key(Key::M, Action::Measure, "M", "Measure or pick"),
    key(Key::C, Action::Clip, "C", "Clip box on or off"),
    key(Key::B, Action::Bookmark, "B", "Keep this view"),
    key(Key::N, Action::NextColor, "N", "Next colouring"),
    key(Key::Plus, Action::Larger, "+", "Larger splats"),
    key(Key::Equals, Action::Larger, "=", "Larger splats"),
    key(Key::Minus, Action::Smaller, "-", "Smaller splats"),
    key(Key::L, Action::EyeDome, "L", "Eye-dome lighting"),
    key(Key::R, Action::Record, "R", "Record a camera path"),
    key(Key::Space, Action::Play, "Space", "Play the camera path"),
    key(Key::F12, Action::Picture, "F12", "Write the picture as PNG"),
    ctrl(Key::O, Action::Open, "Ctrl O", "Open"),
    ctrl(Key::S, Action::Save, "Ctrl S", "Save the session"),
    key(Key::T, Action::Theme, "T", "Light or dark"),
    key(Key::F2, Action::Panel, "F2", "Panel on or off"),
    key(Key::F1, Action::Help, "F1", "These keys"),
    key(Key::Escape, Action::Cancel, "Esc", "End what is under way"),
    ctrl(Key::Q, Action::Quit, "Ctrl Q", "Close"),
];

/// What hands do besides, for the help.
pub const GESTURES: [(&str, &str); 10] = [
    ("Drag", "Turn (when flying: look around)"),
    ("Right or middle drag", "Move along the picture"),
    ("Wheel, pinch", "Nearer to what is under the cursor"),
    ("Ctrl C", "Copy the picked point"),
    ("Shift + wheel", "Move along the picture (touchpads)"),
    ("Click", "Pick the point; when measuring, one of two"),
    ("Double click", "Turn around this point"),
    ("W A S D, arrows", "Fly ahead, left, back, right"),
    ("E, Q", "Fly up, down"),
    ("Wheel when flying", "Faster, slower"),
];

/// Splats grow by this.
const SIZE_STEP: f64 = 1.25;

impl Viewer {
    /// Does what keys say that were pressed. While somebody types, only those count that type nothing.
    pub fn obey_keys(&mut self, context: &egui::Context) {
        let types = context.egui_wants_keyboard_input();
        let mut actions = Vec::new();
        context.input_mut(|input| {
            // egui takes Ctrl C for itself and tells it as an event.
            if !types && input.events.iter().any(|event| matches!(event, egui::Event::Copy)) {
                actions.push(Action::Copy);
            }
            for Shortcut { key, with_command, action, .. } in &SHORTCUTS {
                let modifiers = if *with_command { Modifiers::COMMAND } else { Modifiers::NONE };
                let types_nothing = matches!(key, Key::F1 | Key::F2 | Key::F12 | Key::Escape);
                if types && !with_command && !types_nothing {
                    continue;
                }
                if input.count_and_consume_key(modifiers, *key) > 0 {
                    actions.push(*action);
                }
            }
        });
        for action in actions {
            self.act(action, context);
        }
    }

    /// Does one thing.
    pub fn act(&mut self, action: Action, context: &egui::Context) {
        match action {
            Action::Fit => {
                self.take_over();
                self.navigator.fit(self.aspect(), false);
            }
            Action::Look(side) => {
                self.take_over();
                self.navigator.look_from(side, self.aspect());
            }
            Action::Projection => {
                self.take_over();
                let orthographic = self.navigator.goal().orthographic;
                self.navigator.set_orthographic(!orthographic);
            }
            Action::Mode => {
                self.navigator.mode = match self.navigator.mode {
                    Mode::Orbit => Mode::Fly,
                    Mode::Fly => Mode::Orbit,
                };
            }
            Action::Measure => {
                self.tool = match self.tool {
                    Tool::Pick => Tool::Measure(None),
                    Tool::Measure(_) => Tool::Pick,
                };
            }
            Action::Clip => self.set_clipping(!self.clip.is_on),
            Action::Bookmark => self.add_bookmark(),
            Action::NextColor => {
                let modes = ColorMode::ALL;
                let now = modes.iter().position(|mode| *mode == self.settings.look.color);
                self.settings.look.color = modes[now.map_or(0, |now| (now + 1) % modes.len())];
            }
            Action::Larger => self.scale_splats(SIZE_STEP),
            Action::Smaller => self.scale_splats(1.0 / SIZE_STEP),
            Action::EyeDome => self.settings.look.eye_dome ^= true,
            Action::Record => match self.recorder {
                Some(_) => self.stop_recording(),
                None if self.export.is_some() => {
                    self.warn("The camera is the export's: end that first (Esc)");
                }
                None => {
                    self.take_over();
                    self.recorder = Some(Recorder::start(&self.camera, Instant::now()));
                }
            },
            Action::Play => {
                // What was recorded is what is played.
                self.stop_recording();
                match (self.player.is_some(), self.path.clone()) {
                    (true, _) => self.take_over(),
                    (false, Some(path)) => self.play(path),
                    (false, None) => {
                        self.warn("There is no camera path: record one (R), or open one");
                    }
                }
            }
            Action::Picture => self.wants_picture = true,
            Action::Open => self.open_dialog.is_open ^= true,
            Action::Save => {
                let file = PathBuf::from(self.fields.session.trim());
                self.save_session(&file);
            }
            Action::Copy => self.copy(context),
            Action::Theme => {
                self.settings.theme = match self.settings.theme {
                    Theme::Dark => Theme::Light,
                    Theme::Light => Theme::Dark,
                };
            }
            Action::Panel => self.settings.panel ^= true,
            Action::Help => self.shows_help ^= true,
            Action::Cancel => self.cancel(),
            Action::Quit => self.is_closing = true,
        }
    }

    fn cancel(&mut self) {
        if self.shows_help || (self.open_dialog.is_open && !self.clouds.is_empty()) {
            (self.shows_help, self.open_dialog.is_open) = (false, false);
        } else if self.export.is_some() {
            self.end_export();
        } else if self.player.is_some() {
            self.take_over();
        } else if self.recorder.is_some() {
            self.stop_recording();
        } else if self.tool != Tool::Pick {
            self.tool = Tool::Pick;
        } else {
            self.picked = None;
        }
    }

    fn scale_splats(&mut self, factor: f64) {
        let size = &mut self.settings.look.splat_size;
        let scaled = match *size {
            SplatSize::Pixels(px) => {
                let px = (f64::from(px) * factor).clamp(1.0, 64.0);
                // Whole quarters: sizes that can be told.
                SplatSize::Pixels(((px * 4.0).round() / 4.0) as f32)
            }
            SplatSize::World(world) => SplatSize::World(world * factor),
            SplatSize::Level(times) => SplatSize::Level((times * factor).clamp(0.1, 20.0)),
            SplatSize::Adaptive(times) => SplatSize::Adaptive((times * factor).clamp(0.1, 20.0)),
            SplatSize::Own => SplatSize::Own,
        };
        if scaled.check().is_ok() {
            *size = scaled;
        }
    }

    /// Limits the view to the clip box, at first all of the scene, or does not.
    pub fn set_clipping(&mut self, is_on: bool) {
        let bounds = self.clip.bounds.or_else(|| {
            let (min, max) = self.extent()?;
            Some(ClipBox { min, max })
        });
        self.clip = Clip { is_on: is_on && bounds.is_some(), bounds };
        self.opens_clip = self.clip.is_on;
    }

    /// Keeps the view.
    pub fn add_bookmark(&mut self) {
        let number = self.bookmarks.len() + 1;
        let name = std::mem::take(&mut self.fields.bookmark);
        let name = if name.trim().is_empty() { format!("View {number}") } else { name };
        self.bookmarks.push(Bookmark { name, camera: self.camera });
        self.events.tell("bookmark", json!({ "count": number }));
    }

    /// Ends the recording; the path is there to be played.
    pub fn stop_recording(&mut self) {
        let Some(recorder) = self.recorder.take() else { return };
        match recorder.stop(&self.camera, Instant::now()) {
            Ok(path) => {
                let (seconds, keys) = (path.duration(), path.keys().len());
                self.events.tell("recorded", json!({ "seconds": seconds, "keys": keys }));
                self.note(format!("Recorded {seconds:.1} s; Space plays it"));
                self.path = Some(path);
            }
            Err(error) => self.warn(error.to_string()),
        }
    }

    /// Copies the picked point, or the measurement that it ends.
    pub fn copy(&mut self, context: &egui::Context) {
        let ends = self.picked.as_ref().is_none_or(|pick| pick.ends_measurement);
        let measured = self.measurements.last().filter(|_| ends && self.tool != Tool::Pick);
        let text = match (measured, &self.picked) {
            (Some(m), _) => {
                let [from, to] = [m.from, m.to].map(|p| format!("{} {} {}", p[0], p[1], p[2]));
                format!("{} (height {}; {from} to {to})", m.distance(), m.height())
            }
            (None, Some(pick)) => pick.point.text.join(" "),
            (None, None) => return,
        };
        self.copy_text(text, context);
    }

    /// Copies a text, and says so.
    pub fn copy_text(&mut self, text: String, context: &egui::Context) {
        self.events.tell("copied", json!({ "text": text }));
        self.note(format!("Copied {text}"));
        context.copy_text(text);
    }

    /// Writes the path to its file.
    pub fn save_path(&mut self) {
        let Some(path) = &self.path else { return };
        let file = PathBuf::from(self.fields.path.trim());
        match super::stored::write_text(&file, &path.to_json()) {
            Ok(()) => self.note(format!("Saved {}", file.display())),
            Err(error) => self.warn(error.to_string()),
        }
    }

    /// Reads the path from its file.
    pub fn open_path(&mut self) {
        let file = PathBuf::from(self.fields.path.trim());
        self.jobs.start(move || Answer::Path(CameraPath::read(&file).map_err(|e| e.to_string())));
    }

    /// Begins to export the path as pictures.
    pub fn start_export(&mut self) {
        self.stop_recording();
        let Some(path) = &self.path else { return };
        let folder = PathBuf::from(self.fields.export.trim());
        match Export::start(path, &folder, self.fields.export_frames) {
            Ok(export) => {
                self.player = None;
                self.export = Some(export);
            }
            Err(error) => self.warn(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_key_does_two_things_and_none_is_needed_for_walking() {
        for (index, one) in SHORTCUTS.iter().enumerate() {
            for other in &SHORTCUTS[index + 1..] {
                let is_same = one.key == other.key && one.with_command == other.with_command;
                assert!(!is_same, "{} does two things", one.name);
            }
            let walks = [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E];
            assert!(one.with_command || !walks.contains(&one.key), "{}", one.name);
        }
    }
}
