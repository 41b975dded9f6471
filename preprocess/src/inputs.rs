//! From what a user names to opened readers: files, folders, simulated scans.

use std::path::{Path, PathBuf};

use crate::{
    error::{Error, Result},
    readers::{self, InputInfo, PointReader},
};

/// An input, opened.
pub struct OpenedInput {
    /// What it will deliver.
    pub info: InputInfo,
    /// Delivers it.
    pub reader: Box<dyn PointReader>,
}

/// Endings of files that a folder is searched for.
const ENDINGS: &[&str] = &["las", "laz", "ply", "xyz", "csv", "txt", "pts", "asc"];

/// Opens all inputs; a folder stands for all its point clouds, in order of their names.
///
/// # Errors
/// The first input that cannot be opened.
pub fn open_all(inputs: &[String], columns: Option<&str>) -> Result<Vec<OpenedInput>> {
    if inputs.is_empty() {
        return Err(Error::Setup("no input given".into()));
    }
    let mut opened = Vec::new();
    for input in inputs {
        if input.starts_with("sim:") {
            opened.push(opened_input(readers::sim::open(input)?));
            continue;
        }
        let path = Path::new(input);
        if path.is_dir() {
            for file in point_clouds_in(path)? {
                opened.push(open_file(&file, columns)?);
            }
        } else {
            opened.push(open_file(path, columns)?);
        }
    }
    Ok(opened)
}

fn opened_input(reader: Box<dyn PointReader>) -> OpenedInput {
    OpenedInput { info: reader.info().clone(), reader }
}

fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

fn point_clouds_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(folder, "cannot list")(e);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        if path.is_file() && ENDINGS.contains(&ending(&path).as_str()) {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(Error::input(
            folder.display().to_string(),
            format!("no point clouds in this folder (looked for {})", ENDINGS.join(", ")),
        ));
    }
    Ok(files)
}

/// Opens a file by its first bytes, else by its ending.
fn open_file(path: &Path, columns: Option<&str>) -> Result<OpenedInput> {
    use std::io::Read;
    let mut start = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(8).read_to_end(&mut start))
        .map_err(Error::io(path, "cannot read"))?;
    let shown = path.display().to_string();
    if start.is_empty() {
        return Err(Error::input(shown, "the file is empty"));
    }
    let reader = if start.starts_with(b"LASF") {
        readers::las::open(path)?
    } else if start.starts_with(b"ply") {
        readers::ply::open(path)?
    } else if start.starts_with(&lodestream_protocol::MAGIC) {
        return Err(Error::input(
            shown,
            "is a lodestream dataset already; export it to LAS or PLY to build from it",
        ));
    } else {
        match ending(path).as_str() {
            "las" | "laz" => readers::las::open(path)?,
            "ply" => readers::ply::open(path)?,
            "xyz" | "csv" | "txt" | "pts" | "asc" => readers::text::open(path, columns)?,
            _ if columns.is_some() => readers::text::open(path, columns)?,
            other => {
                return Err(Error::input(
                    shown,
                    format!(
                        "not a point cloud that can be read: it starts with neither LASF nor ply, \
                         and .{other} is none of {}",
                        ENDINGS.join(", ")
                    ),
                ));
            }
        }
    };
    Ok(opened_input(reader))
}

/// What the manifest calls an input: its file name, or the whole of a simulated scan's name. Folders
/// would tell strangers about the machine, and make the same build differ between machines.
pub fn display_name(path: &str) -> String {
    if path.starts_with("sim:") {
        return path.into();
    }
    Path::new(path).file_name().map_or_else(|| path.into(), |n| n.to_string_lossy().into_owned())
}
