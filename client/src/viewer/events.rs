//! What happens, for scripts: with `--events`, a line of JSON for each thing on standard output.
//!
//! Besides what the program does, it tells where the panel's widgets are, as it tells assistive technology: by
//! role and label. So a script can press what a person presses.

use std::io::Write;

use serde_json::{Value, json};

/// Tells, or does not.
#[derive(Debug, Default)]
pub struct Events {
    is_on: bool,
    widgets: Value,
}

impl Events {
    /// Tells on standard output, if so.
    #[must_use]
    pub fn new(is_on: bool) -> Self {
        Self { is_on, widgets: Value::Null }
    }

    /// Whether anybody listens.
    #[must_use]
    pub fn is_on(&self) -> bool {
        self.is_on
    }

    /// Tells one thing: `{"event": NAME, ...}`.
    pub fn tell(&self, name: &str, mut what: Value) {
        if !self.is_on {
            return;
        }
        if let Value::Object(fields) = &mut what {
            fields.insert("event".into(), name.into());
        }
        let mut out = std::io::stdout().lock();
        // A reader that has gone is no reason to end.
        let _ = writeln!(out, "{what}").and_then(|()| out.flush());
    }

    /// Tells which widgets were clicked: role and label. A script learns so that it has hit what it aimed at.
    pub fn tell_clicks(&self, output: &[egui::output::OutputEvent]) {
        for event in output {
            if let egui::output::OutputEvent::Clicked(info) = event {
                let label = info.label.as_ref().or(info.current_text_value.as_ref());
                self.tell("clicked", json!({ "role": format!("{:?}", info.role), "label": label }));
            }
        }
    }

    /// Tells where widgets are, where that has changed: role, label, and the rectangle in pixels of the
    /// window.
    pub fn tell_widgets(&mut self, update: &egui::accesskit::TreeUpdate, pixels_per_point: f32) {
        let widgets: Vec<Value> = update
            .nodes
            .iter()
            .filter_map(|(_, node)| {
                let label = node.label().or_else(|| node.value())?;
                let bounds = node.bounds()?;
                let scale = f64::from(pixels_per_point);
                let corners =
                    [bounds.x0, bounds.y0, bounds.x1, bounds.y1].map(|c| (c * scale).round());
                Some(json!([format!("{:?}", node.role()), label, corners]))
            })
            .collect();
        let widgets = Value::from(widgets);
        if widgets != self.widgets {
            self.tell("widgets", json!({ "widgets": widgets }));
            self.widgets = widgets;
        }
    }
}
