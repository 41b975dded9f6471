//! What the benches measure with.

use std::{
    env,
    error::Error,
    ffi::OsStr,
    path::{Path, PathBuf},
    process::Command,
};

use lodestream_tests::program;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// The dataset that `input` is, or the one that is built from it under that name.
pub fn dataset(input: &OsStr, name: &str) -> Result<PathBuf> {
    if Path::new(input).extension().is_some_and(|e| e == "lods") {
        return Ok(input.into());
    }
    let dataset = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut build = Command::new(program("lodestream")?);
    let status = build.arg("build").arg(input).arg("-o").arg(&dataset).status()?;
    Ok(status.success().then_some(dataset).ok_or("the build failed")?)
}
