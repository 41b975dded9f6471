//! Opening from inside: an address or a file, a server's list, what was opened lately.

use std::path::Path;

use egui::{Align2, RichText, ScrollArea};
use lodestream_server::DatasetIndex;

use super::{numbers, state::Viewer, theme::Palette};

/// What the dialog shows.
#[derive(Debug, Clone, Default)]
pub struct OpenDialog {
    /// Whether it is shown.
    pub is_open: bool,
    text: String,
    /// A server that was asked.
    server: Option<String>,
    list: Option<Result<DatasetIndex, String>>,
}

/// What was chosen.
enum Choice {
    Open(String),
    Several(Vec<String>),
    List(String),
    Session(String),
}

impl OpenDialog {
    /// A server is being asked.
    pub fn begin_list(&mut self, server: &str) {
        self.is_open = true;
        self.text = server.into();
        (self.server, self.list) = (Some(server.into()), None);
    }

    /// What it said.
    pub fn end_list(&mut self, server: String, index: Result<DatasetIndex, String>) {
        if self.server.as_deref() == Some(server.as_str()) {
            self.list = Some(index);
        }
    }
}

/// What a text is: a session, a folder, a server, or a dataset.
fn choice_of(text: &str) -> Option<Choice> {
    let text = text.trim();
    if text.is_empty() {
        return None;
    }
    let path = Path::new(text);
    if path.is_dir() {
        return Some(Choice::Several(crate::source::datasets_of_folder(path)));
    }
    Some(if path.is_file() && path.extension().is_some_and(|end| end == "json") {
        Choice::Session(text.into())
    } else if crate::source::is_server(text) {
        Choice::List(text.into())
    } else {
        Choice::Open(text.into())
    })
}

impl Viewer {
    /// Opens what a text names.
    pub fn open_any(&mut self, text: &str) {
        if let Some(choice) = choice_of(text) {
            self.choose(choice);
        }
    }

    fn choose(&mut self, choice: Choice) {
        match choice {
            Choice::Open(source) => self.open(&source),
            Choice::Several(sources) if sources.is_empty() => {
                self.warn("There are no .lods files in this folder");
            }
            Choice::Several(sources) => sources.iter().for_each(|source| self.open(source)),
            Choice::List(server) => self.list(server),
            Choice::Session(file) => {
                self.open_session(Path::new(&file));
                self.open_dialog.is_open = false;
            }
        }
    }

    /// Says what happens to a file that is held above the window.
    pub fn show_drop_hint(&self, context: &egui::Context) {
        let palette = Palette::of(self.settings.theme);
        let area = egui::Area::new(egui::Id::unique("drop"))
            .order(egui::Order::Foreground)
            .interactable(false)
            .fixed_pos(self.view_rect.min);
        area.show(context, |ui| {
            ui.painter().rect_filled(self.view_rect, 0.0, palette.shade.gamma_multiply(0.8));
            let text = RichText::new("Drop it to open it").size(22.0).color(palette.text);
            ui.put(self.view_rect, egui::Label::new(text).selectable(false));
        });
    }

    /// Shows the dialog, if it is open.
    pub fn show_open_dialog(&mut self, context: &egui::Context) {
        if !self.open_dialog.is_open {
            return;
        }
        let palette = Palette::of(self.settings.theme);
        let mut choice = None;
        let mut is_open = true;
        let middle = self.view_rect.center() - context.content_rect().center();
        egui::Window::new("Open")
            .id(egui::Id::unique("open"))
            .open(&mut is_open)
            .collapsible(false)
            .resizable(false)
            .anchor(Align2::CENTER_CENTER, middle)
            .fixed_size([440.0, 0.0])
            .show(context, |ui| {
                ui.add_space(2.0);
                ui.label("A file, a folder, a URL, or a server and a dataset");
                let dialog = &mut self.open_dialog;
                ui.horizontal(|ui| {
                    let field = egui::TextEdit::singleline(&mut dialog.text)
                        .hint_text("127.0.0.1:8080/courtyard")
                        .desired_width(316.0);
                    let field = ui.add(field);
                    if dialog.text.is_empty()
                        && ui.ctx().memory(|memory| memory.focused().is_none())
                    {
                        field.request_focus();
                    }
                    let enter = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
                    let pressed = ui.add_sized([84.0, 26.0], egui::Button::new("Open"));
                    if enter || pressed.clicked() {
                        choice = choice_of(&dialog.text);
                    }
                });
                if let Some(server) = &dialog.server {
                    ui.add_space(8.0);
                    choice = show_list(ui, palette, server, dialog.list.as_ref()).or(choice.take());
                }
                if !self.settings.recent.is_empty() {
                    ui.add_space(8.0);
                    ui.label(RichText::new("Lately").color(palette.faint).small());
                    ScrollArea::vertical().id_salt("recent").max_height(150.0).show(ui, |ui| {
                        for source in &self.settings.recent {
                            let line = egui::Button::new(source).frame(false).truncate();
                            if ui.add(line).clicked() {
                                choice = Some(Choice::Open(source.clone()));
                            }
                        }
                    });
                }
                ui.add_space(6.0);
                let hint =
                    "A server's address alone shows its list. Files can be dropped on the window.";
                ui.label(RichText::new(hint).color(palette.faint).small());
            });
        self.open_dialog.is_open &= is_open;
        if let Some(choice) = choice {
            self.choose(choice);
        }
    }
}

fn show_list(
    ui: &mut egui::Ui,
    palette: Palette,
    server: &str,
    list: Option<&Result<DatasetIndex, String>>,
) -> Option<Choice> {
    let base = server.trim_end_matches('/').trim_end_matches("/datasets");
    let source = |name: &str| format!("{base}/{name}");
    let mut choice = None;
    match list {
        None => {
            ui.label(RichText::new(format!("Asking {server} …")).color(palette.faint));
        }
        Some(Err(error)) => {
            ui.label(RichText::new(error).color(palette.warning));
            if ui.button("Ask again").clicked() {
                choice = Some(Choice::List(server.into()));
            }
        }
        Some(Ok(index)) if index.datasets.is_empty() => {
            ui.label(RichText::new(format!("{server} has no datasets")).color(palette.faint));
        }
        Some(Ok(index)) => {
            ui.horizontal(|ui| {
                let count = index.datasets.len();
                ui.label(
                    RichText::new(format!("{count} datasets at {server}"))
                        .color(palette.faint)
                        .small(),
                );
                ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                    if ui.small_button("Open all").clicked() {
                        let all = index.datasets.iter().map(|entry| source(&entry.name));
                        choice = Some(Choice::Several(all.collect()));
                    }
                });
            });
            ScrollArea::vertical().id_salt("list").max_height(190.0).show(ui, |ui| {
                for entry in &index.datasets {
                    ui.horizontal(|ui| {
                        if ui.add(egui::Button::new(&entry.name).frame(false)).clicked() {
                            choice = Some(Choice::Open(source(&entry.name)));
                        }
                        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                            let points = numbers::short(entry.points);
                            let text = format!("{points} points, {}", numbers::bytes(entry.bytes));
                            ui.label(RichText::new(text).color(palette.faint).small());
                        });
                    });
                }
            });
        }
    }
    choice
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_taken_for_what_it_names() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, "").expect("written");
            path.display().to_string()
        };
        let (dataset, session) = (file("b.lods"), file("s.json"));
        file("a.lods");
        let several = choice_of(&folder.path().display().to_string());
        let Some(Choice::Several(several)) = several else { panic!("a folder") };
        assert_eq!(several.len(), 2);
        assert!(several[1] == dataset && several[0] < dataset, "in order: {several:?}");
        assert!(matches!(choice_of(&session), Some(Choice::Session(_))));
        assert!(matches!(choice_of(&dataset), Some(Choice::Open(_))));
        assert!(matches!(choice_of("127.0.0.1:8080"), Some(Choice::List(_))));
        assert!(matches!(choice_of(" http://a.example/ "), Some(Choice::List(_))));
        assert!(matches!(choice_of("http://a.example/x"), Some(Choice::Open(_))));
        assert!(choice_of("  ").is_none());
    }
}
