//! The list of datasets.

use std::{
    collections::HashMap,
    io,
    sync::{Mutex, PoisonError},
};

use lodestream_preprocess::FileSource;
use lodestream_protocol::{Attribute, Dataset};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde::{Deserialize, Serialize};

use crate::{
    file::{Identity, OpenError, open_regular},
    folder::{Folder, dataset_name},
};

/// Characters of a path segment that need no escape (RFC 3986, section 2.3).
const SEGMENT: &AsciiSet = &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// What `GET /datasets` answers.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct DatasetIndex {
    /// Datasets, sorted by file name.
    pub datasets: Vec<DatasetEntry>,
    /// Files that look like datasets by their name but cannot be read as such.
    pub unreadable: Vec<UnreadableEntry>,
}

/// One dataset of the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DatasetEntry {
    /// File name without `.lods`.
    pub name: String,
    /// Address, relative to that of the list.
    pub url: String,
    /// Address of this very content, relative to that of the list: never of another, so that what it
    /// brings may be kept for good.
    pub content_url: String,
    /// Elements.
    pub points: u64,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Levels of the tree.
    pub levels: u8,
    /// Tight bounds in world units; nothing where there are no points.
    pub bounds: Option<BoundsEntry>,
    /// What each element carries besides its position.
    pub attributes: Vec<AttributeEntry>,
    /// Identity of the content, in hexadecimal: the entity tag without its quotes.
    pub content_id: String,
}

/// An axis-aligned box in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BoundsEntry {
    /// Lowest coordinates.
    pub min: [f64; 3],
    /// Highest coordinates.
    pub max: [f64; 3],
}

/// One attribute of a dataset in the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AttributeEntry {
    /// Unique name.
    pub name: String,
    /// Type of each component, as in the manifest.
    #[serde(rename = "type")]
    pub scalar: lodestream_protocol::ScalarType,
    /// Components per value.
    pub components: u8,
    /// Whether all elements share one value.
    pub constant: bool,
}

/// A file that is not served.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct UnreadableEntry {
    /// File name.
    pub file: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Makes the list, and remembers the entries of files that have not changed since.
#[derive(Debug, Default)]
pub(crate) struct IndexCache {
    entries: Mutex<HashMap<String, (Identity, DatasetEntry)>>,
}

impl IndexCache {
    /// Reads the folder (blocking).
    pub(crate) fn read(&self, folder: &Folder) -> io::Result<DatasetIndex> {
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let mut known = std::mem::take(&mut *entries);
        let mut index = DatasetIndex::default();
        for file_name in folder.file_names()? {
            match look_up(folder, &file_name, known.remove(&file_name)) {
                Ok((identity, entry)) => {
                    index.datasets.push(entry.clone());
                    entries.insert(file_name, (identity, entry));
                }
                Err(OpenError::Missing) => {}
                Err(OpenError::Unreadable(reason)) => {
                    index.unreadable.push(UnreadableEntry { file: file_name, reason });
                }
            }
        }
        Ok(index)
    }
}

fn look_up(
    folder: &Folder,
    file_name: &str,
    known: Option<(Identity, DatasetEntry)>,
) -> Result<(Identity, DatasetEntry), OpenError> {
    let path = folder.path_of(file_name).ok_or(OpenError::Missing)?;
    if let (Some(known), Ok(metadata)) = (known, std::fs::metadata(&path))
        && known.0 == Identity::of(&metadata)
    {
        return Ok(known);
    }
    let (file, metadata) = open_regular(&path)?;
    let dataset =
        Dataset::open(FileSource::from(file)).map_err(|e| OpenError::Unreadable(e.to_string()))?;
    Ok((Identity::of(&metadata), entry(file_name, &dataset)))
}

fn entry(file_name: &str, dataset: &Dataset<FileSource>) -> DatasetEntry {
    let manifest = dataset.manifest();
    let header = &dataset.boot().header;
    let attribute = |a: &Attribute| AttributeEntry {
        name: a.name.clone(),
        scalar: a.scalar,
        components: a.components,
        constant: a.group().is_none(),
    };
    let url = format!("datasets/{}", utf8_percent_encode(file_name, SEGMENT));
    DatasetEntry {
        name: dataset_name(file_name).unwrap_or(file_name).to_owned(),
        content_url: format!("{url}?v={}", header.content_id_hex()),
        url,
        points: manifest.points,
        bytes: header.file_bytes,
        levels: manifest.levels,
        bounds: manifest.bounds_world().map(|(min, max)| BoundsEntry { min, max }),
        attributes: manifest.attributes.iter().map(attribute).collect(),
        content_id: header.content_id_hex(),
    }
}
