//! Where the datasets are: a local folder, or an object store.
//!
//! Both answer the same few questions, and whoever asks does not see which it is: what is there,
//! open one dataset, bring a small file that lies beside one. Nothing is written. A server keeps
//! nothing that another could not have just as well, so any number of them can serve one place.

mod blocks;
mod folder;
mod object;
mod objects;
mod small;
mod source;

use std::{
    collections::{HashMap, HashSet},
    io,
    sync::Arc,
    time::SystemTime,
};

use lodestream_preprocess::preview::{PREVIEW_SUFFIX, preview_content_id, preview_path};

use crate::{
    config::{DataPlace, ServeConfig},
    disk,
    error::Result,
    file::{DatasetFile, Identity as FileIdentity, OpenError},
    metrics::StorageMetrics,
    offload::Offload,
    open_files::OpenFiles,
};

pub(crate) use crate::open_files::SWEEP_INTERVAL;
pub(crate) use folder::{Folder, SUFFIX, dataset_name};
pub(crate) use object::Object;
pub(crate) use objects::Objects;
pub(crate) use small::SmallFile;
pub(crate) use source::{Source, read_cached};

/// Where the datasets are.
#[derive(Debug)]
pub(crate) enum Storage {
    /// A folder of this machine, and its files that are in use.
    Folder(Folder, Arc<OpenFiles>),
    /// An object store.
    Objects(Arc<Objects>),
}

/// Tells whether a file is still the one that was looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Identity {
    /// Of a folder.
    File(FileIdentity),
    /// Of an object store, by its length and what else tells versions apart there.
    Object(u64, Version),
}

/// Names of files.
#[derive(Debug, Clone, Default)]
pub(crate) struct Listing {
    /// Those that may be datasets, sorted.
    pub(crate) datasets: Vec<String>,
    /// What they are, where the list tells that: an object store's does.
    identities: HashMap<String, Identity>,
    previews: HashSet<String>,
}

impl Listing {
    fn of(names: Vec<String>) -> Self {
        let mut listing = Self::default();
        for name in names {
            if dataset_name(&name).is_some() {
                listing.datasets.push(name);
            } else if name.ends_with(PREVIEW_SUFFIX) {
                listing.previews.insert(name);
            }
        }
        listing.datasets.sort_unstable();
        listing
    }

    /// Whether the list itself says that a name leads to what was looked at.
    pub(crate) fn is_still(&self, file_name: &str, known: &Identity) -> bool {
        self.identities.get(file_name) == Some(known)
    }

    /// Whether a picture lies beside the dataset.
    pub(crate) fn has_preview(&self, file_name: &str) -> bool {
        self.previews.contains(&beside(file_name))
    }
}

/// The name of the picture that lies beside a dataset.
fn beside(file_name: &str) -> String {
    preview_path(file_name.as_ref()).display().to_string()
}

/// What tells versions of an object apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Version {
    /// The store's entity tag.
    Tag(String),
    /// Where it has none: when it was written.
    Written(SystemTime),
}

/// Objects that were looked at together, or why they could not be.
pub(crate) type Warmed = HashMap<String, std::result::Result<Object, OpenError>>;

/// A dataset whose index can be read.
#[derive(Debug)]
pub(crate) struct Readable {
    pub(crate) identity: Identity,
    pub(crate) source: Source,
    pub(crate) modified: Option<SystemTime>,
}

impl Storage {
    /// Checks that the place can be read.
    pub(crate) fn open(config: &ServeConfig, metrics: &StorageMetrics) -> Result<Self> {
        Ok(match &config.data {
            DataPlace::Folder(dir) => Self::Folder(Folder::open(dir.clone())?, Arc::default()),
            DataPlace::Objects(place) => {
                Self::Objects(Arc::new(Objects::open(place, config.cache_bytes, metrics.clone())?))
            }
        })
    }

    /// What is there.
    pub(crate) async fn list(self: &Arc<Self>) -> io::Result<Listing> {
        if let Self::Objects(objects) = &**self {
            return objects.list().await;
        }
        let storage = Arc::clone(self);
        let list = move || match &*storage {
            Self::Folder(folder, _) => folder.list(),
            Self::Objects(_) => Ok(Listing::default()),
        };
        disk::elsewhere(list).await
    }

    /// Makes ready for looking at all of these, one by one; returns what of it there is already.
    pub(crate) async fn warm(&self, file_names: &[String]) -> Warmed {
        match self {
            Self::Folder(..) => Warmed::new(),
            Self::Objects(objects) => objects.warm(file_names).await,
        }
    }

    /// Whether a name still leads to what was looked at (blocking).
    pub(crate) fn is_still(&self, listing: &Listing, file_name: &str, known: &Identity) -> bool {
        match self {
            Self::Folder(folder, _) => {
                let metadata = folder.path_of(file_name).and_then(|path| path.metadata().ok());
                metadata.is_some_and(|m| Identity::File(FileIdentity::of(&m)) == *known)
            }
            Self::Objects(_) => listing.is_still(file_name, known),
        }
    }

    /// Opens a dataset to read its index (blocking).
    pub(crate) fn readable(
        &self,
        file_name: &str,
        warmed: &mut Warmed,
    ) -> std::result::Result<Readable, OpenError> {
        match self {
            Self::Folder(folder, _) => {
                let path = folder.path_of(file_name).ok_or(OpenError::Missing)?;
                let (file, metadata) = crate::file::open_regular(&path)?;
                Ok(Readable {
                    identity: Identity::File(FileIdentity::of(&metadata)),
                    source: Source::File(file.into()),
                    modified: metadata.modified().ok(),
                })
            }
            Self::Objects(objects) => {
                let object = match warmed.remove(file_name) {
                    Some(opened) => opened?,
                    None => {
                        let opening = objects.dataset(file_name);
                        tokio::runtime::Handle::current().block_on(opening)?
                    }
                };
                let (identity, modified) = (object.identity(), Some(object.modified()));
                Ok(Readable { identity, source: Source::Object(object), modified })
            }
        }
    }

    /// Lets go of files whose names lead elsewhere by now.
    pub(crate) async fn sweep(&self) {
        if let Self::Folder(_, open_files) = self {
            let open_files = Arc::clone(open_files);
            disk::elsewhere(move || open_files.sweep()).await;
        }
    }

    /// Opens the dataset of that file name.
    pub(crate) async fn dataset(
        &self,
        file_name: &str,
        offload: &Offload,
    ) -> std::result::Result<Arc<DatasetFile>, OpenError> {
        if dataset_name(file_name).is_none() {
            return Err(OpenError::Missing);
        }
        match self {
            Self::Folder(folder, open_files) => {
                let path = folder.path_of(file_name).ok_or(OpenError::Missing)?;
                let (open_files, known) = (Arc::clone(open_files), open_files.known(&path));
                let is_local = known.as_ref().is_some_and(|(_, file)| file.is_local);
                offload.run(is_local, move || open_files.open(path, known)).await
            }
            Self::Objects(objects) => {
                let object = objects.dataset(file_name).await?;
                DatasetFile::of_object(object).map(Arc::new)
            }
        }
    }

    /// The preview that lies beside a dataset, where it shows that content (blocking).
    pub(crate) fn has_preview_of(&self, file_name: &str, content_id: &str) -> bool {
        let found = match self {
            Self::Folder(folder, _) => SmallFile::read(&folder.beside(&beside(file_name))),
            Self::Objects(_) => tokio::runtime::Handle::current().block_on(self.preview(file_name)),
        };
        found.is_ok_and(|file| preview_content_id(&file.bytes).is_some_and(|id| id == content_id))
    }

    /// The preview that lies beside a dataset, whatever it shows.
    pub(crate) async fn preview(
        &self,
        file_name: &str,
    ) -> std::result::Result<SmallFile, OpenError> {
        if dataset_name(file_name).is_none() {
            return Err(OpenError::Missing);
        }
        let beside = beside(file_name);
        match self {
            Self::Folder(folder, _) => {
                let path = folder.beside(&beside);
                disk::elsewhere(move || SmallFile::read(&path)).await
            }
            Self::Objects(objects) => objects.small(&beside).await,
        }
    }
}
