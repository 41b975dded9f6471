//! The list of datasets.

use std::{
    collections::HashMap,
    io,
    sync::Arc,
    time::{Duration, Instant, SystemTime},
};

use lodestream_protocol::{Attribute, Dataset, ScalarType};
use percent_encoding::{AsciiSet, NON_ALPHANUMERIC, utf8_percent_encode};
use serde::{Deserialize, Serialize};
use tokio::sync::Mutex;
use utoipa::ToSchema;

use crate::{
    access::Rights,
    conditional::http_date,
    file::{OpenError, UNANSWERED},
    storage::{Identity, Listing, Readable, SUFFIX, Source, Storage, Warmed, dataset_name},
};

/// Characters of a path segment that need no escape (RFC 3986, section 2.3).
pub(crate) const SEGMENT: &AsciiSet =
    &NON_ALPHANUMERIC.remove(b'-').remove(b'.').remove(b'_').remove(b'~');

/// What `GET /datasets` answers.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
pub struct DatasetIndex {
    /// Datasets, sorted by file name.
    pub datasets: Vec<DatasetEntry>,
    /// Files that look like datasets by their name but cannot be read as such.
    pub unreadable: Vec<UnreadableEntry>,
}

impl DatasetIndex {
    /// Leaves out what may not be read, and gives the rest addresses that open it.
    pub(crate) fn keep_readable(&mut self, rights: &Rights) {
        self.datasets.retain(|entry| rights.may_read(&format!("{}{SUFFIX}", entry.name)));
        self.unreadable.retain(|entry| rights.may_read(&entry.file));
        for entry in &mut self.datasets {
            entry.url = rights.address(&entry.url);
            entry.content_url = rights.address(&entry.content_url);
            entry.preview = entry.preview.as_deref().map(|url| rights.address(url));
        }
    }
}

/// One dataset of the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
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
    /// When the file was last changed, as RFC 3339 writes it, where that is known.
    pub modified: Option<String>,
    /// Address of a small picture, relative to that of the list, where there is one.
    pub preview: Option<String>,
    /// Identity of the content, in hexadecimal: the entity tag without its quotes.
    pub content_id: String,
}

/// An axis-aligned box in world units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BoundsEntry {
    /// Lowest coordinates.
    pub min: [f64; 3],
    /// Highest coordinates.
    pub max: [f64; 3],
}

/// One attribute of a dataset in the list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AttributeEntry {
    /// Unique name.
    pub name: String,
    /// Type of each component, as in the manifest.
    #[serde(rename = "type")]
    pub scalar: String,
    /// Components per value.
    pub components: u8,
    /// Whether all elements share one value.
    pub constant: bool,
}

/// A file that is not served.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct UnreadableEntry {
    /// File name.
    pub file: String,
    /// What is wrong with it.
    pub reason: String,
}

/// Once so much time was lost to datasets that are not to be had, no more are asked for until the list is made again: a
/// store that has fallen silent costs as much for each.
const MOST_LOST: Duration = Duration::from_secs(20);

/// Makes the list, and remembers the entries of files that have not changed since.
#[derive(Debug, Default)]
pub(crate) struct IndexCache {
    /// Held while the list is made: who comes meanwhile waits, and finds it all here.
    entries: Arc<Mutex<HashMap<String, Known>>>,
}

/// An entry, and what it was made from.
#[derive(Debug, Clone)]
struct Known {
    identity: Identity,
    entry: DatasetEntry,
}

impl IndexCache {
    /// Reads the list.
    pub(crate) async fn read(&self, storage: &Arc<Storage>) -> io::Result<DatasetIndex> {
        let mut entries = Arc::clone(&self.entries).lock_owned().await;
        let storage = Arc::clone(storage);
        // In a task of its own: who asked may go away, and what was found is for the next as well.
        let making = tokio::spawn(async move {
            let listing = storage.list().await?;
            let known = std::mem::take(&mut *entries);
            let is_still = |name: &&String| {
                known.get(*name).is_some_and(|known| listing.is_still(name, &known.identity))
            };
            let new = listing.datasets.iter().filter(|name| !is_still(name));
            let warmed = storage.warm(&new.cloned().collect::<Vec<_>>()).await;
            let look = move || look(&storage, &listing, known, warmed);
            let looking = tokio::task::spawn_blocking(look);
            let (index, known) = looking.await.map_err(io::Error::other)?;
            *entries = known;
            Ok(index)
        });
        making.await.map_err(io::Error::other)?
    }
}

/// Looks at each file (blocking).
fn look(
    storage: &Storage,
    listing: &Listing,
    mut known: HashMap<String, Known>,
    mut warmed: Warmed,
) -> (DatasetIndex, HashMap<String, Known>) {
    let mut index = DatasetIndex::default();
    let mut entries = HashMap::with_capacity(listing.datasets.len());
    let mut lost = Duration::ZERO;
    for file_name in &listing.datasets {
        let known = known.remove(file_name);
        let begin = Instant::now();
        let found =
            match known.filter(|known| storage.is_still(listing, file_name, &known.identity)) {
                None if lost >= MOST_LOST => Err(OpenError::Unanswered),
                None => look_at(storage, file_name, &mut warmed),
                Some(known) => Ok(known),
            };
        if found.is_err() {
            lost += begin.elapsed();
        }
        let found = found.map(|found| with_preview(found, storage, listing, file_name));
        let reason = match found {
            Ok(found) => {
                index.datasets.push(found.entry.clone());
                entries.insert(file_name.clone(), found);
                continue;
            }
            Err(OpenError::Missing) => continue,
            Err(OpenError::Unreadable(reason)) => reason,
            Err(OpenError::Unanswered) => UNANSWERED.to_owned(),
        };
        index.unreadable.push(UnreadableEntry { file: file_name.clone(), reason });
    }
    (index, entries)
}

fn look_at(storage: &Storage, file_name: &str, warmed: &mut Warmed) -> Result<Known, OpenError> {
    let Readable { identity, source, modified } = storage.readable(file_name, warmed)?;
    let dataset = Dataset::open(source).map_err(|e| OpenError::Unreadable(e.to_string()))?;
    Ok(Known { identity, entry: entry(file_name, &dataset, modified) })
}

/// A picture comes after its dataset, and may be that of the one before for a while.
fn with_preview(mut found: Known, storage: &Storage, listing: &Listing, file_name: &str) -> Known {
    let entry = &mut found.entry;
    if !listing.has_preview(file_name) {
        entry.preview = None;
    } else if entry.preview.is_none() && storage.has_preview_of(file_name, &entry.content_id) {
        entry.preview = Some(format!("{}/preview.png?v={}", entry.url, entry.content_id));
    }
    found
}

fn entry(file_name: &str, dataset: &Dataset<Source>, modified: Option<SystemTime>) -> DatasetEntry {
    let manifest = dataset.manifest();
    let header = &dataset.boot().header;
    let attribute = |a: &Attribute| AttributeEntry {
        name: a.name.clone(),
        scalar: scalar_name(a.scalar),
        components: a.components,
        constant: a.group().is_none(),
    };
    let url = format!("datasets/{}", utf8_percent_encode(file_name, SEGMENT));
    // Times that cannot be told are left out, as HTTP's dates are.
    let modified = modified.and_then(|modified| http_date(modified, SystemTime::now()));
    let rfc3339 = |date| humantime::format_rfc3339_seconds(SystemTime::from(date)).to_string();
    DatasetEntry {
        name: dataset_name(file_name).unwrap_or(file_name).to_owned(),
        content_url: format!("{url}?v={}", header.content_id_hex()),
        preview: None,
        url,
        points: manifest.points,
        bytes: header.file_bytes,
        levels: manifest.levels,
        bounds: manifest.bounds_world().map(|(min, max)| BoundsEntry { min, max }),
        attributes: manifest.attributes.iter().map(attribute).collect(),
        modified: modified.map(rfc3339),
        content_id: header.content_id_hex(),
    }
}

/// The type's name in the manifest.
fn scalar_name(scalar: ScalarType) -> String {
    format!("{scalar:?}").to_lowercase()
}
