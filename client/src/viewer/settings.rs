//! What is kept from one start to the next.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{
    look::Look,
    stored::{self, StoredError},
};

/// Most entries of the list of what was opened lately.
const MAX_RECENT: usize = 12;

/// Light or dark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Default, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Theme {
    /// Light on dark.
    #[default]
    Dark,
    /// Dark on light.
    Light,
}

impl Theme {
    /// Behind the points; in the dark, what `lodestream shot` has there.
    #[must_use]
    pub const fn background(self) -> [u8; 3] {
        match self {
            Self::Dark => [18, 18, 24],
            Self::Light => [238, 240, 243],
        }
    }
}

/// What is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Light or dark.
    pub theme: Theme,
    /// Whether the panel is shown.
    pub panel: bool,
    /// Width and height of the window in logical pixels.
    pub window: [u32; 2],
    /// What pictures look like.
    pub look: Look,
    /// Most points drawn at once, over all clouds.
    pub point_budget: u64,
    /// Nodes that appear smaller are left out: the radius around them, pixels.
    pub min_node_px: f64,
    /// Most mebibytes of decoded nodes that are kept though they are not drawn.
    pub cache_mib: u64,
    /// What was opened lately, the latest first.
    pub recent: Vec<String>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theme: Theme::default(),
            panel: true,
            window: [1280, 800],
            look: Look::default(),
            point_budget: 1_000_000,
            min_node_px: 40.0,
            cache_mib: 512,
            recent: Vec::new(),
        }
    }
}

impl Settings {
    /// Fewest and most points of the budget.
    pub const BUDGETS: std::ops::RangeInclusive<u64> = 1_000..=100_000_000;
    /// Smallest and largest size below which nodes are left out, pixels.
    pub const MIN_NODE_PX: std::ops::RangeInclusive<f64> = 1.0..=1000.0;
    /// Smallest and largest cache, mebibytes.
    pub const CACHE_MIB: std::ops::RangeInclusive<u64> = 0..=65_536;

    /// Where they are kept, unless the command line says otherwise; `None` where the user has no home.
    #[must_use]
    pub fn usual_path() -> Option<PathBuf> {
        let folders = etcetera::choose_base_strategy().ok()?;
        Some(etcetera::BaseStrategy::config_dir(&folders).join("lodestream/viewer.json"))
    }

    /// Reads them. What is wrong with a file never stops the program: it is put aside as
    /// `NAME.bad`, the settings are the usual ones, and the message says so.
    #[must_use]
    pub fn open(path: &Path) -> (Self, Option<String>) {
        let checked = stored::read::<Self>(path).and_then(|settings| {
            let bad = |why| StoredError::Bad { path: path.to_owned(), why };
            settings.check().map(|()| settings).map_err(bad)
        });
        match checked {
            Ok(settings) => (settings, None),
            Err(StoredError::Missing { .. }) => (Self::default(), None),
            Err(error) => {
                let mut aside = path.as_os_str().to_owned();
                aside.push(".bad");
                let kept = match std::fs::rename(path, &aside) {
                    Ok(()) => format!("kept as {}", Path::new(&aside).display()),
                    Err(_) => "left as it is".into(),
                };
                let message = format!("Settings not used, {kept}: {error}");
                (Self::default(), Some(message))
            }
        }
    }

    /// Keeps them.
    ///
    /// # Errors
    /// `StoredError::Write`.
    pub fn keep(&self, path: &Path) -> Result<(), StoredError> {
        stored::write(path, self)
    }

    fn check(&self) -> Result<(), String> {
        let within = |is: bool, name: &str| {
            if is { Ok(()) } else { Err(format!("{name} is out of its range")) }
        };
        within(Self::BUDGETS.contains(&self.point_budget), "point_budget")?;
        within(Self::MIN_NODE_PX.contains(&self.min_node_px), "min_node_px")?;
        within(Self::CACHE_MIB.contains(&self.cache_mib), "cache_mib")?;
        within(self.window.iter().all(|side| (1..=16_384).contains(side)), "window")?;
        self.look.check().map_err(|e| e.to_string())
    }

    /// Notes what was opened.
    pub fn note_recent(&mut self, source: &str) {
        self.recent.retain(|other| other != source);
        self.recent.insert(0, source.into());
        self.recent.truncate(MAX_RECENT);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("viewer.json");
        std::fs::write(&path, text).expect("written");
        (folder, path)
    }

    #[test]
    fn settings_are_read_as_they_are_kept() {
        let (_folder, path) = file("");
        let mut settings = Settings { theme: Theme::Light, cache_mib: 7, ..Settings::default() };
        settings.note_recent("a.lods");
        settings.note_recent("b.lods");
        settings.note_recent("a.lods");
        settings.keep(&path).expect("kept");
        assert_eq!(Settings::open(&path), (settings.clone(), None));
        assert_eq!(settings.recent, ["a.lods", "b.lods"]);
    }

    #[test]
    fn a_bad_file_is_put_aside_and_the_usual_settings_stand_in() {
        for text in [
            "",
            "{",
            "\u{0}\u{1}",
            r#"{"theme":"pink"}"#,
            r#"{"point_budget":1}"#,
            r#"{"look":{"splat":"blob"}}"#,
            r#"{"look":{"max_splat_px":-1}}"#,
            r#"{"window":[0,5]}"#,
            r#"{"min_node_px":1e999}"#,
        ] {
            let (folder, path) = file(text);
            let (settings, message) = Settings::open(&path);
            assert_eq!(settings, Settings::default(), "{text}");
            assert!(message.is_some_and(|m| m.contains("viewer.json.bad")), "{text}");
            let kept = std::fs::read_to_string(folder.path().join("viewer.json.bad"));
            assert_eq!(kept.expect("kept"), text);
            assert!(!path.exists());
        }
    }

    #[test]
    fn without_a_file_the_usual_settings_are_taken_in_silence() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let opened = Settings::open(&folder.path().join("none.json"));
        assert_eq!(opened, (Settings::default(), None));
        // A folder in its place is no crash either.
        assert!(Settings::open(folder.path()).1.is_some());
    }
}
