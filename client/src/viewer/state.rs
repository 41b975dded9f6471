//! What the viewer knows: the clouds, the view, what is kept and what is under way.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use glam::DVec3;
use serde_json::json;

use super::{
    clouds::Cloud,
    events::Events,
    export::Export,
    filter::{Filter, Shown},
    frame::LastPicture,
    frame_times::FrameTimes,
    jobs::{Answer, Jobs},
    measurement::Measurement,
    messages::{Messages, Weight},
    navigation::Navigator,
    open_dialog::OpenDialog,
    options::ViewOptions,
    picking::Picked,
    point_values::{self, Known, Values},
    recording::{Player, Recorder},
    session::{Bookmark, Session, SessionCloud},
    settings::Settings,
};
use crate::{
    camera::Camera,
    engine::{ClipBox, Engine, EngineConfig, EngineError, EngineStats, FramePlan},
    path::{CameraPath, Extent, PathSource},
    render::FrameStatistics,
    source::Source,
};

/// What a click on the picture does.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Tool {
    /// Tells of the point.
    #[default]
    Pick,
    /// Measures from one point to another: from this one, once it is there.
    Measure(Option<[f64; 3]>),
}

/// A point that was picked, and what is known of it.
#[derive(Debug, Clone)]
pub struct Pick {
    /// Which pick it is.
    pub number: u64,
    /// The point.
    pub point: Picked,
    /// Whether something is measured up to it.
    pub ends_measurement: bool,
    /// Its attributes, once they are there.
    pub values: Option<Result<Values, String>>,
}

/// A clip box, in use or not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Clip {
    /// Whether it limits the view.
    pub is_on: bool,
    /// The box, once there is one.
    pub bounds: Option<ClipBox>,
}

impl Clip {
    /// The box, where it is in use.
    #[must_use]
    pub fn active(&self) -> Option<ClipBox> {
        self.bounds.filter(|_| self.is_on)
    }
}

/// Texts of fields in the panel.
#[derive(Debug, Clone)]
pub struct Fields {
    /// Where the session is kept.
    pub session: String,
    /// Where the camera path is kept.
    pub path: String,
    /// Where exported pictures go.
    pub export: String,
    /// How many there are to be.
    pub export_frames: u32,
    /// The name of the next bookmark.
    pub bookmark: String,
}

/// What the viewer knows.
pub struct Viewer {
    pub engine: Engine,
    pub clouds: Vec<Cloud>,
    pub navigator: Navigator,
    pub settings: Settings,
    settings_file: Option<PathBuf>,
    /// As they were kept last.
    kept: Settings,
    /// Where pictures go.
    pub folder: PathBuf,
    pub clip: Clip,
    /// The clip box was switched on: its section is to be opened.
    pub opens_clip: bool,
    pub bookmarks: Vec<Bookmark>,
    pub measurements: Vec<Measurement>,
    pub tool: Tool,
    pub picked: Option<Pick>,
    picks: u64,
    pub messages: Messages,
    pub frame_times: FrameTimes,
    pub events: Events,
    pub jobs: Jobs,
    pub recorder: Option<Recorder>,
    pub path: Option<CameraPath>,
    /// A generator from the command line that waits for clouds.
    waiting_path: Option<PathSource>,
    pub player: Option<Player>,
    pub export: Option<Export>,
    /// Whether a picture of the export is being written.
    pub is_writing: bool,
    pub open_dialog: OpenDialog,
    pub fields: Fields,
    pub shows_help: bool,
    pub is_closing: bool,
    /// Clouds of the session that could not be opened: they stay in it.
    pub unopened: Vec<SessionCloud>,
    /// Number of the last picture's file.
    pub last_picture: u64,
    /// A picture of the view is to be written.
    pub wants_picture: bool,
    /// The newest plan that was taken, and what is shown of it.
    pub plan: Arc<FramePlan>,
    pub filter: Filter,
    pub shown: Shown,
    pub last: LastPicture,
    pub statistics: FrameStatistics,
    pub stats: EngineStats,
    pub renderer: String,
    /// Where the picture is in the window, and its size.
    pub view_rect: egui::Rect,
    pub size_px: [u32; 2],
    /// The camera of the last picture.
    pub camera: Camera,
    /// A drag under way.
    pub drag: Option<super::view::Drag>,
    /// The view that nobody has chosen yet is of this extent, in a picture of this aspect.
    pub first_view: Option<(DVec3, DVec3, f64)>,
    /// What is zoomed to: the place under the cursor, as long as that is where it was.
    pub anchor: Option<(egui::Pos2, DVec3)>,
}

impl Viewer {
    /// Starts the engine, and opens what the options say. `wake` is called, from any thread, when there is
    /// something new.
    ///
    /// # Errors
    /// [`EngineError::Thread`] where the system gives no threads.
    pub fn start(
        mut options: ViewOptions,
        wake: Arc<dyn Fn() + Send + Sync>,
    ) -> Result<Self, EngineError> {
        let settings = options.settings.clone();
        let config = EngineConfig {
            point_budget: settings.point_budget,
            min_size_px: settings.min_node_px,
            cache_bytes: settings.cache_mib << 20,
            attributes: settings.look.color.attribute().map(str::to_owned).into_iter().collect(),
            ..EngineConfig::default()
        };
        let engine = Engine::start(Vec::new(), config)?;
        let news = Arc::clone(&wake);
        engine.on_news(move || news());
        let text = |name: &str| options.folder.join(name).display().to_string();
        let fields = Fields {
            session: text("session.json"),
            path: text("path.json"),
            export: text("frames"),
            export_frames: 120,
            bookmark: String::new(),
        };
        let mut viewer = Self {
            engine,
            clouds: Vec::new(),
            navigator: Navigator::default(),
            kept: settings.clone(),
            settings,
            settings_file: options.settings_file.take(),
            folder: options.folder.clone(),
            clip: Clip { is_on: options.clip.is_some(), bounds: options.clip },
            opens_clip: false,
            bookmarks: Vec::new(),
            measurements: Vec::new(),
            tool: Tool::default(),
            picked: None,
            picks: 0,
            messages: Messages::default(),
            frame_times: FrameTimes::default(),
            events: Events::new(options.events),
            jobs: Jobs::new(wake),
            recorder: None,
            path: None,
            waiting_path: None,
            player: None,
            export: None,
            is_writing: false,
            open_dialog: OpenDialog::default(),
            fields,
            shows_help: false,
            is_closing: false,
            wants_picture: false,
            plan: Arc::default(),
            filter: Filter::default(),
            shown: Shown::default(),
            last: LastPicture::default(),
            statistics: FrameStatistics::default(),
            stats: EngineStats::default(),
            renderer: String::new(),
            view_rect: egui::Rect::NOTHING,
            size_px: [1, 1],
            camera: Camera::overview(DVec3::ZERO, DVec3::ONE, 1.5),
            drag: None,
            first_view: None,
            unopened: Vec::new(),
            last_picture: 0,
            anchor: None,
        };
        viewer.open_first(options);
        Ok(viewer)
    }

    fn open_first(&mut self, options: ViewOptions) {
        if let Some(trouble) = options.settings_trouble {
            self.warn(trouble);
        }
        if let Some(file) = &options.session {
            self.open_session(file);
            self.settings.look = options.look.upon(self.settings.look);
            let settings = &mut self.settings;
            settings.point_budget = options.point_budget.unwrap_or(settings.point_budget);
            settings.min_node_px = options.min_node_px.unwrap_or(settings.min_node_px);
            if options.clip.is_some() {
                self.clip = Clip { is_on: true, bounds: options.clip };
            }
        }
        for source in &options.sources {
            self.open(source);
        }
        for server in options.servers {
            self.list(server);
        }
        if let Some(camera) = &options.camera {
            self.navigator.jump(camera);
        }
        match options.path {
            Some(PathSource::File(path)) => self.play(path),
            generator => self.waiting_path = generator,
        }
        self.open_dialog.is_open |= self.clouds.is_empty();
    }

    /// Tells something that did not go as asked.
    pub fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.events.tell("message", json!({ "warning": true, "text": text }));
        self.messages.tell(Weight::Warning, text);
    }

    /// Tells something that was done.
    pub fn note(&mut self, text: impl Into<String>) {
        let text = text.into();
        self.events.tell("message", json!({ "warning": false, "text": text }));
        self.messages.tell(Weight::Note, text);
    }

    /// Opens a dataset.
    pub fn open(&mut self, source: &str) {
        self.add(Cloud::new(source));
    }

    /// Adds a cloud; `false`, and told, where its source is none.
    fn add(&mut self, mut cloud: Cloud) -> bool {
        let source = match Source::parse(&cloud.source) {
            Ok(source) => source,
            Err(error) => {
                self.warn(error.to_string());
                return false;
            }
        };
        // A file is found again from wherever the program is started next.
        let file = Path::new(&cloud.source);
        if file.is_file()
            && let Ok(file) = std::path::absolute(file)
        {
            cloud.source = file.display().to_string();
        }
        self.settings.note_recent(&cloud.source);
        let number = self.engine.add(source);
        self.engine.set_visible(number, cloud.is_visible);
        debug_assert_eq!(number, self.clouds.len());
        self.clouds.push(cloud);
        self.open_dialog.is_open = false;
        true
    }

    /// Closes a cloud.
    pub fn close(&mut self, number: usize) {
        let Some(cloud) = self.clouds.get_mut(number) else { return };
        cloud.is_closed = true;
        self.engine.remove(number);
        if self.picked.as_ref().is_some_and(|pick| pick.point.cloud == number) {
            self.picked = None;
        }
    }

    /// Closes all of them.
    fn close_all(&mut self) {
        (0..self.clouds.len()).for_each(|number| {
            if !self.clouds[number].is_closed {
                self.close(number);
            }
        });
    }

    /// Shows a cloud or does not.
    pub fn set_visible(&mut self, number: usize, is_visible: bool) {
        if let Some(cloud) = self.clouds.get_mut(number) {
            cloud.is_visible = is_visible;
            self.engine.set_visible(number, is_visible);
        }
    }

    /// Numbers and clouds that are open.
    pub fn open_clouds(&self) -> impl Iterator<Item = (usize, &Cloud)> {
        self.clouds.iter().enumerate().filter(|(_, cloud)| !cloud.is_closed)
    }

    /// Asks a server what it has.
    pub fn list(&mut self, server: String) {
        self.open_dialog.begin_list(&server);
        self.jobs.start(move || {
            let index = crate::source::list_datasets(&server).map_err(|e| e.to_string());
            Answer::List { server, index }
        });
    }

    /// Opens a session in place of what is open.
    pub fn open_session(&mut self, file: &Path) {
        let session = match Session::open(file) {
            Ok(session) => session,
            Err(error) => return self.warn(error.to_string()),
        };
        self.take_over();
        self.end_export();
        self.stop_recording();
        if let Tool::Measure(from) = &mut self.tool {
            *from = None;
        }
        self.close_all();
        self.fields.session = file.display().to_string();
        self.settings.look = session.look;
        self.settings.point_budget = session.point_budget.unwrap_or(self.settings.point_budget);
        self.settings.min_node_px = session.min_node_px.unwrap_or(self.settings.min_node_px);
        self.clip = Clip { is_on: session.clip.is_some() && session.clips, bounds: session.clip };
        self.bookmarks = session.bookmarks;
        self.measurements = session.measurements;
        self.unopened.clear();
        for cloud in session.clouds {
            if !self.add(Cloud::from_session(&cloud)) {
                self.unopened.push(cloud);
            }
        }
        match &session.camera {
            Some(camera) => self.navigator.jump(camera),
            None => {
                self.navigator.forget_choice();
                self.first_view = None;
            }
        }
        self.events.tell("session", json!({ "opened": file }));
        let rest = match self.unopened.len() {
            0 => String::new(),
            n => format!("; {n} of its clouds cannot be opened now, and stay in it"),
        };
        self.messages.tell(Weight::Note, format!("Opened {}{rest}", file.display()));
    }

    /// Saves what is looked at, from where and how.
    pub fn save_session(&mut self, file: &Path) {
        let open = self.open_clouds().map(|(_, cloud)| cloud.to_session());
        let mut session = Session::new(open.chain(self.unopened.iter().cloned()).collect());
        session.camera = Some(self.camera);
        session.look = self.settings.look;
        session.point_budget = Some(self.settings.point_budget);
        session.min_node_px = Some(self.settings.min_node_px);
        (session.clip, session.clips) = (self.clip.bounds, self.clip.is_on);
        session.bookmarks.clone_from(&self.bookmarks);
        session.measurements.clone_from(&self.measurements);
        match session.save(file) {
            Ok(()) => {
                self.events.tell("session", json!({ "saved": file }));
                self.messages.tell(Weight::Note, format!("Saved {}", file.display()));
            }
            Err(error) => self.warn(error.to_string()),
        }
    }

    /// Keeps the settings for the next start, where they have changed.
    pub fn keep_settings(&mut self) {
        let Some(file) = &self.settings_file else { return };
        if self.settings == self.kept {
            return;
        }
        if let Err(error) = self.settings.keep(file) {
            tracing::warn!("{error}");
            eprintln!("note: {error}");
        }
        self.kept = self.settings.clone();
    }

    /// Lowest and highest corner of all clouds that are open and shown.
    #[must_use]
    pub fn extent(&self) -> Option<(DVec3, DVec3)> {
        let shown = self.open_clouds().filter(|(_, cloud)| cloud.is_visible);
        let bounds = shown.filter_map(|(_, cloud)| cloud.bounds());
        bounds.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
    }

    /// Width over height of the picture.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        f64::from(self.size_px[0]) / f64::from(self.size_px[1])
    }

    /// Takes the engine's news: how the clouds are, the newest plan.
    pub fn take_news(&mut self) {
        let statuses = self.engine.clouds();
        let (mut told, mut replaced) = (Vec::new(), Vec::new());
        for (number, (cloud, status)) in self.clouds.iter_mut().zip(statuses).enumerate() {
            let trouble = status.failure.clone().or_else(|| status.trouble.clone());
            let before = cloud.status.failure.clone().or_else(|| cloud.status.trouble.clone());
            cloud.set_status(status);
            if cloud.is_closed {
                continue;
            }
            if trouble != before {
                told.push(("cloud", json!({ "cloud": number, "trouble": trouble })));
            }
            let version = Some(cloud.status.replaced);
            if cloud.told_version != version
                && let Some(manifest) = cloud.manifest()
            {
                let (source, points) = (&cloud.source, manifest.points);
                told.push((
                    "opened",
                    json!({ "cloud": number, "source": source, "points": points, "version": version }),
                ));
                if cloud.told_version.is_some() {
                    replaced.push(format!("{} has changed; this is the new one", cloud.name()));
                }
                cloud.told_version = version;
            }
        }
        replaced.into_iter().for_each(|text| self.note(text));
        told.into_iter().for_each(|(name, what)| self.events.tell(name, what));
        self.stats = self.engine.stats();
        if let Some((min, max)) = self.extent() {
            self.navigator.set_extent(min, max);
            if let Some(source) = self.waiting_path.take() {
                let extent = Extent::new(min.into(), max.into());
                match extent.and_then(|extent| source.path(&extent)) {
                    Ok(path) => self.play(path),
                    Err(error) => self.warn(error.to_string()),
                }
            }
        }
    }

    /// Takes what jobs have ended with.
    pub fn take_answers(&mut self) {
        for answer in self.jobs.answers() {
            match answer {
                Answer::List { server, index } => {
                    let found = index.as_ref().map(|index| index.datasets.len());
                    self.events.tell("list", json!({ "server": server, "datasets": found.ok() }));
                    self.open_dialog.end_list(server, index);
                }
                Answer::Values { pick, point, known } => self.know(pick, &point, known),
                Answer::Picture { file, exported, is_complete, outcome } => {
                    let error = outcome.as_ref().err();
                    let event = json!({ "file": file, "complete": is_complete, "error": error });
                    self.events.tell("picture", event);
                    self.is_writing &= !exported;
                    match outcome {
                        Ok(()) if exported => {}
                        Ok(()) => {
                            let rest = if is_complete { "" } else { ", which was still loading" };
                            let text = format!("Wrote {}{rest}", file.display());
                            self.messages.tell(Weight::Note, text);
                        }
                        Err(error) => {
                            if exported {
                                self.export = None;
                            }
                            self.messages.tell(Weight::Warning, error);
                        }
                    }
                }
                Answer::Path(Ok(path)) => {
                    self.note(format!("A path of {:.1} s", path.duration()));
                    self.path = Some(path);
                }
                Answer::Path(Err(error)) => self.warn(error),
            }
        }
    }

    /// Notes a point that was picked; asks for its attributes.
    pub fn set_picked(&mut self, point: Picked) {
        self.picks += 1;
        let number = self.picks;
        let cloud = &self.clouds[point.cloud];
        let (source, drawn, picked) =
            (cloud.source.clone(), cloud.manifest().cloned(), point.clone());
        self.jobs.start(move || Answer::Values {
            pick: number,
            known: point_values::fetch(&source, picked.key, picked.point, drawn.as_ref()),
            point: picked,
        });
        let mut ends_measurement = false;
        if let Tool::Measure(from) = &mut self.tool {
            match from.take() {
                None => *from = Some(point.world),
                Some(start) => {
                    self.measurements.push(Measurement { from: start, to: point.world });
                    ends_measurement = true;
                }
            }
        }
        let is_exact = point.is_exact;
        self.picked = Some(Pick { number, point, ends_measurement, values: None });
        if is_exact {
            self.tell_picked();
        }
    }

    /// Takes in what was fetched of a point, which may have been drawn in the middle of its cell.
    fn know(&mut self, pick: u64, point: &Picked, known: Result<Known, String>) {
        let mut exact = point.clone();
        if let Ok(Known { within_node: Some(q), lattice: Some(lattice), .. }) = &known {
            exact.put(lattice, *q);
            exact.is_exact = true;
        }
        let refine = |place: &mut [f64; 3]| {
            if *place == point.world {
                *place = exact.world;
            }
        };
        if let Tool::Measure(Some(from)) = &mut self.tool {
            refine(from);
        }
        for measured in &mut self.measurements {
            refine(&mut measured.from);
            refine(&mut measured.to);
        }
        let Some(picked) = self.picked.as_mut().filter(|p| p.number == pick) else { return };
        picked.point = exact;
        let values = known.map(|known| known.values);
        let told = json!({ "values": values.as_ref().ok() });
        picked.values = Some(values);
        if !point.is_exact {
            self.tell_picked();
        }
        self.events.tell("values", told);
    }

    fn tell_picked(&self) {
        let Some(Pick { point, ends_measurement, .. }) = &self.picked else { return };
        self.events.tell(
            "picked",
            json!({
                "cloud": point.cloud, "world": point.world, "text": point.text,
                "is_exact": point.is_exact,
                "level": point.key.level(), "crs": self.clouds[point.cloud].crs.name,
            }),
        );
        let mut measured = self.measurements.iter().rev();
        if let Some(measured) = measured.find(|m| *ends_measurement && m.to == point.world) {
            let told = json!({ "distance": measured.distance(), "height": measured.height() });
            self.events.tell("measured", told);
        }
    }

    /// Plays a path from its begin.
    pub fn play(&mut self, path: CameraPath) {
        self.recorder = None;
        self.path = Some(path);
        self.player = Some(Player::start(Instant::now()));
    }

    /// Ends a path that moves the camera; hands take over where it is. An export goes on: a hand that slips
    /// must not cost hours.
    pub fn take_over(&mut self) {
        if self.player.take().is_some() {
            self.navigator.jump(&self.camera);
        }
    }

    /// Ends an export before its time, if there is one.
    pub fn end_export(&mut self) {
        if let Some(export) = self.export.take() {
            let (done, all) = export.progress();
            self.navigator.jump(&self.camera);
            self.note(format!("Export ended, {done} of {all} pictures are written"));
        }
    }
}
