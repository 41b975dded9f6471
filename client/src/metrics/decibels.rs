//! Decibels in JSON and CSV, which have no number for the infinite: `"Infinity"`, a text that Rust,
//! Python and JavaScript all read as one.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    Number(f64),
    Text(String),
}

pub(super) fn serialize<S: Serializer>(db: &Option<f64>, to: S) -> Result<S::Ok, S::Error> {
    let written = |db: f64| {
        if db.is_finite() { Written::Number(db) } else { Written::Text("Infinity".into()) }
    };
    db.map(written).serialize(to)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    let read = |written| match written {
        Written::Number(db) => Ok(db),
        Written::Text(text) if text == "Infinity" => Ok(f64::INFINITY),
        Written::Text(text) => {
            Err(D::Error::custom(format!("{text:?}: expected decibels, or \"Infinity\"")))
        }
    };
    Option::<Written>::deserialize(from)?.map(read).transpose()
}
