//! Small JSON files that are kept: read with a bound, written as a whole or not at all.

use std::{
    io::{Read, Write},
    path::{Path, PathBuf},
};

use serde::{Serialize, de::DeserializeOwned};

/// Longest file that is read.
const MAX_BYTES: u64 = 16 << 20;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum StoredError {
    /// There is none.
    #[error("{path}: there is no such file")]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// It is not what it should be, or cannot be read.
    #[error("{path}: {why}")]
    Bad {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        why: String,
    },
    /// It cannot be written.
    #[error("{path}: cannot be written: {why}")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        why: String,
    },
}

/// Reads a file.
///
/// # Errors
/// [`StoredError::Missing`] and [`StoredError::Bad`].
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T, StoredError> {
    let bad = |why: String| StoredError::Bad { path: path.to_owned(), why };
    let file = match std::fs::File::open(path) {
        Ok(file) => file,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(StoredError::Missing { path: path.to_owned() });
        }
        Err(e) => return Err(bad(e.to_string())),
    };
    let mut text = String::new();
    let read = file.take(MAX_BYTES + 1).read_to_string(&mut text);
    if read.map_err(|e| bad(e.to_string()))? as u64 > MAX_BYTES {
        return Err(bad(format!("longer than {MAX_BYTES} bytes: not a file of this program")));
    }
    serde_json::from_str(&text).map_err(|e| bad(e.to_string()))
}

/// Writes a file, and the folders to it. Who reads it sees the old one or the new one, whole.
///
/// # Errors
/// [`StoredError::Write`].
pub fn write<T: Serialize>(path: &Path, value: &T) -> Result<(), StoredError> {
    let failed = |why: String| StoredError::Write { path: path.to_owned(), why };
    let mut text = serde_json::to_string_pretty(value).map_err(|e| failed(e.to_string()))?;
    text.push('\n');
    write_text(path, &text)
}

/// The same of what is a text already.
///
/// # Errors
/// [`StoredError::Write`].
pub fn write_text(path: &Path, text: &str) -> Result<(), StoredError> {
    let failed = |why: String| StoredError::Write { path: path.to_owned(), why };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let write = || {
        std::fs::create_dir_all(folder)?;
        let mut file = tempfile::NamedTempFile::new_in(folder)?;
        file.write_all(text.as_bytes())?;
        file.persist(path).map_err(|e| e.error)
    };
    write().map(drop).map_err(|e: std::io::Error| failed(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_and_what_is_wrong_is_named() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("some/where/numbers.json");
        assert!(matches!(read::<Vec<u8>>(&path), Err(StoredError::Missing { .. })));
        write(&path, &vec![1, 2, 3]).expect("written");
        assert_eq!(read::<Vec<u8>>(&path).expect("read"), [1, 2, 3]);
        std::fs::write(&path, "[1, 2").expect("written");
        let said = read::<Vec<u8>>(&path).expect_err("cut short").to_string();
        assert!(said.contains("numbers.json") && said.contains("line 1"), "{said}");
        let said = write(&path.join("below/a/file"), &1).expect_err("no folder").to_string();
        assert!(said.contains("cannot be written"), "{said}");
    }
}
