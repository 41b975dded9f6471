//! From the newest plan to a picture: what is drawn, and when.

use std::time::Instant;

use serde_json::json;

use super::{display::Display, filter::Wanted, jobs::Answer, state::Viewer};
use crate::{
    camera::Camera,
    engine::View,
    render::{CloudColors, ColorMode, Picture, RenderError, RenderSettings, Scene},
};

/// What the last picture was drawn of.
#[derive(Debug, Clone, Default)]
pub struct LastPicture {
    settings: Option<RenderSettings>,
    colors: Vec<Option<ColorMode>>,
    plan: u64,
    /// Counts changes of what is left out of plans.
    wishes: u64,
    drawn_wishes: u64,
    /// Whether nodes wait for their way to the GPU.
    is_partial: bool,
    /// The number of the view that the engine was told last.
    view: u64,
    attributes: Vec<String>,
    limits: Option<(u64, f64, u64)>,
    clip: Option<crate::engine::ClipBox>,
    /// Counts pictures.
    pictures: u64,
    /// The last that was told to be complete.
    told: u64,
}

impl Viewer {
    /// The camera of the next picture: the path's, or the hand's. Returns whether it moves on by itself.
    fn next_camera(&mut self, now: Instant, seconds: f64) -> (Camera, bool) {
        if let Some(export) = &self.export {
            return (export.next().map_or(self.camera, |(camera, _)| camera), true);
        }
        if let (Some(player), Some(path)) = (&self.player, &self.path) {
            let (camera, goes_on) = player.camera(path, now);
            if !goes_on {
                self.player = None;
                self.navigator.jump(&camera);
                self.events.tell("played", json!({}));
            }
            return (camera, goes_on);
        }
        let moves = self.navigator.follow(seconds);
        (self.navigator.camera(), moves)
    }

    /// As long as nobody has chosen a view, all that there is fills the picture.
    fn choose_first_view(&mut self) {
        let extent = self.extent().filter(|_| !self.navigator.is_chosen());
        let first = extent.map(|(min, max)| (min, max, self.aspect()));
        if first.is_some() && first != self.first_view {
            self.navigator.fit(self.aspect(), true);
            self.first_view = first;
        }
    }

    /// Tells the engine what is looked at, and draws it where the picture would be another one. Returns
    /// whether more is to be drawn at once.
    ///
    /// # Errors
    /// Where the picture cannot be drawn.
    pub fn draw(
        &mut self,
        display: &mut Display,
        now: Instant,
        seconds: f64,
    ) -> Result<bool, RenderError> {
        self.choose_first_view();
        let (camera, moves) = self.next_camera(now, seconds);
        self.camera = camera;
        if let Some(recorder) = &mut self.recorder
            && !recorder.note(&camera, now)
        {
            self.stop_recording();
        }
        let settings =
            self.settings.look.settings(self.size_px, camera, self.settings.theme.background());
        self.tell_engine(&settings);
        let plan = self.engine.plan();
        let colors: Vec<_> = self.clouds.iter().map(|cloud| cloud.color).collect();
        let is_same = self.last.settings == Some(settings)
            && self.last.colors == colors
            && self.last.plan == plan.sequence
            && self.last.drawn_wishes == self.last.wishes
            && !self.last.is_partial;
        if !is_same {
            if self.last.plan != plan.sequence || self.last.drawn_wishes != self.last.wishes {
                self.shown = self.filter.apply(&plan);
                self.anchor = None;
            }
            let begin = Instant::now();
            let scene = Scene { clouds: &plan.clouds, nodes: &self.shown.nodes };
            self.statistics = display.draw(&scene, &settings, CloudColors(&colors))?;
            self.frame_times.note(begin.elapsed());
            self.last.is_partial = self.statistics.waiting_nodes > 0;
            self.last.pictures += 1;
            self.last.settings = Some(settings);
            self.last.colors = colors;
            self.last.plan = plan.sequence;
            self.last.drawn_wishes = self.last.wishes;
            self.plan = plan;
        }
        let is_settled = self.is_settled() && !(moves && self.export.is_none());
        if is_settled {
            self.tell_settled();
        }
        self.take_pictures(display, is_settled)?;
        Ok(self.last.is_partial || moves && (self.export.is_none() || is_settled))
    }

    /// Whether a column group of a cloud is fetched for this view.
    #[must_use]
    pub fn is_fetched(&self, cloud: &lodestream_protocol::Manifest, group: usize) -> bool {
        let mut members = cloud.attributes.iter().filter(|a| a.group() == Some(group));
        members.any(|attribute| self.last.attributes.contains(&attribute.name))
    }

    /// Whether the picture shows all that it will show.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        self.plan.settled
            && self.plan.view_generation >= self.last.view
            && !self.last.is_partial
            && self.last.plan == self.plan.sequence
    }

    fn tell_engine(&mut self, settings: &RenderSettings) {
        let limits =
            (self.settings.point_budget, self.settings.min_node_px, self.settings.cache_mib << 20);
        if self.last.limits != Some(limits) {
            self.engine.set_budget(limits.0);
            self.engine.set_min_size_px(limits.1);
            self.engine.set_cache_bytes(limits.2);
            self.last.limits = Some(limits);
        }
        let clip = self.clip.active();
        if self.last.clip != clip {
            self.engine.set_clip(clip);
            self.last.clip = clip;
        }
        let hidden_classes = self.clouds.iter().map(|cloud| cloud.hidden_classes.clone()).collect();
        if self.filter.want(Wanted { clip, hidden_classes }) {
            self.last.wishes += 1;
        }
        let colors: Vec<_> = self.clouds.iter().map(|cloud| cloud.color).collect();
        let mut attributes: Vec<String> =
            settings.color.attribute().map(str::to_owned).into_iter().collect();
        for (number, cloud) in self.open_clouds() {
            let Some(manifest) = cloud.manifest() else { continue };
            let own = CloudColors(&colors).settings(number, settings);
            let names = own.attributes(manifest).into_iter();
            attributes.extend(names.map(|index| manifest.attributes[index].name.clone()));
            if !cloud.hidden_classes.is_empty() {
                attributes.push("classification".into());
            }
        }
        attributes.sort_unstable();
        attributes.dedup();
        if self.last.attributes != attributes {
            self.last.view = self.engine.set_attributes(attributes.clone());
            self.last.attributes = attributes;
        }
        let view = View { camera: settings.camera, size_px: settings.size_px };
        self.last.view = self.engine.set_view(view);
    }

    fn tell_settled(&mut self) {
        if std::mem::replace(&mut self.last.told, self.last.pictures) == self.last.pictures
            || !self.events.is_on()
        {
            return;
        }
        let camera: serde_json::Value =
            serde_json::from_str(&self.camera.to_json()).unwrap_or_default();
        self.events.tell(
            "settled",
            json!({
                "points": self.shown.points, "nodes": self.shown.nodes.len(), "camera": camera,
                "size": self.size_px, "view": [
                    self.view_rect.min.x, self.view_rect.min.y, self.view_rect.max.x, self.view_rect.max.y
                ],
            }),
        );
    }

    /// Takes the picture that was asked for, or the next of an export.
    fn take_pictures(
        &mut self,
        display: &mut Display,
        is_settled: bool,
    ) -> Result<(), RenderError> {
        if std::mem::take(&mut self.wants_picture) {
            let picture = display.take_picture()?;
            let file = self.next_picture_file();
            let camera = self.camera;
            self.jobs.start(move || {
                let outcome = write_with_camera(&picture, &camera, &file);
                Answer::Picture { file, exported: false, is_complete: is_settled, outcome }
            });
        }
        let Some(export) = &mut self.export else { return Ok(()) };
        if !is_settled || self.is_writing {
            return Ok(());
        }
        if let Some((camera, file)) = export.next() {
            if camera == self.camera {
                let picture = display.take_picture()?;
                export.done();
                self.is_writing = true;
                self.jobs.start(move || {
                    let outcome = picture.write_png(&file).map_err(|e| e.to_string());
                    Answer::Picture { file, exported: true, is_complete: true, outcome }
                });
            }
        } else {
            let text =
                format!("Wrote {} pictures to {}", export.progress().1, export.folder().display());
            self.export = None;
            self.navigator.jump(&self.camera);
            self.events.tell("exported", json!({}));
            self.note(text);
        }
        Ok(())
    }

    /// The first name that is free; each is given once, for its file comes later.
    fn next_picture_file(&mut self) -> std::path::PathBuf {
        loop {
            self.last_picture += 1;
            let file = self.folder.join(format!("lodestream-{:04}.png", self.last_picture));
            if !file.exists() {
                return file;
            }
        }
    }
}

/// Writes a picture, and its camera beside it, for `lodestream shot --camera`.
fn write_with_camera(
    picture: &Picture,
    camera: &Camera,
    file: &std::path::Path,
) -> Result<(), String> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    picture.write_png(file).map_err(|e| e.to_string())?;
    let beside = file.with_extension("camera.json");
    std::fs::write(&beside, camera.to_json()).map_err(|e| format!("{}: {e}", beside.display()))
}
