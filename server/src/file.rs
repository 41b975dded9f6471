//! One dataset file, open.

use std::{
    fs::{File, Metadata, OpenOptions},
    io,
    path::{Path, PathBuf},
    time::SystemTime,
};

use axum::http::HeaderValue;
use lodestream_preprocess::FileSource;
use lodestream_protocol::{Error as FormatError, HEADER_BYTES, Header};

use crate::{
    conditional::{Validators, http_date},
    disk,
    private_copy::CopyState,
    storage::{Object, Source},
};

/// An open file whose header is sound and which is as long as its header says.
#[derive(Debug)]
pub(crate) struct DatasetFile {
    pub(crate) path: PathBuf,
    pub(crate) source: Source,
    /// Length of the dataset in bytes; what the file may hold beyond it is not served.
    pub(crate) bytes: u64,
    /// Identity of the content.
    pub(crate) content_id: [u8; 16],
    pub(crate) validators: Validators,
    /// The entity tag as a response carries it.
    pub(crate) etag: HeaderValue,
    /// The modification time as a response carries it.
    pub(crate) last_modified: Option<HeaderValue>,
    pub(crate) private_copy: CopyState,
    /// Whether it is a file on a disk of this machine.
    pub(crate) is_local: bool,
    /// Length and modification time when it was opened, of a file of this machine.
    opened_as: Option<(u64, Option<SystemTime>)>,
}

/// Tells whether a path still leads to the file that was looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Identity {
    length: u64,
    modified: Option<SystemTime>,
    /// Device, inode, and when that was last changed in seconds and nanoseconds.
    #[cfg(unix)]
    inode: (u64, u64, i64, i64),
}

impl Identity {
    pub(crate) fn of(metadata: &Metadata) -> Self {
        #[cfg(unix)]
        use std::os::unix::fs::MetadataExt;
        Self {
            length: metadata.len(),
            modified: metadata.modified().ok(),
            #[cfg(unix)]
            inode: (metadata.dev(), metadata.ino(), metadata.ctime(), metadata.ctime_nsec()),
        }
    }
}

/// Why a dataset file cannot be served.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum OpenError {
    /// There is no such file.
    Missing,
    /// It is there, but no sound dataset (yet): the reason.
    Unreadable(String),
    /// The object store does not answer as it should. The log has been told why: that has addresses and
    /// more that clients need not know.
    Unanswered,
}

/// What clients are told of [`OpenError::Unanswered`].
pub(crate) const UNANSWERED: &str = "the object store does not answer as it should";

impl DatasetFile {
    /// Opens the file and looks at its header.
    pub(crate) fn open(path: PathBuf) -> Result<(Identity, Self), OpenError> {
        let (file, metadata) = open_regular(&path)?;
        let is_local = path.parent().is_some_and(|folder| disk::is_local(&file, folder));
        let source = FileSource::from(file);
        let mut head = [0; HEADER_BYTES];
        let read = source.read_into(&mut head, 0).map_err(unreadable)?;
        let header = Header::parse(&head[..read]).map_err(unreadable)?;
        let length = metadata.len();
        if length < header.file_bytes {
            return Err(unreadable(FormatError::Truncated {
                what: "dataset",
                needed: header.file_bytes,
                available: length,
            }));
        }
        let modified = metadata.modified().ok();
        let mut file = Self::sound(path, Source::File(source), &header, modified)?;
        file.opened_as = Some((length, modified));
        file.is_local = is_local;
        Ok((Identity::of(&metadata), file))
    }

    /// A dataset of an object store.
    pub(crate) fn of_object(object: Object) -> Result<Self, OpenError> {
        let (path, modified) = (PathBuf::from(object.name()), object.modified());
        let header = *object.header();
        Self::sound(path, Source::Object(object), &header, Some(modified))
    }

    fn sound(
        path: PathBuf,
        source: Source,
        header: &Header,
        modified: Option<SystemTime>,
    ) -> Result<Self, OpenError> {
        let validators = Validators {
            etag: format!("\"{}\"", header.content_id_hex()),
            modified: modified.and_then(|modified| http_date(modified, SystemTime::now())),
        };
        Ok(Self {
            path,
            source,
            bytes: header.file_bytes,
            content_id: header.content_id,
            etag: HeaderValue::from_str(&validators.etag).map_err(unreadable)?,
            last_modified: validators.modified.and_then(|m| m.to_string().try_into().ok()),
            private_copy: CopyState::default(),
            is_local: false,
            opened_as: None,
            validators,
        })
    }

    /// Whether nobody has cut the file short or written to it since it was opened. Asked after bytes
    /// were read: they are those of the dataset then, as a file is shorter before its bytes are gone. (An
    /// object is asked for by its tag.)
    pub(crate) fn is_unchanged(&self) -> bool {
        let Source::File(file) = &self.source else { return true };
        let metadata = file.file().metadata();
        metadata.is_ok_and(|now| Some((now.len(), now.modified().ok())) == self.opened_as)
    }
}

/// Opens a regular file; never waits for the other end of a pipe.
pub(crate) fn open_regular(path: &Path) -> Result<(File, Metadata), OpenError> {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits().cast_signed());
    }
    let file = options.open(path).map_err(missing_or_unreadable)?;
    match file.metadata() {
        Ok(metadata) if metadata.is_file() => Ok((file, metadata)),
        Ok(_) => Err(OpenError::Missing),
        Err(e) => Err(unreadable(e)),
    }
}

/// What a failure to reach a file means.
pub(crate) fn missing_or_unreadable(error: io::Error) -> OpenError {
    match error.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::InvalidFilename => OpenError::Missing,
        _ => unreadable(error),
    }
}

fn unreadable(reason: impl std::fmt::Display) -> OpenError {
    OpenError::Unreadable(reason.to_string())
}
