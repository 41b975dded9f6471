//! Paths as JSON files.

use std::{fmt, io::Read, path::Path};

use glam::DVec3;
use serde::{
    Deserialize, Deserializer, Serialize,
    de::{Error, SeqAccess, Visitor},
};

use super::{CameraPath, KeyFrame, Lens, MAX_KEYS, PathError};

/// What a path file says that it is.
pub const FORMAT: &str = "lodestream-path";

/// The version of the format that this program reads and writes.
pub const VERSION: u32 = 1;

/// Longest file that is read: some hundred bytes for each of [`MAX_KEYS`] keys.
const MAX_FILE_BYTES: u64 = 256 << 20;

/// What tells a path file from other JSON.
#[derive(Deserialize)]
struct Marker {
    format: String,
    version: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathFile {
    /// [`Marker`] has looked at this and the next one.
    #[serde(rename = "format")]
    _format: String,
    #[serde(rename = "version")]
    _version: u32,
    #[serde(default)]
    name: Option<String>,
    #[serde(default, rename = "loop")]
    is_loop: bool,
    #[serde(deserialize_with = "keys")]
    keys: Vec<KeyFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyFile {
    time: f64,
    position: [f64; 3],
    target: [f64; 3],
    #[serde(default = "z_axis", skip_serializing_if = "is_z_axis")]
    up: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fov_y_degrees: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    orthographic_height: Option<f64>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    jump: bool,
}

fn z_axis() -> [f64; 3] {
    DVec3::Z.to_array()
}

fn is_z_axis(up: &[f64; 3]) -> bool {
    *up == z_axis()
}

impl CameraPath {
    /// Reads the text of a path file.
    ///
    /// # Errors
    /// [`PathError::Json`] where the text is not such a file, and as [`new`](Self::new).
    pub fn from_json(text: &str) -> Result<Self, PathError> {
        let json = |e: serde_json::Error| PathError::Json(e.to_string());
        let marker: Marker = serde_json::from_str(text).map_err(json)?;
        if marker.format != FORMAT {
            let format = marker.format;
            return Err(PathError::Json(format!("format is {format:?} instead of {FORMAT:?}")));
        }
        if !(1..=VERSION).contains(&marker.version) {
            let version = marker.version;
            return Err(PathError::Json(format!(
                "version {version} of the format: this program reads {VERSION}; update it"
            )));
        }
        let file: PathFile = serde_json::from_str(text).map_err(json)?;
        let keys = file.keys.iter().enumerate().map(|(index, key)| {
            key.frame().map_err(|why| PathError::Key { number: index + 1, why: why.into() })
        });
        let path = Self::new(keys.collect::<Result<_, _>>()?, file.is_loop)?;
        Ok(match file.name {
            Some(name) => path.with_name(name),
            None => path,
        })
    }

    /// The text of a path file, as [`from_json`](Self::from_json) reads it: one line for each key.
    #[must_use]
    pub fn to_json(&self) -> String {
        let mut head = vec![
            format!("  \"format\": {}", json(&FORMAT)),
            format!("  \"version\": {}", json(&VERSION)),
        ];
        head.extend(self.name().map(|name| format!("  \"name\": {}", json(&name))));
        head.extend(self.is_loop().then(|| "  \"loop\": true".into()));
        let keys: Vec<String> =
            self.keys().iter().map(|key| format!("    {}", json(&KeyFile::of(key)))).collect();
        format!("{{\n{},\n  \"keys\": [\n{}\n  ]\n}}\n", head.join(",\n"), keys.join(",\n"))
    }

    /// Reads a path file.
    ///
    /// # Errors
    /// [`PathError::File`] where it cannot be read; otherwise as [`from_json`](Self::from_json).
    pub fn read(path: &Path) -> Result<Self, PathError> {
        let failed = |why: String| PathError::File { path: path.to_owned(), why };
        let file = std::fs::File::open(path).map_err(|e| failed(e.to_string()))?;
        let mut text = String::new();
        let read = file.take(MAX_FILE_BYTES + 1).read_to_string(&mut text);
        let bytes = read.map_err(|e| failed(e.to_string()))?;
        if bytes as u64 > MAX_FILE_BYTES {
            return Err(failed(format!("longer than {MAX_FILE_BYTES} bytes: no camera path")));
        }
        Self::from_json(&text).map_err(|e| failed(e.to_string()))
    }

    /// Writes a path file.
    ///
    /// # Errors
    /// [`PathError::File`] where it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), PathError> {
        std::fs::write(path, self.to_json())
            .map_err(|e| PathError::File { path: path.to_owned(), why: e.to_string() })
    }
}

fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("finite numbers, texts and options always serialize")
}

/// Reads the keys one by one, so that what is wrong with one names it.
fn keys<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<KeyFile>, D::Error> {
    struct Keys;

    impl<'de> Visitor<'de> for Keys {
        type Value = Vec<KeyFile>;

        fn expecting(&self, out: &mut fmt::Formatter) -> fmt::Result {
            out.write_str("a list of keys")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut keys = Vec::new();
            loop {
                let number = keys.len() + 1;
                let key = list.next_element();
                match key.map_err(|e| A::Error::custom(format!("key {number}: {e}")))? {
                    Some(_) if number > MAX_KEYS => {
                        return Err(A::Error::custom(format!("more than {MAX_KEYS} keys")));
                    }
                    Some(key) => keys.push(key),
                    None => return Ok(keys),
                }
            }
        }
    }

    deserializer.deserialize_seq(Keys)
}

impl KeyFile {
    fn of(key: &KeyFrame) -> Self {
        let (fov_y_degrees, orthographic_height) = match key.lens {
            Lens::FovYDegrees(degrees) => (Some(degrees), None),
            Lens::OrthographicHeight(height) => (None, Some(height)),
        };
        Self {
            time: key.time,
            position: key.position.to_array(),
            target: key.target.to_array(),
            up: key.up.to_array(),
            fov_y_degrees,
            orthographic_height,
            jump: key.jump,
        }
    }

    fn frame(&self) -> Result<KeyFrame, &'static str> {
        let lens = match (self.fov_y_degrees, self.orthographic_height) {
            (Some(degrees), None) => Lens::FovYDegrees(degrees),
            (None, Some(height)) => Lens::OrthographicHeight(height),
            (None, None) => return Err("give fov_y_degrees or orthographic_height"),
            (Some(_), Some(_)) => {
                return Err("give either fov_y_degrees or orthographic_height, not both");
            }
        };
        Ok(KeyFrame {
            time: self.time,
            position: self.position.into(),
            target: self.target.into(),
            up: self.up.into(),
            lens,
            jump: self.jump,
        })
    }
}
