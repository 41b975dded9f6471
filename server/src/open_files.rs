//! Dataset files that are kept open between requests.
//!
//! To open a file, to read its header and to close it again takes half of the time that a small
//! range takes. So files stay open, and a request only asks the system whether the name still leads
//! to the same one: a dataset that is replaced, cut short or removed is so for the very next request.
//! [`sweep`](OpenFiles::sweep) lets go of files whose name leads elsewhere by now, asked for or not; until then, a
//! removed one still takes its disk space.

use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::{Arc, PoisonError, RwLock},
    time::Duration,
};

use crate::file::{DatasetFile, Identity, OpenError, missing_or_unreadable};

/// Files kept open: far fewer than a process may have.
const MAX_OPEN: usize = 256;

/// How often it is looked at where the names of open files lead.
pub(crate) const SWEEP_INTERVAL: Duration = Duration::from_secs(10);

/// An open file, and what its path led to when it was opened.
pub(crate) type Entry = (Identity, Arc<DatasetFile>);

/// Open files by path.
#[derive(Debug, Default)]
pub(crate) struct OpenFiles {
    files: RwLock<HashMap<PathBuf, Entry>>,
}

impl OpenFiles {
    /// The file that the path led to when it was last asked for.
    pub(crate) fn known(&self, path: &Path) -> Option<Entry> {
        self.files.read().unwrap_or_else(PoisonError::into_inner).get(path).cloned()
    }

    /// The file that the path leads to now, which may be the known one (blocking).
    pub(crate) fn open(
        &self,
        path: PathBuf,
        known: Option<Entry>,
    ) -> Result<Arc<DatasetFile>, OpenError> {
        let identity = identity_of(&path);
        if let (Some((known, file)), Ok(now)) = (known, &identity)
            && known == *now
        {
            return Ok(file);
        }
        let opened = identity.and_then(|_| DatasetFile::open(path.clone()));
        let mut files = self.files.write().unwrap_or_else(PoisonError::into_inner);
        // What is let go of is closed after the lock: a private copy takes its time.
        let (found, _former, _other) = match opened {
            Ok((identity, file)) => {
                let file = Arc::new(file);
                let is_full = files.len() >= MAX_OPEN && !files.contains_key(&path);
                // Any of them: whoever has this many datasets in use opens them as before.
                let any = is_full.then(|| files.keys().next().cloned()).flatten();
                let other = any.and_then(|any| files.remove(&any));
                let former = files.insert(path, (identity, Arc::clone(&file)));
                (Ok(file), former, other)
            }
            Err(error) => (Err(error), files.remove(&path), None),
        };
        drop(files);
        found
    }

    /// Closes files whose path leads elsewhere by now (blocking).
    pub(crate) fn sweep(&self) {
        let known: Vec<_> = {
            let files = self.files.read().unwrap_or_else(PoisonError::into_inner);
            files.iter().map(|(path, (identity, _))| (path.clone(), identity.clone())).collect()
        };
        for (path, identity) in known {
            if identity_of(&path).as_ref() != Ok(&identity) {
                let mut files = self.files.write().unwrap_or_else(PoisonError::into_inner);
                let is_known = files.get(&path).is_some_and(|(now, _)| *now == identity);
                let former = is_known.then(|| files.remove(&path));
                drop(files);
                drop(former);
            }
        }
    }
}

fn identity_of(path: &Path) -> Result<Identity, OpenError> {
    let metadata = path.metadata().map_err(missing_or_unreadable)?;
    Ok(Identity::of(&metadata))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::header;
    use lodestream_protocol::Boot;

    fn dataset() -> Vec<u8> {
        let mut bytes = header(64).encode().to_vec();
        assert!(Boot::parse(&bytes).is_err());
        bytes.extend_from_slice(b"more");
        bytes
    }

    #[test]
    fn a_file_is_opened_once_and_again_when_it_has_changed() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.lods");
        let open_files = OpenFiles::default();
        let open = || open_files.open(path.clone(), open_files.known(&path));
        assert_eq!(open().err(), Some(OpenError::Missing));

        std::fs::write(&path, dataset()).expect("writable");
        let first = open().expect("a dataset");
        assert!(Arc::ptr_eq(&first, &open().expect("a dataset")));

        let other = folder.path().join("b");
        std::fs::write(&other, dataset()).expect("writable");
        std::fs::rename(&other, &path).expect("one folder");
        let second = open().expect("a dataset");
        assert!(!Arc::ptr_eq(&first, &second));

        let file = std::fs::OpenOptions::new().write(true).open(&path).expect("writable");
        file.set_len(63).expect("writable");
        assert!(matches!(open(), Err(OpenError::Unreadable(_))));
        std::fs::remove_file(&path).expect("it is there");
        assert_eq!(open().err(), Some(OpenError::Missing));
    }

    #[test]
    fn removed_files_are_let_go_of_without_being_asked_for() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.lods");
        std::fs::write(&path, dataset()).expect("writable");
        let open_files = OpenFiles::default();
        let file = Arc::downgrade(&open_files.open(path.clone(), None).expect("a dataset"));
        open_files.sweep();
        assert!(file.upgrade().is_some());
        std::fs::remove_file(&path).expect("it is there");
        open_files.sweep();
        assert!(file.upgrade().is_none());
    }
}
