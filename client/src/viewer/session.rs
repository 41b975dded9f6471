//! A session: what is looked at, from where and how, as a JSON file.
//!
//! ```json
//! {
//!   "format": "lodestream-session", "version": 1,
//!   "clouds": [{ "source": "127.0.0.1:8080/courtyard", "hidden_classes": [7] }],
//!   "camera": { "eye": [0, -10, 5], "target": [0, 0, 0], "up": [0, 0, 1], "fov_y_degrees": 50 },
//!   "clip": { "min": [0, 0, 0], "max": [5, 5, 5] },
//!   "bookmarks": [{ "name": "door", "camera": { } }], "measurements": []
//! }
//! ```

use std::{collections::BTreeSet, path::Path};

use glam::DVec3;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

use super::{
    look::{Look, written_option},
    measurement::Measurement,
    stored::{self, StoredError},
};
use crate::{camera::Camera, engine::ClipBox, render::ColorMode};

const FORMAT: &str = "lodestream-session";
const VERSION: u32 = 1;

/// Most clouds, bookmarks and measurements of a session.
const MOST: usize = 100_000;

/// What is looked at, from where and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    format: String,
    version: u32,
    /// What is open.
    pub clouds: Vec<SessionCloud>,
    /// Where from; an overview where it is left out.
    #[serde(default, with = "camera_option", skip_serializing_if = "Option::is_none")]
    pub camera: Option<Camera>,
    /// What it looks like.
    #[serde(default)]
    pub look: Look,
    /// Most points drawn at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point_budget: Option<u64>,
    /// Nodes that appear smaller are left out, pixels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_node_px: Option<f64>,
    /// What the view is limited to.
    #[serde(default, with = "clip_option", skip_serializing_if = "Option::is_none")]
    pub clip: Option<ClipBox>,
    /// Whether it is limited to it at the moment.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub clips: bool,
    /// Places to come back to.
    #[serde(default)]
    pub bookmarks: Vec<Bookmark>,
    /// What was measured.
    #[serde(default)]
    pub measurements: Vec<Measurement>,
}

/// A cloud of a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SessionCloud {
    /// As `lodestream view` takes it.
    pub source: String,
    /// Whether it is shown.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub visible: bool,
    /// Where its colours come from, if not from where the look says.
    #[serde(default, with = "written_option", skip_serializing_if = "Option::is_none")]
    pub color: Option<ColorMode>,
    /// Classes that are not shown.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub hidden_classes: BTreeSet<u8>,
}

fn yes() -> bool {
    true
}

/// A place to come back to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bookmark {
    /// For people.
    pub name: String,
    /// Where from.
    #[serde(with = "camera")]
    pub camera: Camera,
}

impl Session {
    /// A session of clouds; the rest is to be filled in.
    #[must_use]
    pub fn new(clouds: Vec<SessionCloud>) -> Self {
        Self {
            format: FORMAT.into(),
            version: VERSION,
            clouds,
            camera: None,
            look: Look::default(),
            point_budget: None,
            min_node_px: None,
            clip: None,
            clips: true,
            bookmarks: Vec::new(),
            measurements: Vec::new(),
        }
    }

    /// Reads a session file. Files that it names as relative paths lie beside it.
    ///
    /// # Errors
    /// `StoredError` where it cannot be read or is no session.
    pub fn open(path: &Path) -> Result<Self, StoredError> {
        let bad = |why: String| StoredError::Bad { path: path.to_owned(), why };
        let value: serde_json::Value = stored::read(path)?;
        let format = value["format"].as_str();
        if format != Some(FORMAT) {
            let why = format!("not a session: its \"format\" is not {FORMAT:?}");
            return Err(bad(why));
        }
        match value["version"].as_u64() {
            Some(version) if version == u64::from(VERSION) => {}
            Some(version) => {
                let why = format!("version {version}; this program reads {VERSION}: update it");
                return Err(bad(why));
            }
            None => return Err(bad("it has no \"version\"".into())),
        }
        let mut session: Self = serde_json::from_value(value).map_err(|e| bad(e.to_string()))?;
        session.check().map_err(bad)?;
        for cloud in &mut session.clouds {
            let beside = path.parent().map(|folder| folder.join(&cloud.source));
            if let Some(beside) =
                beside.filter(|file| !cloud.source.contains("://") && file.is_file())
            {
                cloud.source = beside.display().to_string();
            }
        }
        Ok(session)
    }

    /// Writes the session file.
    ///
    /// # Errors
    /// `StoredError::Write`.
    pub fn save(&self, path: &Path) -> Result<(), StoredError> {
        let mut session = self.clone();
        // What lies beside the session, or below, is found there wherever both are moved.
        let folder = std::path::absolute(path).ok();
        let folder = folder.as_deref().and_then(Path::parent);
        for cloud in &mut session.clouds {
            let beside =
                folder.and_then(|folder| Path::new(&cloud.source).strip_prefix(folder).ok());
            if let Some(beside) = beside.map(|beside| beside.display().to_string()) {
                cloud.source = beside;
            }
        }
        stored::write(path, &session)
    }

    fn check(&self) -> Result<(), String> {
        if [self.clouds.len(), self.bookmarks.len(), self.measurements.len()]
            .iter()
            .any(|n| *n > MOST)
        {
            return Err(format!("more than {MOST} clouds, bookmarks or measurements"));
        }
        if self.point_budget.is_some_and(|n| !super::Settings::BUDGETS.contains(&n)) {
            return Err("point_budget is out of its range".into());
        }
        if self.min_node_px.is_some_and(|px| !super::Settings::MIN_NODE_PX.contains(&px)) {
            return Err("min_node_px is out of its range".into());
        }
        if self.measurements.iter().any(|m| !m.is_finite()) {
            return Err("a measurement is not of finite numbers".into());
        }
        self.look.check().map_err(|e| e.to_string())
    }
}

/// A camera as camera files hold it.
fn camera_file(camera: &Camera) -> serde_json::Result<serde_json::Value> {
    serde_json::from_str(&camera.to_json())
}

/// Cameras as camera files hold them.
mod camera {
    use super::*;

    pub fn serialize<S: Serializer>(camera: &Camera, out: S) -> Result<S::Ok, S::Error> {
        camera_file(camera).map_err(serde::ser::Error::custom)?.serialize(out)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Camera, D::Error> {
        let value = serde_json::Value::deserialize(input)?;
        Camera::from_json(&value.to_string()).map_err(D::Error::custom)
    }
}

mod camera_option {
    use super::*;

    pub fn serialize<S: Serializer>(camera: &Option<Camera>, out: S) -> Result<S::Ok, S::Error> {
        match camera {
            Some(camera) => camera_file(camera).map_err(serde::ser::Error::custom)?.serialize(out),
            None => out.serialize_none(),
        }
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Option<Camera>, D::Error> {
        let value = Option::<serde_json::Value>::deserialize(input)?;
        let read = |value: serde_json::Value| Camera::from_json(&value.to_string());
        value.map(read).transpose().map_err(D::Error::custom)
    }
}

mod clip_option {
    use super::*;

    #[derive(Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Corners {
        min: [f64; 3],
        max: [f64; 3],
    }

    pub fn serialize<S: Serializer>(clip: &Option<ClipBox>, out: S) -> Result<S::Ok, S::Error> {
        let corners = |clip: &ClipBox| Corners { min: clip.min.into(), max: clip.max.into() };
        clip.as_ref().map(corners).serialize(out)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Option<ClipBox>, D::Error> {
        let corners = Option::<Corners>::deserialize(input)?;
        let clip = |Corners { min, max }| ClipBox { min: DVec3::from(min), max: DVec3::from(max) };
        let clip = corners.map(clip);
        if clip.is_some_and(|clip| !(clip.min.is_finite() && clip.max.is_finite())) {
            return Err(D::Error::custom("clip is not of finite numbers"));
        }
        Ok(clip)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera::overview(DVec3::ZERO, DVec3::splat(3.0), 1.5)
    }

    fn session() -> Session {
        let cloud = SessionCloud {
            source: "127.0.0.1:1/courtyard".into(),
            visible: false,
            color: Some(ColorMode::Intensity),
            hidden_classes: BTreeSet::from([7, 18]),
        };
        Session {
            camera: Some(camera()),
            point_budget: Some(50_000),
            clip: Some(ClipBox { min: DVec3::ZERO, max: DVec3::ONE }),
            bookmarks: vec![Bookmark { name: "door".into(), camera: camera() }],
            measurements: vec![Measurement { from: [0.0; 3], to: [1.0, 2.0, 3.0] }],
            ..Session::new(vec![cloud])
        }
    }

    #[test]
    fn a_session_is_opened_as_it_was_saved() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("a.json");
        session().save(&path).expect("saved");
        let opened = Session::open(&path).expect("own file");
        let (saved, camera) = (session(), opened.camera.expect("there"));
        assert!((camera.eye - saved.camera.expect("there").eye).length() < 1e-12);
        assert_eq!((&opened.clouds, opened.clip), (&saved.clouds, saved.clip));
        assert_eq!(opened.measurements, saved.measurements);
        assert_eq!(opened.bookmarks[0].name, "door");
    }

    #[test]
    fn files_beside_the_session_are_found() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("a.json");
        std::fs::write(folder.path().join("b.lods"), "").expect("written");
        let cloud = SessionCloud { source: "b.lods".into(), ..session().clouds.remove(0) };
        Session::new(vec![cloud]).save(&path).expect("saved");
        let opened = Session::open(&path).expect("own file");
        assert_eq!(opened.clouds[0].source, folder.path().join("b.lods").display().to_string());
    }

    #[test]
    fn a_session_that_is_moved_with_its_files_is_opened_and_a_box_that_is_off_is_kept() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let [old, new] = ["old", "new"].map(|name| folder.path().join(name));
        std::fs::create_dir(&old).expect("made");
        std::fs::write(old.join("b.lods"), "").expect("written");
        let source = old.join("b.lods").display().to_string();
        let cloud = SessionCloud { source, ..session().clouds.remove(0) };
        let elsewhere = SessionCloud { source: "/elsewhere/c.lods".into(), ..cloud.clone() };
        let saved = Session { clouds: vec![cloud, elsewhere], clips: false, ..session() };
        saved.save(&old.join("a.json")).expect("saved");
        std::fs::rename(&old, &new).expect("moved");
        let opened = Session::open(&new.join("a.json")).expect("own file");
        assert_eq!(opened.clouds[0].source, new.join("b.lods").display().to_string());
        assert_eq!(opened.clouds[1].source, "/elsewhere/c.lods");
        assert_eq!((opened.clip, opened.clips), (saved.clip, false));
    }

    #[test]
    fn what_is_no_session_is_refused_with_a_reason() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("a.json");
        let said = |text: &str| {
            std::fs::write(&path, text).expect("written");
            Session::open(&path).expect_err(text).to_string()
        };
        assert!(said("{").contains("a.json"));
        assert!(said("{}").contains("not a session"));
        let with = |rest: &str| {
            said(&format!(r#"{{"format":"lodestream-session","version":1,"clouds":[]{rest}}}"#))
        };
        let newer = r#"{"format":"lodestream-session","version":2}"#;
        assert!(said(newer).contains("update"));
        assert!(
            with(r#","camera":{"eye":[0,0,0],"target":[0,0,0],"fov_y_degrees":5}"#)
                .contains("same place")
        );
        assert!(with(r#","colour":1"#).contains("unknown field"));
        assert!(with(r#","point_budget":1"#).contains("point_budget"));
        assert!(with(r#","look":{"splat":"blob"}"#).contains("blob"));
    }
}
