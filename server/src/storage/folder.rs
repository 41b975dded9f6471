//! The folder whose `*.lods` files are served.
//!
//! Only the folder itself, no folders below it; only names that end in `.lods` and do not start
//! with a dot, so that files being written are not shown. Symbolic links are followed wherever they
//! lead: whoever may write to the folder decides what is served, and a link is how a dataset on
//! another disk gets in. Clients only ever name an entry of the folder.

use std::{
    io,
    path::{Component, Path, PathBuf},
};

use super::Listing;
use crate::error::{Error, Result};

/// What the name of a dataset's file ends in.
pub(crate) const SUFFIX: &str = ".lods";

/// A folder of datasets.
#[derive(Debug)]
pub(crate) struct Folder {
    dir: PathBuf,
}

impl Folder {
    /// Checks that the folder can be read.
    pub(crate) fn open(dir: PathBuf) -> Result<Self> {
        let folder = Self { dir };
        match folder.list() {
            Ok(_) => Ok(folder),
            Err(source) => Err(Error::Folder { dir: folder.dir, source }),
        }
    }

    /// What the folder holds.
    pub(super) fn list(&self) -> io::Result<Listing> {
        let entries = std::fs::read_dir(&self.dir)?;
        // A name that is not Unicode has no address.
        let names = entries.map(|entry| Ok(entry?.file_name().into_string().unwrap_or_default()));
        Ok(Listing::of(names.collect::<io::Result<Vec<_>>>()?))
    }

    /// Where the file of that name would be; `None` where no dataset can be called that.
    pub(crate) fn path_of(&self, file_name: &str) -> Option<PathBuf> {
        dataset_name(file_name).map(|_| self.dir.join(file_name))
    }

    /// Where a file is that lies beside a dataset; its name is made from the dataset's.
    pub(super) fn beside(&self, file_name: &str) -> PathBuf {
        self.dir.join(file_name)
    }
}

/// The dataset's name, where the file name is one of a dataset: a single path component that ends
/// in `.lods` and is not hidden.
pub(crate) fn dataset_name(file_name: &str) -> Option<&str> {
    let name = file_name.strip_suffix(SUFFIX).filter(|name| !name.is_empty())?;
    let mut components = Path::new(file_name).components();
    let is_plain = components.next() == Some(Component::Normal(file_name.as_ref()))
        && components.next().is_none();
    (is_plain && !name.starts_with('.') && !name.contains('\0')).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_visible_lods_names_are_datasets() {
        assert_eq!(dataset_name("a b.c.lods"), Some("a b.c"));
        for name in [
            ".lods",
            "a",
            "a.lods.part",
            ".a.lods",
            "..lods",
            "../a.lods",
            "/a.lods",
            "b/a.lods",
            "./a.lods",
            "a.lods/",
            "a\0.lods",
            "",
        ] {
            assert_eq!(dataset_name(name), None, "{name:?}");
        }
    }
}
